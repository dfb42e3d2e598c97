// How a voxel's kernel lies on the screen in perspective, where every voxel has its own ray (§3.3.2, end of §4.2).
struct LocalRay {
    // Grid units of the kernel per depth along the ray: λ/(r·w).
    kernel_per_depth: f32,
    // 1/λ
    per_lambda: f32,
    // The unit vector on the screen along one axis of the footprint's ellipse.
    axis: vec2f,
    // ρ² of one `unit` along that axis, and across it.
    metric: vec2f,
}

// Footprint coordinates are offsets parallel to the image, warped, without what is along the ray: crossed with its direction ro.
fn local_ray(px: vec2f) -> LocalRay {
    let ray = warped_ray(px);
    let size = length(ray);
    let right = cross(frame.right.xyz, ray / size);
    let down = cross(frame.down.xyz, ray / size);
    // The axes are the eigenvectors of the quadratic form ρ².
    let difference = dot(right, right) - dot(down, down);
    let product = 2.0 * dot(right, down);
    let is_circle = difference == 0.0 && product == 0.0;
    let angle = 0.5 * atan2(product, select(difference, 1.0, is_circle));
    let axis = vec2f(cos(angle), sin(angle));
    let along = axis.x * right + axis.y * down;
    let across = axis.x * down - axis.y * right;
    let slope = slope_of(px);
    let per_lambda = sqrt(1.0 + dot(slope, slope)) / size;
    return LocalRay(size, per_lambda, axis, vec2f(dot(along, along), dot(across, across)));
}

// How the footprints of a kernel's sections in up to four sheets lie on the screen: ρ² of a pixel along the axis and across it, and the low-pass rule's
// amplitude.
struct SectionMaps {
    along: vec4f,
    across: vec4f,
    amplitude: vec4f,
}

// The sections between planes at `near` and `far`, seen from the kernel's centre at the depth `from_eye`. Pixels have the size that
// they have at the section's middle; where sheets are slices, at the kernel's centre.
fn section_maps(ray: LocalRay, from_eye: f32, near: vec4f, far: vec4f) -> SectionMaps {
    let first = max(near, vec4f(-frame.radius));
    let last = max(min(far, vec4f(frame.radius)), first);
    let middle = select(vec4f(0.0), 0.5 * (first + last), frame.kernel_per_depth == 0.0);
    let pix = (from_eye + middle / ray.kernel_per_depth) * frame.pixel_per_depth;
    let along = ray.metric.x * pix * pix;
    let across = ray.metric.y * pix * pix;
    // The low-pass rule: at least a pixel for a grid unit.
    let amplitude = inverseSqrt(max(along, vec4f(1.0)) * max(across, vec4f(1.0)));
    return SectionMaps(min(along, vec4f(1.0)), min(across, vec4f(1.0)), amplitude);
}

// Where the near plane cuts a kernel, seen from its centre; without an eye nowhere.
fn near_cut(ray: LocalRay, from_eye: f32) -> f32 {
    return select(-1e9, (frame.near - from_eye) * ray.kernel_per_depth, frame.near > 0.0);
}
