// Quads of voxels that are drawn onto a slab plane (SPEC §9).
// The stage declares `planes` and `sheet_group`.
//
// #import shared/corners
// #import shared/field_voxel
// #import shared/frame
// #import shared/planes

// Where a voxel's quad lies.
struct QuadOnPlane {
    position: vec4f,
    center_px: vec2f,
    // Two rows: from pixel offsets to grid units along the planes' axes.
    rows: vec4f,
    // The plane's distance from the voxel.
    distance: f32,
}

// A vertex of the quad of a voxel, which has no area if it is not drawn.
fn quad_on_plane(voxel: FieldVoxel, vertex: u32, is_drawn: bool) -> QuadOnPlane {
    let lies = on_plane(vec2f(voxel.x, voxel.y), voxel.depth, sheet_group.near);
    let extent = sqrt(max(frame.radius * frame.radius - lies.distance * lies.distance, 0.0));
    let reach = (extent + MARGIN) / lies.per_pixel;
    let side = side_of(vertex);
    let axis = planes.screen_axis;
    let a = axis * reach.x;
    let b = vec2f(-axis.y, axis.x) * reach.y;
    let corner = clip_corner(lies.center_px, a * side.x + b * side.y, side, abs(a) + abs(b));
    return QuadOnPlane(
        select(NOWHERE, corner, extent > 0.0 && is_drawn),
        lies.center_px,
        vec4f(axis * lies.per_pixel.x, vec2f(-axis.y, axis.x) * lies.per_pixel.y),
        lies.distance,
    );
}

// -falloff, and the radius squared.
fn plane_kernel() -> vec2f {
    return vec2f(-frame.falloff, frame.radius * frame.radius);
}

// The point from the voxel, in grid units along the planes' axes and normal. `offset` is in pixels from the quad's centre.
fn from_voxel(rows: vec4f, offset: vec2f, distance: f32) -> vec3f {
    return vec3f(dot(rows.xy, offset), dot(rows.zw, offset), distance);
}

// A kernel's weight at such a point.
fn weight_at(place: vec3f, kernel: vec2f) -> f32 {
    let squared = dot(place, place);
    return select(0.0, exp(kernel.x * squared), squared < kernel.y);
}
