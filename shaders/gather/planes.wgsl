// The sums that a thread of the tile rasterizer gathers on the far planes of a group's four slabs, and the field that follows from them (SPEC §9).
//
// #import gather/group
// #import gather/lanes
// #import gather/pixels
// #import gather/plane_reach
// #import gather/state
// #import shared/frame
// #import shared/planes
// #import shared/seen

// Whether gradients are the field's derivative instead of the voxels' differences.
override KERNEL_GRADIENT: bool = false;

// The sums over the voxels around a plane at a thread's four pixels.
struct PlaneSums {
    // N = Σ g, and Σ c·g.
    weight: vec4f,
    number: vec4f,
    // Σ d·g with the voxels' differences d; for the kernel's gradient Σ c·g·δ along the planes' axes and their normal.
    x: vec4f,
    y: vec4f,
    z: vec4f,
    // For the kernel's gradient Σ g·δ.
    offset_x: vec4f,
    offset_y: vec4f,
    offset_z: vec4f,
    // For colours of voxels' own Σ colour·g.
    red: vec4f,
    green: vec4f,
    blue: vec4f,
    alpha: vec4f,
}

// The sums on the far planes of a group's four slabs.
struct Sheets {
    first: PlaneSums,
    second: PlaneSums,
    third: PlaneSums,
    fourth: PlaneSums,
}

// The number of a pixel's sums on a plane, 8 with the kernel's gradient, and 4 more with colours; and of the sums on all planes at all of a patch's
// threads.
override SUMS: u32 = 5u;
override SAVED: u32 = 640u;

// The sums of all of a patch's threads, while voxels of the group wait for room in the queue; then the samples on its planes (`gather/slabs.wgsl`).
var<workgroup> saved: array<vec4f, SAVED>;

fn save_sheets(thread: u32, sheets: Sheets) {
    save_plane(thread, 0u, sheets.first);
    save_plane(thread, 1u, sheets.second);
    save_plane(thread, 2u, sheets.third);
    save_plane(thread, 3u, sheets.fourth);
}

fn save_plane(thread: u32, plane: u32, sums: PlaneSums) {
    let first = plane * SUMS * PATCH_THREADS + thread;
    saved[first] = sums.weight;
    saved[first + PATCH_THREADS] = sums.number;
    saved[first + 2u * PATCH_THREADS] = sums.x;
    saved[first + 3u * PATCH_THREADS] = sums.y;
    saved[first + 4u * PATCH_THREADS] = sums.z;
    if KERNEL_GRADIENT {
        saved[first + 5u * PATCH_THREADS] = sums.offset_x;
        saved[first + 6u * PATCH_THREADS] = sums.offset_y;
        saved[first + 7u * PATCH_THREADS] = sums.offset_z;
    }
    if OWN_COLORS {
        let colors_first = first + (SUMS - 4u) * PATCH_THREADS;
        saved[colors_first] = sums.red;
        saved[colors_first + PATCH_THREADS] = sums.green;
        saved[colors_first + 2u * PATCH_THREADS] = sums.blue;
        saved[colors_first + 3u * PATCH_THREADS] = sums.alpha;
    }
}

fn saved_sheets(thread: u32) -> Sheets {
    return Sheets(saved_plane(thread, 0u), saved_plane(thread, 1u), saved_plane(thread, 2u), saved_plane(thread, 3u));
}

fn saved_plane(thread: u32, plane: u32) -> PlaneSums {
    let first = plane * SUMS * PATCH_THREADS + thread;
    var sums: PlaneSums;
    sums.weight = saved[first];
    sums.number = saved[first + PATCH_THREADS];
    sums.x = saved[first + 2u * PATCH_THREADS];
    sums.y = saved[first + 3u * PATCH_THREADS];
    sums.z = saved[first + 4u * PATCH_THREADS];
    if KERNEL_GRADIENT {
        sums.offset_x = saved[first + 5u * PATCH_THREADS];
        sums.offset_y = saved[first + 6u * PATCH_THREADS];
        sums.offset_z = saved[first + 7u * PATCH_THREADS];
    }
    if OWN_COLORS {
        let colors_first = first + (SUMS - 4u) * PATCH_THREADS;
        sums.red = saved[colors_first];
        sums.green = saved[colors_first + PATCH_THREADS];
        sums.blue = saved[colors_first + 2u * PATCH_THREADS];
        sums.alpha = saved[colors_first + 3u * PATCH_THREADS];
    }
    return sums;
}

// A voxel as the pixels see it on the four planes.
struct PlaneKernel {
    // The pixels of its nearest points; in orthographic views all are equal, and only the first is used.
    center_x: vec4f,
    center_y: vec4f,
    // The gradient and the number, (d, c).
    amount: vec4f,
    // The planes' distances in grid units; the Gaussian of these, 0 without a voxel; and for each plane the ρ² from which the kernel is 0.
    distances: vec4f,
    weights: vec4f,
    cuts: vec4f,
    // The colour and A of the voxel's own.
    color: vec4f,
}

// The group's four far planes.
fn far_planes() -> vec4f {
    return sheet_group.near + vec4f(1.0, 2.0, 3.0, 4.0) * frame.slab_width;
}

// The depths from the eye of the group's four far planes; 1 in orthographic views.
fn far_planes_from_eye() -> vec4f {
    return select(vec4f(1.0), far_planes() - planes.origin, vec4<bool>(PERSPECTIVE));
}

fn kernel_at(point: vec4f, amount: vec4f, is_there: bool) -> PlaneKernel {
    let distances = (far_planes() - point.z) * planes.step.w;
    let squared = distances * distances;
    let weights = select(vec4f(0.0), exp2(squared * gather.metric.w), vec4<bool>(is_there));
    let cuts = frame.support * frame.support - squared;
    let middle = 0.5 * vec2f(frame.size);
    if PERSPECTIVE {
        let per_depth = 1.0 / far_planes_from_eye();
        let x = (point.x + distances * planes.step.x) * per_depth + middle.x;
        let y = (point.y + distances * planes.step.y) * per_depth + middle.y;
        return PlaneKernel(x, y, amount, distances, weights, cuts, vec4f());
    }
    return PlaneKernel(vec4f(point.x + middle.x), vec4f(point.y + middle.y), amount, distances, weights, cuts, vec4f());
}

// The slots in which lanes hold their kernels.
const AMOUNT_SLOT = 0u;
const WEIGHTS_SLOT = 1u;
const CENTER_SLOT = 2u;
const CUTS_SLOT = 3u;
const CENTER_Y_SLOT = 4u;
const DISTANCES_SLOT = 5u;
const COLOR_SLOT = 6u;

// Holds this lane's kernel for the others.
fn hold_kernel(own: PlaneKernel) {
    begin_holding();
    hold(AMOUNT_SLOT, own.amount);
    hold(WEIGHTS_SLOT, own.weights);
    hold(CUTS_SLOT, own.cuts);
    if PERSPECTIVE {
        hold(CENTER_SLOT, own.center_x);
        hold(CENTER_Y_SLOT, own.center_y);
    } else {
        hold(CENTER_SLOT, vec4f(own.center_x.x, own.center_y.x, 0.0, 0.0));
    }
    if KERNEL_GRADIENT {
        hold(DISTANCES_SLOT, own.distances);
    }
    if OWN_COLORS {
        hold(COLOR_SLOT, own.color);
    }
    end_holding();
}

// The kernel of another lane.
fn kernel_of(own: PlaneKernel, other: u32) -> PlaneKernel {
    var kernel: PlaneKernel;
    kernel.amount = held(AMOUNT_SLOT, own.amount, other);
    kernel.weights = held(WEIGHTS_SLOT, own.weights, other);
    kernel.cuts = held(CUTS_SLOT, own.cuts, other);
    if PERSPECTIVE {
        kernel.center_x = held(CENTER_SLOT, own.center_x, other);
        kernel.center_y = held(CENTER_Y_SLOT, own.center_y, other);
    } else {
        let center = held_pair(CENTER_SLOT, vec2f(own.center_x.x, own.center_y.x), other);
        kernel.center_x = vec4f(center.x);
        kernel.center_y = vec4f(center.y);
    }
    if KERNEL_GRADIENT {
        kernel.distances = held(DISTANCES_SLOT, own.distances, other);
    }
    if OWN_COLORS {
        kernel.color = held(COLOR_SLOT, own.color, other);
    }
    return kernel;
}

// A voxel's kernel on a plane at four pixels: the offsets along the planes' axes, ρ², and its Gaussian.
struct InPlane {
    first: vec4f,
    second: vec4f,
    rho_squared: vec4f,
    gaussian: vec4f,
}

fn in_plane(kernel: PlaneKernel, pixels: Pixels, plane: u32) -> InPlane {
    let dx = pixels.column - kernel.center_x[plane];
    let dy = pixels.rows - kernel.center_y[plane];
    var at: InPlane;
    if PERSPECTIVE || KERNEL_GRADIENT {
        let from_eye = far_planes_from_eye()[plane];
        let per_pixel = min(planes.per_pixel * from_eye, vec2f(1.0));
        at.first = per_pixel.x * (planes.screen_axis.x * dx + planes.screen_axis.y * dy);
        at.second = per_pixel.y * (planes.screen_axis.x * dy - planes.screen_axis.y * dx);
        at.rho_squared = at.first * at.first + at.second * at.second;
    } else {
        at.rho_squared = dy * (gather.metric.z * dy + gather.metric.y * dx) + gather.metric.x * dx * dx;
    }
    at.gaussian = exp2(at.rho_squared * gather.metric.w);
    return at;
}

// The sums on a plane with a voxel added.
fn with_voxel(sums: PlaneSums, kernel: PlaneKernel, at: InPlane, plane: u32) -> PlaneSums {
    let weight = select(vec4f(0.0), at.gaussian * kernel.weights[plane], at.rho_squared < vec4f(kernel.cuts[plane]));
    let number = weight * kernel.amount.w;
    var result = sums;
    result.weight += weight;
    result.number += number;
    if KERNEL_GRADIENT {
        result.x += number * at.first;
        result.y += number * at.second;
        result.z += number * kernel.distances[plane];
        result.offset_x += weight * at.first;
        result.offset_y += weight * at.second;
        result.offset_z += weight * kernel.distances[plane];
    } else {
        result.x += weight * kernel.amount.x;
        result.y += weight * kernel.amount.y;
        result.z += weight * kernel.amount.z;
    }
    if OWN_COLORS {
        result.red += weight * kernel.color.x;
        result.green += weight * kernel.color.y;
        result.blue += weight * kernel.color.z;
        result.alpha += weight * kernel.color.w;
    }
    return result;
}

// The field on a plane at a thread's four pixels: numbers, and gradients in numbers per `unit`.
struct Fields {
    has_value: vec4<bool>,
    number: vec4f,
    x: vec4f,
    y: vec4f,
    z: vec4f,
}

fn fields_of(sums: PlaneSums) -> Fields {
    let has_value = sums.weight >= vec4f(MIN_WEIGHT);
    let per_weight = 1.0 / select(vec4f(1.0), sums.weight, has_value);
    let number = sums.number * per_weight;
    if !KERNEL_GRADIENT {
        return Fields(has_value, number, sums.x * per_weight, sums.y * per_weight, sums.z * per_weight);
    }
    let moments = mat3x4f(
        (sums.x - number * sums.offset_x) * per_weight,
        (sums.y - number * sums.offset_y) * per_weight,
        (sums.z - number * sums.offset_z) * per_weight,
    );
    let squared = moments[0] * moments[0] + moments[1] * moments[1] + moments[2] * moments[2];
    let is_noise = squared < vec4f(planes.min_moment * planes.min_moment);
    let scale = select(vec4f(-2.0 * frame.falloff), vec4f(0.0), is_noise);
    let along = mat3x4f(moments[0] * scale, moments[1] * scale, moments[2] * scale);
    // From the planes' axes to the grid's, and from grid units to lengths of the world.
    let x = vec3f(planes.axes[0].x, planes.axes[1].x, planes.axes[2].x) / frame.aspect.x;
    let y = vec3f(planes.axes[0].y, planes.axes[1].y, planes.axes[2].y) / frame.aspect.y;
    let z = vec3f(planes.axes[0].z, planes.axes[1].z, planes.axes[2].z) / frame.aspect.z;
    return Fields(has_value, number, along * x, along * y, along * z);
}

// The colours and A on a plane at a thread's four pixels: red, green, blue and A columns.
fn colors_of(sums: PlaneSums, has_value: vec4<bool>) -> mat4x4f {
    if !OWN_COLORS {
        return mat4x4f();
    }
    let per_weight = select(vec4f(0.0), 1.0 / select(vec4f(1.0), sums.weight, has_value), has_value);
    let none = vec4f(0.0);
    let one = vec4f(1.0);
    return mat4x4f(
        clamp(sums.red * per_weight, none, one),
        clamp(sums.green * per_weight, none, one),
        clamp(sums.blue * per_weight, none, one),
        clamp(sums.alpha * per_weight, none, one),
    );
}
