// The map from a voxel's kernel to the screen in perspective, where every voxel has its own ray (§3.3.2, end of §4.2).
//
// #import shared/frame
// #import shared/project

struct LocalRay {
    // Grid units of the kernel per unit of depth along the ray: λ/(r·w).
    kernel_per_depth: f32,
    // 1/λ
    per_lambda: f32,
    // The unit vector on the screen along one axis of the footprint's ellipse.
    axis: vec2f,
    // ρ² of one `unit` along that axis and across it.
    metric: vec2f,
}

// Footprint coordinates are warped offsets parallel to the image without their component along the ray, so their cross product with ro.
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

// The maps of a kernel's sections in up to four sheets to the screen: ρ² of a pixel along the axis and across it, and the low-pass rule's
// amplitude.
struct SectionMaps {
    along: vec4f,
    across: vec4f,
    amplitude: vec4f,
}

// The maps of the sections between planes at `near` and `far`, relative to the kernel's centre at the depth `from_eye`. The size of pixels is
// that at the section's middle, or at the kernel's centre if sheets are slices.
fn section_maps(ray: LocalRay, from_eye: f32, near: vec4f, far: vec4f) -> SectionMaps {
    let first = max(near, vec4f(-frame.radius));
    let last = max(min(far, vec4f(frame.radius)), first);
    let middle = select(vec4f(0.0), 0.5 * (first + last), frame.kernel_per_depth == 0.0);
    let pix = (from_eye + middle / ray.kernel_per_depth) * frame.pixel_per_depth;
    let along = ray.metric.x * pix * pix;
    let across = ray.metric.y * pix * pix;
    // The low-pass rule: at least one pixel per grid unit.
    let amplitude = inverseSqrt(max(along, vec4f(1.0)) * max(across, vec4f(1.0)));
    return SectionMaps(min(along, vec4f(1.0)), min(across, vec4f(1.0)), amplitude);
}

// The near and far planes of up to four sheets along a kernel's ray, relative to its centre; clipped at the near plane.
struct SheetPlanes {
    near: vec4f,
    far: vec4f,
    // The distance between the planes, without the near plane's cut.
    thickness: f32,
}

// The sheets from `near` on.
fn sheet_planes(ray: LocalRay, depth: f32, from_eye: f32, near: f32) -> SheetPlanes {
    let per_depth = select(frame.kernel_per_depth, ray.kernel_per_depth, frame.kernel_per_depth == 0.0);
    let cut = vec4f(near_cut(ray, from_eye));
    let depths = near - depth + vec4f(0.0, 1.0, 2.0, 3.0) * frame.slab_width;
    let near_planes = max(depths * per_depth, cut);
    let far_planes = max((depths + frame.slab_width) * per_depth, cut);
    return SheetPlanes(near_planes, far_planes, frame.slab_width * per_depth);
}

// The position at which the near plane cuts a kernel, relative to its centre; far away without an eye.
fn near_cut(ray: LocalRay, from_eye: f32) -> f32 {
    return select(-1e9, (frame.near - from_eye) * ray.kernel_per_depth, frame.near > 0.0);
}

// The number of a group's sections, in the sheets from `sheets.x` to the one before `sheets.y`, whose own boxes contain a pixel: the group's box
// is larger.
fn sections_on_screen(center_px: vec2f, axis: vec2f, maps: SectionMaps, sheets: vec2f) -> u32 {
    let squared = axis * axis;
    let x = frame.support * sqrt(squared.x / maps.along + squared.y / maps.across);
    let y = frame.support * sqrt(squared.y / maps.along + squared.x / maps.across);
    let last = vec2f(frame.size) - 0.5;
    let sheet = vec4f(0.0, 1.0, 2.0, 3.0);
    let is_on_screen = (center_px.x + x >= vec4f(0.5)) & (center_px.x - x <= vec4f(last.x))
        & (center_px.y + y >= vec4f(0.5)) & (center_px.y - y <= vec4f(last.y))
        & (sheet >= vec4f(sheets.x)) & (sheet < vec4f(sheets.y));
    let counts = select(vec4u(0u), vec4u(1u), is_on_screen);
    return counts.x + counts.y + counts.z + counts.w;
}
