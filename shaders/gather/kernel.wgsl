// Kernels in the tile rasterizer's closed form: polynomials instead of tables (eq. 3).
//
// #import gather/economic_kernel
// #import gather/lanes
// #import gather/state
// #import shared/frame
// #import shared/local_ray

// A voxel's kernel in the sheets of a group.
struct Footprint {
    center_px: vec2f,
    // `(C·m, m)` times the low-pass amplitude, divided by λ; 0 without a voxel.
    amount: vec4f,
    // H(0, 0, t) of eq. 3 at the group's first plane and at the four after it.
    first_plane: f32,
    planes: vec4f,
    // In perspective, the maps from its sections' footprints to the screen.
    axis: vec2f,
    maps: SectionMaps,
    // See `economic_rim`.
    rim: vec4f,
}

// H(0, 0, t) of eq. 3: the kernel's integral along the ray through its centre, from the centre to t.
fn along(t: f32) -> f32 {
    let x = clamp(t, -frame.support, frame.support);
    let z = x * x * gather.along_scale - 1.0;
    return x * polynomial(gather.along, z);
}

fn polynomial(c: array<vec4f, 4>, z: f32) -> f32 {
    let squared = z * z;
    let fourth = squared * squared;
    let low = cubic(c[0], z, squared) + fourth * cubic(c[1], z, squared);
    let high = cubic(c[2], z, squared) + fourth * cubic(c[3], z, squared);
    return low + fourth * fourth * high;
}

fn cubic(c: vec4f, z: f32, squared: f32) -> f32 {
    return c.x + z * c.y + squared * (c.z + z * c.w);
}

// The positions of a column's four pixels in a footprint.
struct Offsets {
    dx: f32,
    dy: vec4f,
}

fn offsets_in(footprint: Footprint, column: f32, rows: vec4f) -> Offsets {
    return Offsets(column - footprint.center_px.x, rows - footprint.center_px.y);
}

// A kernel in a sheet at four pixels: H(a, b, t) of eq. 3 is H(0, 0, t) times the Gaussian of ρ² = a² + b², and t ends where the chord of the
// kernel's ball does.
struct Chords {
    // H(0, 0, t) at the chord's end, as bits: the bits of numbers that are not negative compare like the numbers.
    rim: vec4i,
    in_plane: vec4f,
}

fn chords(footprint: Footprint, at: Offsets, sheet: u32) -> Chords {
    if PERSPECTIVE {
        let along = footprint.axis.x * at.dx + footprint.axis.y * at.dy;
        let across = footprint.axis.x * at.dy - footprint.axis.y * at.dx;
        let maps = footprint.maps;
        let rho_squared = along * along * maps.along[sheet] + across * across * maps.across[sheet];
        let in_plane = in_plane_at(rho_squared, footprint.rim[sheet]) * maps.amplitude[sheet];
        return Chords(bitcast<vec4i>(rim_at(rho_squared)), in_plane);
    }
    let rho_squared = at.dy * (gather.metric.z * at.dy + gather.metric.y * at.dx) + gather.metric.x * at.dx * at.dx;
    return Chords(bitcast<vec4i>(rim_at(rho_squared)), in_plane_at(rho_squared, footprint.rim.x));
}

// A section between two planes: the difference of two entries of eq. 3.
fn section(near: f32, far: f32, chords: Chords) -> vec4f {
    return (cut_by_rim(far, chords.rim) - cut_by_rim(near, chords.rim)) * chords.in_plane;
}

// H(0, 0, t) at a plane, or at the rim on its side. Integer `min` costs a driver half of float `min`, which must handle NaN.
fn cut_by_rim(plane: f32, rim: vec4i) -> vec4f {
    let bits = bitcast<i32>(plane);
    let sign = bits & i32(0x80000000u);
    return bitcast<vec4f>(min(vec4i(bits ^ sign), rim) | vec4i(sign));
}

// The Gaussian of ρ², up to the footprint's rim.
fn in_plane_at(rho_squared: vec4f, footprint_rim: f32) -> vec4f {
    return within_rim(exp2(rho_squared * gather.metric.w), rho_squared, footprint_rim);
}

// H(0, 0, t) where the chord of the kernel's ball ends.
fn rim_at(rho_squared: vec4f) -> vec4f {
    let chord_squared = max(frame.support * frame.support - rho_squared, vec4f(0.0));
    let z = chord_squared * gather.chord_scale.x + gather.chord_scale.y;
    let c = gather.chord;
    let low = c[0].x + z * (c[0].y + z * (c[0].z + z * c[0].w));
    let high = c[1].x + z * (c[1].y + z * (c[1].z + z * c[1].w));
    let z_squared = z * z;
    return sqrt(chord_squared) * (low + z_squared * z_squared * high);
}

// The slots in which lanes hold their footprints.
const AMOUNT_SLOT = 0u;
const PLANES_SLOT = 1u;
const CENTER_SLOT = 2u;
const FIRST_SLOT = 3u;
const AXIS_SLOT = 4u;
const ALONG_SLOT = 5u;
const ACROSS_SLOT = 6u;
const AMPLITUDE_SLOT = 7u;

// Holds this lane's footprint for the others.
fn hold_footprint(own: Footprint) {
    begin_holding();
    hold(AMOUNT_SLOT, own.amount);
    hold(PLANES_SLOT, own.planes);
    hold(CENTER_SLOT, vec4f(own.center_px, 0.0, 0.0));
    hold(FIRST_SLOT, vec4f(own.first_plane));
    if PERSPECTIVE {
        hold(AXIS_SLOT, vec4f(own.axis, 0.0, 0.0));
        hold(ALONG_SLOT, own.maps.along);
        hold(ACROSS_SLOT, own.maps.across);
        hold(AMPLITUDE_SLOT, own.maps.amplitude);
    }
    hold_rim(own.rim);
    end_holding();
}

// Another lane's footprint.
fn footprint_of(own: Footprint, other: u32) -> Footprint {
    var footprint: Footprint;
    footprint.center_px = held_pair(CENTER_SLOT, own.center_px, other);
    footprint.amount = held(AMOUNT_SLOT, own.amount, other);
    footprint.first_plane = held_number(FIRST_SLOT, own.first_plane, other);
    footprint.planes = held(PLANES_SLOT, own.planes, other);
    if PERSPECTIVE {
        footprint.axis = held_pair(AXIS_SLOT, own.axis, other);
        footprint.maps.along = held(ALONG_SLOT, own.maps.along, other);
        footprint.maps.across = held(ACROSS_SLOT, own.maps.across, other);
        footprint.maps.amplitude = held(AMPLITUDE_SLOT, own.maps.amplitude, other);
    }
    footprint.rim = rim_of(own.rim, other);
    return footprint;
}

// The footprint of a voxel at p in the group whose first sheet starts at `near`, in sections or, into the sheet `whole`, as a whole.
fn footprint_at(p: vec4f, near: f32, whole: f32, amount: vec4f) -> Footprint {
    var footprint: Footprint;
    footprint.center_px = p.xy;
    let sections = KernelPlanes(near - p.z, near - p.z + vec4f(1.0, 2.0, 3.0, 4.0) * frame.slab_width);
    let steps = economic_planes(sections, whole);
    if PERSPECTIVE {
        let ray = local_ray(p.xy);
        let per_depth = select(frame.kernel_per_depth, ray.kernel_per_depth, frame.kernel_per_depth == 0.0);
        let cut = near_cut(ray, p.w);
        let first = max(steps.first * per_depth, cut);
        let planes = max(steps.others * per_depth, vec4f(cut));
        footprint.amount = amount * ray.per_lambda;
        footprint.first_plane = along(first);
        footprint.planes = vec4f(along(planes.x), along(planes.y), along(planes.z), along(planes.w));
        footprint.axis = ray.axis;
        footprint.maps = section_maps(ray, p.w, vec4f(first, planes.xyz), planes);
    } else {
        let planes = steps.others * frame.kernel_per_depth;
        footprint.amount = amount * frame.amplitude;
        footprint.first_plane = along(steps.first * frame.kernel_per_depth);
        footprint.planes = vec4f(along(planes.x), along(planes.y), along(planes.z), along(planes.w));
    }
    footprint.rim = economic_rim(footprint.amount.a, footprint.maps);
    return footprint;
}
