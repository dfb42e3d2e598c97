// The place of a voxel on the screen.
//
// #import shared/frame

// A voxel's pixel coordinates, sheet depth, and depth from the eye.
fn project(voxel: vec3u) -> vec4f {
    return on_screen(homogeneous(vec4f(vec3f(voxel), 1.0)));
}

// The products of the rows of `screen_from_voxel` with a voxel or, if the last component is 0, with a step between voxels.
fn homogeneous(p: vec4f) -> vec4f {
    let rows = frame.screen_from_voxel;
    return vec4f(dot(rows[0], p), dot(rows[1], p), dot(rows[2], p), dot(rows[3], p));
}

// The pixel coordinates of a homogeneous point beyond the near plane; its other components stay.
fn on_screen(p: vec4f) -> vec4f {
    return vec4f(p.xy / max(p.w, frame.near) + 0.5 * vec2f(frame.size), p.zw);
}

// The direction of a ray in the warped grid, scaled to a depth of 1, from the pixel that it passes through.
fn warped_ray(px: vec2f) -> vec3f {
    let slope = slope_of(px);
    return frame.right.xyz * slope.x + frame.down.xyz * slope.y + frame.ahead.xyz;
}

// The slope of a ray to the right and down per unit of depth; 0 without an eye.
fn slope_of(px: vec2f) -> vec2f {
    return select(vec2f(0.0), (px - 0.5 * vec2f(frame.size)) * frame.pixel_per_depth, frame.near > 0.0);
}

// The range of sheet depths in which a kernel overlaps sheets by more than `error`, the rounding errors of depths: a kernel that ends at a plane does
// not reach the sheet behind it. Empty before the near plane.
fn overlapped(p: vec4f, error: f32, in_perspective: bool) -> vec2f {
    var reach = vec2f(frame.reach);
    if in_perspective && frame.kernel_per_depth == 0.0 {
        reach = vec2f(frame.radius / length(warped_ray(p.xy)));
        reach.x = min(reach.x, p.w - frame.near);
    }
    // A voxel on the near plane counts as before it, whatever the rounding.
    let is_beyond_near = p.w > frame.near * 1.000001;
    return select(vec2f(1e9, -1e9), p.z + vec2f(error - reach.x, reach.y - error), is_beyond_near);
}
