// The sheets that a thread of the tile rasterizer holds, and how they are composited.
//
// #import gather/group
// #import gather/pixels
// #import gather/state
// #import shared/compositing
// #import shared/cut
// #import shared/frame
// #import shared/means

// The four sheets of a group at a thread's four pixels: red, green, blue and alpha columns.
struct Sheets {
    first: mat4x4f,
    second: mat4x4f,
    third: mat4x4f,
    fourth: mat4x4f,
}

// The sheets of all of a patch's threads, stored while some of a group's voxels still wait for the queue: 16 columns each.
var<workgroup> saved: array<vec4f, 16u * PATCH_THREADS>;

fn save_sheets(thread: u32, sheets: Sheets) {
    save_sheet(thread, 0u, sheets.first);
    save_sheet(thread, 4u, sheets.second);
    save_sheet(thread, 8u, sheets.third);
    save_sheet(thread, 12u, sheets.fourth);
}

fn save_sheet(thread: u32, column: u32, sheet: mat4x4f) {
    let first = column * PATCH_THREADS + thread;
    saved[first] = sheet[0];
    saved[first + PATCH_THREADS] = sheet[1];
    saved[first + 2u * PATCH_THREADS] = sheet[2];
    saved[first + 3u * PATCH_THREADS] = sheet[3];
}

fn saved_sheets(thread: u32) -> Sheets {
    return Sheets(saved_sheet(thread, 0u), saved_sheet(thread, 4u), saved_sheet(thread, 8u), saved_sheet(thread, 12u));
}

fn saved_sheet(thread: u32, column: u32) -> mat4x4f {
    let first = column * PATCH_THREADS + thread;
    return mat4x4f(
        saved[first],
        saved[first + PATCH_THREADS],
        saved[first + 2u * PATCH_THREADS],
        saved[first + 3u * PATCH_THREADS],
    );
}

// The contribution of a voxel to a sheet at four pixels.
fn added(section: vec4f, amount: vec4f) -> mat4x4f {
    return mat4x4f(section * amount.x, section * amount.y, section * amount.z, section * amount.w);
}

// The weights of sheets at these pixels, see `Means`.
var<private> weights: vec4f;
var<private> counted_from: vec4f;
var<private> counted_to: vec4f;

// Determines the cuts and weights for the rays of a thread's four pixels, which are in one column.
fn find_stretches(column: f32, rows: vec4f) {
    // From `zero` on, so that drivers compile one pixel's cuts and not four.
    for (var i = zero; (CUT || is_by_means()) && i < 4u; i += 1u) {
        let here = PIXELS == vec4u(i);
        let point_px = vec2f(column, rows[i]);
        if CUT {
            let across = shown(point_px);
            shown_from = select(shown_from, vec4f(across.x), here);
            shown_to = select(shown_to, vec4f(across.y), here);
        }
        if is_by_means() {
            let across = means(point_px);
            weights = select(weights, vec4f(across.weight), here);
            counted_from = select(counted_from, vec4f(across.counted.x), here);
            counted_to = select(counted_to, vec4f(across.counted.y), here);
        }
    }
}

// Four pixels, selected from two images.
fn chosen(otherwise: mat4x4f, here: mat4x4f, is_here: vec4<bool>) -> mat4x4f {
    return mat4x4f(
        select(otherwise[0], here[0], is_here.x),
        select(otherwise[1], here[1], is_here.y),
        select(otherwise[2], here[2], is_here.z),
        select(otherwise[3], here[3], is_here.w),
    );
}

// Composites a sheet over or under the image at four pixels; its slab begins at the sheet depth `near`.
fn composite_sheet(image: mat4x4f, sheet: mat4x4f, near: f32) -> mat4x4f {
    var pixels = transpose(sheet);
    var first = vec4f(near);
    var last = vec4f(near + frame.slab_width);
    var scale = vec4f(1.0);
    if CUT {
        first = max(first, shown_from);
        last = min(last, shown_to);
        if COMPOSITING != MINIMUM {
            scale = vec4f(
                shown_share(vec2f(shown_from.x, shown_to.x), near, frame.slab_width),
                shown_share(vec2f(shown_from.y, shown_to.y), near, frame.slab_width),
                shown_share(vec2f(shown_from.z, shown_to.z), near, frame.slab_width),
                shown_share(vec2f(shown_from.w, shown_to.w), near, frame.slab_width),
            );
        }
    }
    if is_by_means() {
        scale *= weights;
    }
    if CUT || is_by_means() {
        pixels = mat4x4f(pixels[0] * scale.x, pixels[1] * scale.y, pixels[2] * scale.z, pixels[3] * scale.w);
    }
    var result = mat4x4f(
        composite(image[0], pixels[0], COMPOSITING, ORDER),
        composite(image[1], pixels[1], COMPOSITING, ORDER),
        composite(image[2], pixels[2], COMPOSITING, ORDER),
        composite(image[3], pixels[3], COMPOSITING, ORDER),
    );
    if COMPOSITING == MINIMUM {
        let middle = vec4f(near + 0.5 * frame.slab_width);
        result = chosen(image, result, (counted_from <= middle) & (middle <= counted_to));
    }
    if CUT {
        result = chosen(image, result, vec4<bool>(is_drawn_slab(near + 0.5 * frame.slab_width)));
    }
    if FIRST_HIT {
        let before = transpose(image)[3];
        let after = transpose(result)[3];
        var is_hit = (before < vec4f(cut.first_hit)) & (after >= vec4f(cut.first_hit));
        var sheet_depths = mix(first, last, (cut.first_hit - before) / (after - before));
        if COMPOSITING == SURFACE {
            is_hit = (before < vec4f(1.0)) & (after >= vec4f(1.0));
            // As in `crossing`, from the middle of the previous slab.
            let opacity = transpose(pixels)[3];
            sheet_depths = near + ((0.5 - before) / (opacity - before) - 0.5) * frame.slab_width;
            if CUT {
                sheet_depths = clamp(sheet_depths, shown_from, shown_to);
            }
        }
        let here = vec4u(noted(sheet_depths.x), noted(sheet_depths.y), noted(sheet_depths.z), noted(sheet_depths.w));
        hits = select(hits, here, is_hit);
    }
    return result;
}

// Composites a group's sheets over or under the image; the first begins at the sheet depth `near`.
fn composite_group(image: mat4x4f, sheets: Sheets, near: f32) -> mat4x4f {
    var result = image;
    for (var i = zero; i < SHEETS; i += 1u) {
        let at = select(SHEETS - 1u - i, i, ORDER == FRONT_TO_BACK);
        result = composite_sheet(result, sheet_at(sheets, at), near + f32(at) * frame.slab_width);
    }
    return result;
}

fn sheet_at(sheets: Sheets, at: u32) -> mat4x4f {
    let is_odd = vec4<bool>((at & 1u) != 0u);
    return chosen(chosen(sheets.first, sheets.second, is_odd), chosen(sheets.third, sheets.fourth, is_odd), vec4<bool>(at >= 2u));
}
