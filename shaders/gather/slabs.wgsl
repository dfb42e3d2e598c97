// The slabs between planes at a thread's pixels: classified, shaded and composited (SPEC §9).
//
// #import gather/group
// #import gather/lanes
// #import gather/pixels
// #import gather/plane_reach
// #import gather/planes
// #import gather/state
// #import shared/cells
// #import shared/channels
// #import shared/cut
// #import shared/first_surface
// #import shared/frame
// #import shared/means
// #import shared/planes
// #import shared/project
// #import shared/ramps
// #import shared/seen
// #import shared/shading
// #import shared/slab
// #import shared/slab_integral
// #import shared/texels
// #import shared/volume

// What pixels carry from plane to plane; see `shared/slab`.
@group(0) @binding(5) var<storage, read_write> carried: array<vec4u>;

// The length of a ray per sheet depth at a thread's four pixels.
var<private> length_per_depth: vec4f;

// The sheet depths at which these rays enter through cuts whose faces are not shaded.
var<private> face_at: vec4f;

// Finds the stretches of the rays of a thread's four pixels, which lie in one column.
fn find_stretches(column: f32, rows: vec4f) {
    // From `zero` on, so that drivers compile one pixel's cuts and not four.
    for (var i = zero; i < 4u; i += 1u) {
        let here = PIXELS == vec4u(i);
        let point_px = vec2f(column, rows[i]);
        let at = place_of(point_px);
        var depths = in_box(at, cut.box_half.xyz);
        var face = FAR;
        if CUT {
            let cuts = shown_depths(point_px);
            let in_volume = depths;
            depths = both(depths, cuts);
            face = face_depth(at, depths, cuts, in_volume.x);
        }
        let sheets = sheet_depths(at, depths);
        let slope = slope_of(point_px);
        face_at = select(face_at, vec4f(face), here);
        shown_from = select(shown_from, vec4f(sheets.x), here);
        shown_to = select(shown_to, vec4f(sheets.y), here);
        let length = sqrt(1.0 + dot(slope, slope)) / abs(dot(cut.sheet_along.xyz, at));
        length_per_depth = select(length_per_depth, vec4f(length), here);
    }
}

// Masks of the halves of blocks in which the plane that the previous group handed on, or that this one hands on, has values of some layer.
var<private> halves_handed_here: u32;
var<private> halves_handed_on: u32;

// A mask of the halves of blocks in which a layer of the group has been drawn.
var<private> halves_with_sheets: u32;

// For each of a thread's rounds a bit for every slab and pixel that has a sheet, added up over layers.
var<private> sheets_of_layers: vec4u;

fn sample_of(fields: Fields, i: u32) -> vec4f {
    let sample = vec4f(fields.number[i], fields.x[i], fields.y[i], fields.z[i]);
    return select(NO_SAMPLE, sample, fields.has_value[i]);
}

// Whether the values in a slab reach some that have an opacity; for `surface` of one half.
fn has_opacity(slab: Slab, table: Table) -> bool {
    let head = table.head;
    return max(slab.first.x, slab.last.x) >= head.z && min(slab.first.x, slab.last.x) <= head.w;
}

// The place of a thread's `i`-th pixel among the records that pixels carry. A pixel off the image has that of the last one, and carries nothing.
fn carried_slot(pixels: Pixels, i: u32) -> u32 {
    return min(pixels.slot + i * frame.size.x, carried_pixels() - 1u);
}

// The number of pixels that carry something: those of the band.
fn carried_pixels() -> u32 {
    return arrayLength(&acc);
}

// Finds in which halves of blocks the plane that an earlier dispatch handed on has values.
fn find_handed_on(pixels: Pixels) {
    passes += 6u * CHANNELS + 1u;
    var is_any = false;
    for (var layer = 0u; layer < CHANNELS; layer += 1u) {
        for (var i = 0u; i < 4u; i += 1u) {
            let held = carried[layer * carried_pixels() + carried_slot(pixels, i)] ^ NOTHING_CARRIED;
            is_any = is_any || (pixels.is_inside[i] && bitcast<f32>(held.x) != NO_NUMBER);
        }
    }
    note_handed_on(pixels, is_any);
}

// Notes whether a thread's pixels have values on the plane that is handed on.
fn note_handed_on(pixels: Pixels, is_any: bool) {
    halves_handed_on |= united(select(0u, 1u << (pixels.thread / 4u), is_any));
}

// Removes a plane's values where the nearest voxel is a hole.
fn without_holes(fields: Fields, pixels: Pixels, sheet_depth: f32) -> Fields {
    var result = fields;
    if HOLES {
        for (var i = 0u; i < 4u; i += 1u) {
            let place = voxel_at(place_of(vec2f(pixels.column, pixels.rows[i])), sheet_depth);
            result.has_value[i] = result.has_value[i] && !is_hole(stored_at(index_of(nearest_voxel(place))));
        }
    }
    return result;
}

// The sums on the `j`-th of the group's planes.
fn sums_on(sheets: Sheets, j: u32) -> PlaneSums {
    var sums: PlaneSums;
    sums.weight = one_of(sheets.first.weight, sheets.second.weight, sheets.third.weight, sheets.fourth.weight, j);
    sums.number = one_of(sheets.first.number, sheets.second.number, sheets.third.number, sheets.fourth.number, j);
    sums.x = one_of(sheets.first.x, sheets.second.x, sheets.third.x, sheets.fourth.x, j);
    sums.y = one_of(sheets.first.y, sheets.second.y, sheets.third.y, sheets.fourth.y, j);
    sums.z = one_of(sheets.first.z, sheets.second.z, sheets.third.z, sheets.fourth.z, j);
    if KERNEL_GRADIENT {
        sums.offset_x = one_of(sheets.first.offset_x, sheets.second.offset_x, sheets.third.offset_x, sheets.fourth.offset_x, j);
        sums.offset_y = one_of(sheets.first.offset_y, sheets.second.offset_y, sheets.third.offset_y, sheets.fourth.offset_y, j);
        sums.offset_z = one_of(sheets.first.offset_z, sheets.second.offset_z, sheets.third.offset_z, sheets.fourth.offset_z, j);
    }
    if OWN_COLORS {
        sums.red = one_of(sheets.first.red, sheets.second.red, sheets.third.red, sheets.fourth.red, j);
        sums.green = one_of(sheets.first.green, sheets.second.green, sheets.third.green, sheets.fourth.green, j);
        sums.blue = one_of(sheets.first.blue, sheets.second.blue, sheets.third.blue, sheets.fourth.blue, j);
        sums.alpha = one_of(sheets.first.alpha, sheets.second.alpha, sheets.third.alpha, sheets.fourth.alpha, j);
    }
    return sums;
}

fn one_of(first: vec4f, second: vec4f, third: vec4f, fourth: vec4f, j: u32) -> vec4f {
    let is_odd = vec4<bool>((j & 1u) != 0u);
    return select(select(first, second, is_odd), select(third, fourth, is_odd), vec4<bool>(j >= 2u));
}

// Four numbers at each of a thread's pixels, number by number. Loops over pixels read them by component: drivers unroll loops that index arrays.
struct Records {
    x: vec4u,
    y: vec4u,
    z: vec4u,
    w: vec4u,
}

fn record_at(of_pixels: Records, i: u32) -> vec4u {
    return vec4u(of_pixels.x[i], of_pixels.y[i], of_pixels.z[i], of_pixels.w[i]);
}

fn with_record(of_pixels: Records, i: u32, record: vec4u) -> Records {
    let here = PIXELS == vec4u(i);
    return Records(
        select(of_pixels.x, vec4u(record.x), here),
        select(of_pixels.y, vec4u(record.y), here),
        select(of_pixels.z, vec4u(record.z), here),
        select(of_pixels.w, vec4u(record.w), here),
    );
}

fn color_of_pixel(columns: mat4x4f, i: u32) -> vec4f {
    return vec4f(columns[0][i], columns[1][i], columns[2][i], columns[3][i]);
}

fn with_color(columns: mat4x4f, i: u32, color: vec4f) -> mat4x4f {
    let here = PIXELS == vec4u(i);
    return mat4x4f(
        select(columns[0], vec4f(color.x), here),
        select(columns[1], vec4f(color.y), here),
        select(columns[2], vec4f(color.z), here),
        select(columns[3], vec4f(color.w), here),
    );
}

// Composites a layer's slabs at four pixels, or adds them to those of other layers. The near plane's field comes from the previous group, and the last
// plane's goes to the next. First it is found which slabs may show anything; then every thread takes one of its own after the other, because drivers
// that execute masked code take as long for those that show nothing.
fn composite_slabs(image: mat4x4f, sheets: Sheets, pixels: Pixels) -> mat4x4f {
    var result = transpose(image);
    var held: Records;
    var held_colors: mat4x4f;
    for (var i = 0u; i < 4u; i += 1u) {
        held = with_record(held, i, carried_by(carried_slot(pixels, i), carried_pixels()));
        held_colors = with_color(held_colors, i, carried_color(carried_slot(pixels, i), carried_pixels()));
    }
    let points = Points(held, held_colors, pixels.thread);
    // Bits of slabs, the four pixels of one after those of the other.
    var shown = 0u;
    var is_handed_on = false;
    for (var j = 0u; j < SHEETS; j += 1u) {
        let near = sheet_group.near + f32(j) * frame.slab_width;
        let far = near + frame.slab_width;
        let sums = sums_on(sheets, j);
        let fields = without_holes(fields_of(sums), pixels, far);
        let plane_colors = colors_of(sums, fields.has_value);
        for (var i = 0u; i < 4u; i += 1u) {
            let at = 4u * j + i;
            let drawn = sample_of(fields, i);
            let before = sample_before(points, at);
            saved[sample_slot(at, pixels.thread)] = drawn;
            if OWN_COLORS {
                saved[color_slot(at, pixels.thread)] = color_of_pixel(plane_colors, i);
            }
            let none = vec4f(0.0);
            let slab = slab_between(place_in_slab(pixels, i, near, far), drawn, before, none, none);
            let has_number = min(drawn.x, before.x) != NO_NUMBER;
            let is_shown = has_number && may_show(slab, part_of(slab.ray, near, far), color_of_pixel(result, i));
            shown |= select(0u, 1u << at, is_shown && pixels.is_inside[i]);
        }
        is_handed_on = any(fields.has_value & pixels.is_inside);
    }

    var left = shown | select(0u, slabs_of_layers(pixels.thread), is_last_layer());
    var count = 0u;
    while left != 0u {
        count += 1u;
        let at = firstTrailingBit(left);
        left &= left - 1u;
        let i = at % 4u;
        let near = sheet_group.near + f32(at / 4u) * frame.slab_width;
        let far = near + frame.slab_width;
        let before = with_sample(record_at(held, i), sample_before(points, at));
        let has_sum = COMPOSITING == AVERAGE && before.z != 0u;
        var color_before = vec4f(0.0);
        var drawn_color = vec4f(0.0);
        if OWN_COLORS {
            // The sum of an average's colours stays where a plane has no number.
            color_before = select(color_before_slab(points, at), color_of_pixel(held_colors, i), has_sum);
            drawn_color = saved[color_slot(at, pixels.thread)];
        }
        var now = Composited(color_of_pixel(result, i), before, select(drawn_color, color_before, has_sum), FAR, false);
        let place = place_in_slab(pixels, i, near, far);
        let drawn = saved[sample_slot(at, pixels.thread)];
        let slab = slab_between(place, drawn, carried_sample(before), drawn_color, color_before);
        let part = part_of(slab.ray, near, far);
        let light = lighting(vec2f(pixels.column, pixels.rows[i]), PERSPECTIVE);
        if is_chosen_from() {
            now = choose(slab, now.image, before, color_before, light);
        } else if COMPOSITING == SURFACE {
            let found = find_surface(slab, now.image, light);
            now = Composited(found.image, now.carried, now.carried_color, found.hit, found.is_changed);
        } else {
            let is_own = CHANNELS == 1u || ((shown >> at) & 1u) != 0u;
            var own = SlabSheets();
            for (var is_seen = is_own; is_seen; is_seen = false) {
                own = sheets_of(slab, light);
            }
            let added = composite_layer(own, slab, now.image, pixels, at);
            now = Composited(added.image, now.carried, now.carried_color, added.hit, added.is_changed);
        }
        result = with_color(result, i, now.image);
        if FIRST_HIT && now.is_changed && (is_by_means() || now.hit != FAR) {
            let hit = select(noted(now.hit), 0u, now.hit == FAR);
            hits = select(hits, vec4u(hit), PIXELS == vec4u(i));
        }
        if is_chosen_from() {
            held = with_record(held, i, now.carried);
            held_colors = with_color(held_colors, i, now.carried_color);
        } else {
            let tested = (at / (4u * SHEETS_PER_TEST) + 1u) * 4u * SHEETS_PER_TEST;
            left &= ~select(0u, (0x1111u << i) & (0xffffu << tested), !is_open(now.image));
        }
    }
    passes += largest(count) * gather.search_passes;

    for (var i = 0u; i < 4u; i += 1u) {
        let last = 4u * (SHEETS - 1u) + i;
        let record = with_sample(record_at(held, i), saved[sample_slot(last, pixels.thread)]);
        if pixels.is_inside[i] {
            carry(carried_slot(pixels, i), carried_pixels(), record);
            if OWN_COLORS {
                let has_sum = COMPOSITING == AVERAGE && record.z != 0u;
                let color = select(saved[color_slot(last, pixels.thread)], color_of_pixel(held_colors, i), has_sum);
                carry_color(carried_slot(pixels, i), carried_pixels(), color);
            }
        }
    }
    note_handed_on(pixels, is_handed_on);
    halves_with_sheets |= halves_of(pixels.thread);
    return transpose(result);
}

// The samples on a group's planes at a thread's pixels: those that the previous group handed on, and the others in `saved`, which no longer holds sums.
struct Points {
    held: Records,
    held_colors: mat4x4f,
    thread: u32,
}

// The slots of the sample and the colour on a slab's far plane.
fn sample_slot(at: u32, thread: u32) -> u32 {
    return at * PATCH_THREADS + thread;
}

fn color_slot(at: u32, thread: u32) -> u32 {
    return (at + 4u * SHEETS) * PATCH_THREADS + thread;
}

// The sample and the colour on a slab's near plane, which is the far plane of the slab before.
fn sample_before(points: Points, at: u32) -> vec4f {
    let handed_on = carried_sample(record_at(points.held, at % 4u));
    return select(saved[sample_slot(max(at, 4u) - 4u, points.thread)], handed_on, at < 4u);
}

fn color_before_slab(points: Points, at: u32) -> vec4f {
    let handed_on = color_of_pixel(points.held_colors, at % 4u);
    return select(saved[color_slot(max(at, 4u) - 4u, points.thread)], handed_on, at < 4u);
}

// The ray of a thread's `i`-th pixel in a slab.
fn place_in_slab(pixels: Pixels, i: u32, near: f32, far: f32) -> Slab {
    let px = vec2f(pixels.column, pixels.rows[i]);
    return place_between(px, place_of(px), near, far, vec3f(shown_from[i], shown_to[i], face_at[i]), length_per_depth[i]);
}

// Whether a slab may change a pixel of some colour.
fn may_show(slab: Slab, part: vec2f, image: vec4f) -> bool {
    // Every point counts among the numbers that are chosen.
    if is_chosen_from() {
        return true;
    }
    let is_seen = part.x < part.y && is_drawn(slab.near + 0.5 * frame.slab_width);
    // Labels' tables differ from cell to cell.
    let is_among = has_opacity(slab, table_at(slab.at, 0.5 * (part.x + part.y), 0.0)) || (LABELS && COMPOSITING == SURFACE);
    return is_open(image) && is_seen && is_among;
}

// The number of sheets after which pixels are tested for being opaque.
override SHEETS_PER_TEST: u32 = 1u;

fn is_open(image: vec4f) -> bool {
    return frame.culling == 0u || image.a < frame.opacity_threshold;
}

// Whether a pixel's colour is that of a number chosen from all points.
fn is_chosen_from() -> bool {
    return is_by_means() && COMPOSITING != SURFACE;
}

// The slabs of a thread in which layers have sheets, as bits.
fn slabs_of_layers(thread: u32) -> u32 {
    let round = thread / THREADS;
    return (sheets_of_layers[round / 2u] >> (16u * (round % 2u))) & 0xffffu;
}

// The nearer sheets of a group's first slab at all of a patch's pixels, added up over layers. All others are behind the records that pixels carry:
// here they would take the queue's room, and all of a group there would make the second channel's memory more than the first one's.
override LAYER_SHEETS: u32 = 1u;
var<workgroup> layer_sheets: array<vec4f, LAYER_SHEETS>;

// The record of a sheet, counted from the last one.
fn sheet_record(pixels: Pixels, slab: u32, number: u32) -> u32 {
    return arrayLength(&carried) - number * carried_pixels() + carried_slot(pixels, slab % 4u);
}

fn near_sheet_record(pixels: Pixels, slab: u32) -> u32 {
    return sheet_record(pixels, slab, SHEETS - max(slab / 4u, 1u));
}

fn far_sheet_record(pixels: Pixels, slab: u32) -> u32 {
    return sheet_record(pixels, slab, 2u * SHEETS - 1u - slab / 4u);
}

fn layer_sheets_of(pixels: Pixels, slab: u32) -> SlabSheets {
    let first = layer_sheets[(slab % 4u) * PATCH_THREADS + pixels.thread];
    var sheets = SlabSheets(select(bitcast<vec4f>(carried[near_sheet_record(pixels, slab)]), first, slab < 4u), vec4f(0.0));
    for (var is_read = SEGMENTS > 1u; is_read; is_read = false) {
        sheets.far = bitcast<vec4f>(carried[far_sheet_record(pixels, slab)]);
    }
    return sheets;
}

fn keep_layer_sheets(pixels: Pixels, slab: u32, sheets: SlabSheets) {
    if slab < 4u {
        layer_sheets[slab * PATCH_THREADS + pixels.thread] = sheets.near;
    } else {
        carried[near_sheet_record(pixels, slab)] = bitcast<vec4u>(sheets.near);
    }
    if SEGMENTS > 1u {
        carried[far_sheet_record(pixels, slab)] = bitcast<vec4u>(sheets.far);
    }
}

// Adds a layer's sheets to those of the layers before it, and composites the sums of all. `number` is that of the slab and pixel among the
// thread's.
fn composite_layer(own: SlabSheets, slab: Slab, image: vec4f, pixels: Pixels, number: u32) -> Composited {
    var sum = own;
    if CHANNELS > 1u {
        let round = pixels.thread / THREADS;
        let bit = select(vec4u(0u), vec4u(1u << (number + 16u * (round % 2u))), vec4u(round / 2u) == PIXELS);
        let is_added = max(own.near.a, own.far.a) > 0.0;
        let is_after_others = any((sheets_of_layers & bit) != vec4u(0u));
        for (var is_read = is_after_others && (is_added || is_last_layer()); is_read; is_read = false) {
            let before = layer_sheets_of(pixels, number);
            sum = SlabSheets(sum.near + before.near, sum.far + before.far);
        }
        for (var is_kept = is_added && !is_last_layer(); is_kept; is_kept = false) {
            keep_layer_sheets(pixels, number, sum);
        }
        sheets_of_layers |= select(vec4u(0u), bit, is_added);
    }
    var composited = Composited(image, vec4u(), vec4f(), FAR, false);
    for (var is_due = is_last_layer() && max(sum.near.a, sum.far.a) > 0.0; is_due; is_due = false) {
        composited = composite_sheets(sum, slab.ray, slab.near, image);
    }
    return composited;
}
