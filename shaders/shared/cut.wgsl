// Cuts of a pixel's ray by clip planes and a host's surfaces, and the volume's box; `gpu::layout::Cut` documents the fields.
// The stage declares `cut` and `surfaces`.
//
// #import shared/frame

struct Cut {
    sheet_at: vec4f,
    sheet_along: vec4f,
    surface_depth: vec4f,
    surface_w: vec4f,
    planes: array<vec4f, 24>,
    box_at: array<vec4f, 3>,
    box_along: array<vec4f, 3>,
    box_half: vec4f,
    surface_origin: vec2u,
    no_surface: f32,
    first_hit: f32,
    unit: f32,
    none: f32,
    plane_count: u32,
    has_surfaces: u32,
    region: vec4f,
    slabs: vec4f,
}

// A number beyond every depth.
const FAR = 1e30;

// The position on the image that identifies a ray.
fn place_of(point_px: vec2f) -> vec3f {
    return vec3f(point_px - 0.5 * vec2f(frame.size), 1.0);
}

// The range of depths along w that are visible on the ray through a point of the image.
fn shown_depths(point_px: vec2f) -> vec2f {
    let at = place_of(point_px);
    var depths = vec2f(-FAR, FAR);
    // Neither a loop's end nor an `if` may depend on uniforms alone, for the reason given at `start`; and `&&` is an `if`.
    for (var i = zero; i < cut.plane_count + zero; i += 1u) {
        let distance = dot(cut.planes[2u * i].xyz, at);
        let slope = dot(cut.planes[2u * i + 1u].xyz, at);
        let crossing = -distance / slope;
        depths.x = select(depths.x, max(depths.x, crossing), slope > 0.0);
        depths.y = select(depths.y, min(depths.y, crossing), slope < 0.0);
        depths.y = select(depths.y, -FAR, (slope == 0.0) & (distance < 0.0));
    }
    let z = textureLoad(surfaces, vec2u(point_px) + cut.surface_origin, 0);
    let ndc = vec4f(at.xy, z, 1.0);
    let surface = dot(cut.surface_depth, ndc) / dot(cut.surface_w, ndc);
    let is_surface = (cut.has_surfaces != 0u) & (z != cut.no_surface);
    depths.y = select(depths.y, min(depths.y, surface), is_surface);
    let is_in_region = all(point_px > cut.region.xy) && all(point_px < cut.region.zw);
    return select(vec2f(FAR, -FAR), depths, is_in_region);
}

// Whether a slab whose middle has this sheet depth is composited (SPEC §11).
fn is_drawn_slab(middle: f32) -> bool {
    return (cut.slabs.x < middle) & (middle < cut.slabs.y);
}

// The share of a stretch of sheet depths that a ray from `ray.x` to `ray.y` shows. From what is missing, so that whole stretches are not rounded.
fn shown_share(ray: vec2f, near: f32, width: f32) -> f32 {
    let missing = max(ray.x - near, 0.0) + max(near + width - ray.y, 0.0);
    return max(1.0 - missing / width, 0.0);
}

// The sheet depth at which a ray enters through a cut whose face is not shaded, given its visible range of depths and those of its cuts; FAR if it does not.
fn face_depth(at: vec3f, depths: vec2f, cuts: vec2f, box_start: f32) -> f32 {
    let is_face = (cut.slabs.z != 0.0) & (cuts.x > box_start);
    let sheet = dot(cut.sheet_at.xyz, at) + dot(cut.sheet_along.xyz, at) * cuts.x;
    return select(FAR, sheet, is_face & (depths.x < depths.y));
}

// A range of depths on a ray, converted to sheet depths; an empty range stays reversed.
fn sheet_depths(at: vec3f, depths: vec2f) -> vec2f {
    let slope = dot(cut.sheet_along.xyz, at);
    let ends = dot(cut.sheet_at.xyz, at) + slope * depths;
    // Sheets are counted along w. A ray far off the axis may meet slices in reverse order, or stay within one.
    let sheets = select(vec2f(min(ends.x, ends.y), max(ends.x, ends.y)), vec2f(-FAR, FAR), slope == 0.0);
    return select(vec2f(FAR, -FAR), sheets, depths.x < depths.y);
}

// The range of sheet depths that are visible on the ray through a point of the image; reversed if it is empty.
fn shown(point_px: vec2f) -> vec2f {
    return sheet_depths(place_of(point_px), shown_depths(point_px));
}

// The depth along w at which the ray through a point of the image meets a sheet depth.
fn depth_along_ray(point_px: vec2f, sheet_depth: f32) -> f32 {
    let at = place_of(point_px);
    return (sheet_depth - dot(cut.sheet_at.xyz, at)) / dot(cut.sheet_along.xyz, at);
}

// The word that stores a first hit at a sheet depth. It is never 0, which stands for a pixel without a first hit.
fn noted(sheet_depth: f32) -> u32 {
    return bitcast<u32>(select(sheet_depth, 1e-30, sheet_depth == 0.0));
}
