// The slabs between planes at a thread's pixels: classified, shaded and composited (SPEC §9).
//
// Needs gather/patch.wgsl: COMPOSITING, CUT, FIRST_HIT, PERSPECTIVE, SHEETS, control_points, cut, sheet_group.
// Needs gather/pixels.wgsl: Pixels.
// Needs gather/planes.wgsl: Fields, KERNEL_GRADIENT, PlaneSums, Sheets, fields_handed_on, fields_of, halves_handed_on, hand_on.
// Needs gather_planes.wgsl: planes.
// Needs shared/cells.wgsl: nearest_voxel, voxel_at.
// Needs shared/compositing.wgsl: composite.
// Needs shared/cut.wgsl: is_drawn_slab, noted, place_of, sheet_depths, shown_depths.
// Needs shared/frame.wgsl: FRONT_TO_BACK, frame.
// Needs shared/means.wgsl: both, in_box.
// Needs shared/project.wgsl: slope_of.
// Needs shared/ramps.wgsl: LABELS, ramp, ramps_of.
// Needs shared/shading.wgsl: lighting, shade.
// Needs shared/slab_integral.wgsl: slab_integral.
// Needs shared/texels.wgsl: index_of.
// Needs shared/volume.wgsl: HOLES, gradient_of, is_hole, stored_at.

// For a thread's four pixels: the sheet depths between which their rays count, the length of a ray per sheet depth, and the depths of first
// hits, as bits.
var<private> shown_from: vec4f;
var<private> shown_to: vec4f;
var<private> length_per_depth: vec4f;
var<private> hits: vec4u;

// Finds the stretches of the rays of a thread's four pixels, which lie in one column.
fn find_stretches(column: f32, rows: vec4f) {
    for (var i = 0u; i < 4u; i += 1u) {
        let point_px = vec2f(column, rows[i]);
        let at = place_of(point_px);
        var depths = in_box(at, cut.box_half.xyz);
        if CUT {
            depths = both(depths, shown_depths(point_px));
        }
        let sheets = sheet_depths(at, depths);
        let slope = slope_of(point_px);
        shown_from[i] = sheets.x;
        shown_to[i] = sheets.y;
        length_per_depth[i] = sqrt(1.0 + dot(slope, slope)) / abs(dot(cut.sheet_along.xyz, at));
    }
}

// The field at one pixel.
struct PixelField {
    has_value: bool,
    number: f32,
    gradient: vec3f,
}

fn sample_of(fields: Fields, i: u32) -> PixelField {
    return PixelField(fields.has_value[i], fields.number[i], vec3f(fields.x[i], fields.y[i], fields.z[i]));
}

// A slab at one pixel: if only one plane has a value, it holds for both.
struct Slab {
    near: PixelField,
    far: PixelField,
    has_value: bool,
}

fn slab_between(near: PixelField, far: PixelField) -> Slab {
    var slab = Slab(near, far, near.has_value || far.has_value);
    if !near.has_value {
        slab.near = far;
    }
    if !far.has_value {
        slab.far = near;
    }
    return slab;
}

// Whether a slab's range of values reaches values that have an opacity.
fn has_opacity(slab: Slab, ramps: vec4u) -> bool {
    let head = control_points[ramps.w];
    return slab.has_value && max(slab.near.number, slab.far.number) >= head.z && min(slab.near.number, slab.far.number) <= head.w;
}

// The sheet of a slab of which the ray shows a length.
fn sheet_of(slab: Slab, ramps: vec4u, length: f32, point_px: vec2f) -> vec4f {
    let means = slab_integral(ramps.w, slab.near.number, slab.far.number);
    let gradient = gradient_of(0.5 * planes.per_number * mix(slab.near.gradient, slab.far.gradient, means.share));
    var m = means.amount;
    for (var is_graded = ramps.w > ramps.z + 1u; is_graded; is_graded = false) {
        m *= ramp(ramps.z, ramps.w, gradient.magnitude).x;
    }
    let a = m * length;
    return vec4f(a * shade(means.color, gradient, lighting(point_px, PERSPECTIVE)), a);
}

// The ramps of the voxel whose cell holds a pixel's point at a sheet depth.
fn ramps_at(point_px: vec2f, sheet_depth: f32) -> vec4u {
    if !LABELS {
        return vec4u(0u, frame.ramps.xyz);
    }
    return ramps_of(0u, index_of(nearest_voxel(voxel_at(place_of(point_px), sheet_depth))));
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
    return sums;
}

fn one_of(first: vec4f, second: vec4f, third: vec4f, fourth: vec4f, j: u32) -> vec4f {
    let is_odd = vec4<bool>((j & 1u) != 0u);
    return select(select(first, second, is_odd), select(third, fourth, is_odd), vec4<bool>(j >= 2u));
}

// Composites a group's slabs at four pixels. The near plane's field comes from the previous group, and the last plane's goes to the next.
fn composite_slabs(image: mat4x4f, sheets: Sheets, pixels: Pixels) -> mat4x4f {
    var result = image;
    var near = fields_handed_on(pixels.thread, (halves_handed_on >> pixels.thread / 4u & 1u) != 0u);
    for (var j = 0u; j < SHEETS; j += 1u) {
        let depth = sheet_group.near + f32(j) * frame.slab_width;
        let far = without_holes(fields_of(sums_on(sheets, j)), pixels, depth + frame.slab_width);
        let from_depth = max(vec4f(depth), shown_from);
        let to_depth = min(vec4f(depth + frame.slab_width), shown_to);
        let is_seen = (from_depth < to_depth) & (near.has_value | far.has_value) & vec4<bool>(sheet_group.is_composited)
            & vec4<bool>(!CUT || is_drawn_slab(depth + 0.5 * frame.slab_width));
        let lengths = max(to_depth - from_depth, vec4f(0.0)) * length_per_depth;
        for (var i = 0u; i < 4u; i += 1u) {
            let slab = slab_between(sample_of(near, i), sample_of(far, i));
            let point_px = vec2f(pixels.column, pixels.rows[i]);
            let ramps = ramps_at(point_px, 0.5 * (from_depth[i] + to_depth[i]));
            for (var is_shown = is_seen[i] && has_opacity(slab, ramps); is_shown; is_shown = false) {
                let before = result[i];
                let after = composite(before, sheet_of(slab, ramps, lengths[i], point_px), COMPOSITING, FRONT_TO_BACK);
                result[i] = after;
                if FIRST_HIT {
                    let is_hit = before.a < cut.first_hit && after.a >= cut.first_hit;
                    let share = (cut.first_hit - before.a) / (after.a - before.a);
                    hits[i] = select(hits[i], noted(mix(from_depth[i], to_depth[i], share)), is_hit);
                }
            }
        }
        near = far;
    }
    hand_on(pixels.thread, near);
    let half = 1u << pixels.thread / 4u;
    let has_values = subgroupOr(select(0u, half, any(near.has_value)));
    halves_handed_on = (halves_handed_on & ~subgroupOr(half)) | has_values;
    return result;
}
