// The position of kernels on slab planes, and the scale of the numbers that stand for values (SPEC §9); `gpu::layout::FieldPlanes` documents the
// fields.
// The stage declares `planes`.
//
// #import shared/frame

struct FieldPlanes {
    axes: array<vec4f, 3>,
    step: vec4f,
    screen_axis: vec2f,
    per_pixel: vec2f,
    origin: f32,
    value_bias: f32,
    value_scale: f32,
    per_number: f32,
    min_moment: f32,
    channel: u32,
    colors: u32,
    padding_0: f32,
}

// Below this sum of weights there is no value.
const MIN_WEIGHT = 1e-3;

// The number of a point without a value; all other numbers are at most 4.
const NO_NUMBER = 1e30;
const NO_NUMBER_BITS = 0x7149f2cau;

// The position of a voxel's kernel on a plane.
struct OnPlane {
    // The pixel position of the plane's point that is nearest to the voxel.
    center_px: vec2f,
    // The length of a pixel along the planes' two axes in grid units, lowered to at most 1 by the low-pass rule.
    per_pixel: vec2f,
    // The plane's distance from the voxel in grid units, positive behind it.
    distance: f32,
}

// The depth from the eye of a plane; 1 without an eye.
fn plane_from_eye(plane: f32) -> f32 {
    return select(1.0, plane - planes.origin, frame.near > 0.0);
}

// A voxel is given by its pixel offset from the image's middle times its depth from the eye, and its sheet depth.
fn on_plane(offset: vec2f, depth: f32, plane: f32) -> OnPlane {
    let from_eye = plane_from_eye(plane);
    let distance = (plane - depth) * planes.step.w;
    let center = (offset + distance * planes.step.xy) / from_eye + 0.5 * vec2f(frame.size);
    return OnPlane(center, min(planes.per_pixel * from_eye, vec2f(1.0)), distance);
}

// The offset from a voxel to a pixel's point of the plane, in grid units along the planes' two axes. `from_center` is in pixels.
fn within_plane(lies: OnPlane, from_center: vec2f) -> vec2f {
    let axis = planes.screen_axis;
    return lies.per_pixel * vec2f(dot(axis, from_center), axis.x * from_center.y - axis.y * from_center.x);
}

// The vector in the grid that has these components along the planes' axes and normal.
fn in_grid(v: vec3f) -> vec3f {
    return v.x * planes.axes[0].xyz + v.y * planes.axes[1].xyz + v.z * planes.axes[2].xyz;
}
