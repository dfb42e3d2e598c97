// Kernels as the tile rasteriser gathers them: in closed form, by polynomials instead of tables (eq. 3).

// A voxel's kernel as the pixels see it.
struct Footprint {
    center_px: vec2f,
    // `(C·m, m)` times the low-pass amplitude over λ; 0 without a voxel.
    amount: vec4f,
    // H(0, 0, t) of eq. 3 at the group's first plane and at the four after it.
    first_plane: f32,
    planes: vec4f,
    // In perspective, how its sections' footprints lie on the screen.
    axis: vec2f,
    maps: SectionMaps,
    // Among the economies: ρ² from which a footprint adds too little, by sheet.
    rim: vec4f,
}

// H(0, 0, t) of eq. 3: the kernel's integral along the ray through its centre, from the centre to t.
fn along(t: f32) -> f32 {
    let x = clamp(t, -frame.support, frame.support);
    let z = x * x * gather.along_scale - 1.0;
    return x * polynomial(gather.along, z);
}

fn polynomial(c: array<vec4f, 4>, z: f32) -> f32 {
    let powers = vec4f(1.0, z, z * z, z * z * z);
    let fourth = z * z * z * z;
    return dot(powers, c[0]) + fourth * (dot(powers, c[1]) + fourth * (dot(powers, c[2]) + fourth * dot(powers, c[3])));
}

// The sections of a kernel in the group's four sheets at a column's four pixels: two entries of eq. 3 subtracted, where
// H(a, b, t) is H(0, 0, t) times the Gaussian of ρ² = a² + b², and t ends at the chord of the kernel's ball.
fn sections(footprint: Footprint, column: f32, rows: vec4f) -> mat4x4f {
    let dx = column - footprint.center_px.x;
    let dy = rows - footprint.center_px.y;
    if PERSPECTIVE {
        let along = footprint.axis.x * dx + footprint.axis.y * dy;
        let across = footprint.axis.x * dy - footprint.axis.y * dx;
        let a = along * along;
        let b = across * across;
        let maps = footprint.maps;
        let planes = footprint.planes;
        return mat4x4f(
            section(a * maps.along.x + b * maps.across.x, footprint.first_plane, planes.x, footprint.rim.x) * maps.amplitude.x,
            section(a * maps.along.y + b * maps.across.y, planes.x, planes.y, footprint.rim.y) * maps.amplitude.y,
            section(a * maps.along.z + b * maps.across.z, planes.y, planes.z, footprint.rim.z) * maps.amplitude.z,
            section(a * maps.along.w + b * maps.across.w, planes.z, planes.w, footprint.rim.w) * maps.amplitude.w,
        );
    }
    let rho_squared = dy * (gather.metric.z * dy + gather.metric.y * dx) + gather.metric.x * dx * dx;
    let rim = rim_at(rho_squared);
    let in_plane = in_plane_at(rho_squared, footprint.rim.x);
    let plane_0 = clamp(vec4f(footprint.first_plane), -rim, rim);
    let plane_1 = clamp(vec4f(footprint.planes.x), -rim, rim);
    let plane_2 = clamp(vec4f(footprint.planes.y), -rim, rim);
    let plane_3 = clamp(vec4f(footprint.planes.z), -rim, rim);
    let plane_4 = clamp(vec4f(footprint.planes.w), -rim, rim);
    return mat4x4f(
        (plane_1 - plane_0) * in_plane,
        (plane_2 - plane_1) * in_plane,
        (plane_3 - plane_2) * in_plane,
        (plane_4 - plane_3) * in_plane,
    );
}

// One section, between two planes.
fn section(rho_squared: vec4f, near: f32, far: f32, footprint_rim: f32) -> vec4f {
    let rim = rim_at(rho_squared);
    let thickness = clamp(vec4f(far), -rim, rim) - clamp(vec4f(near), -rim, rim);
    return thickness * in_plane_at(rho_squared, footprint_rim);
}

// The Gaussian of ρ², up to the footprint's rim.
fn in_plane_at(rho_squared: vec4f, footprint_rim: f32) -> vec4f {
    let in_plane = exp2(rho_squared * gather.metric.w);
    if ECONOMIES {
        return select(vec4f(0.0), in_plane, rho_squared < vec4f(footprint_rim));
    }
    return in_plane;
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

// What another lane holds.
fn footprint_of(own: Footprint, other: u32) -> Footprint {
    var footprint: Footprint;
    footprint.center_px = subgroupShuffle(own.center_px, other);
    footprint.amount = subgroupShuffle(own.amount, other);
    footprint.first_plane = subgroupShuffle(own.first_plane, other);
    footprint.planes = subgroupShuffle(own.planes, other);
    if PERSPECTIVE {
        footprint.axis = subgroupShuffle(own.axis, other);
        footprint.maps.along = subgroupShuffle(own.maps.along, other);
        footprint.maps.across = subgroupShuffle(own.maps.across, other);
        footprint.maps.amplitude = subgroupShuffle(own.maps.amplitude, other);
    }
    if ECONOMIES {
        footprint.rim = subgroupShuffle(own.rim, other);
    }
    return footprint;
}

// What a voxel at p adds to the group whose first sheet starts at `near`, in sections or, into the sheet `whole` of them, as a whole.
fn footprint_at(p: vec4f, near: f32, whole: f32, amount: vec4f) -> Footprint {
    var footprint: Footprint;
    footprint.center_px = p.xy;
    var first_step = near - p.z;
    var steps = near - p.z + vec4f(1.0, 2.0, 3.0, 4.0) * frame.slab_width;
    if ECONOMIES && whole >= 0.0 {
        // As far as a kernel reaches, on either side of the sheet.
        first_step = -WHOLE;
        steps = select(vec4f(-WHOLE), vec4f(WHOLE), vec4f(1.0, 2.0, 3.0, 4.0) > vec4f(whole));
    }
    if PERSPECTIVE {
        let ray = local_ray(p.xy);
        let per_depth = select(frame.kernel_per_depth, ray.kernel_per_depth, frame.kernel_per_depth == 0.0);
        let cut = near_cut(ray, p.w);
        let first = max(first_step * per_depth, cut);
        let planes = max(steps * per_depth, vec4f(cut));
        footprint.amount = amount * ray.per_lambda;
        footprint.first_plane = along(first);
        footprint.planes = vec4f(along(planes.x), along(planes.y), along(planes.z), along(planes.w));
        footprint.axis = ray.axis;
        footprint.maps = section_maps(ray, p.w, vec4f(first, planes.xyz), planes);
    } else {
        let planes = steps * frame.kernel_per_depth;
        footprint.amount = amount * frame.amplitude;
        footprint.first_plane = along(first_step * frame.kernel_per_depth);
        footprint.planes = vec4f(along(planes.x), along(planes.y), along(planes.z), along(planes.w));
    }
    if ECONOMIES {
        let amplitude = select(vec4f(1.0), footprint.maps.amplitude, PERSPECTIVE);
        footprint.rim = log(footprint.amount.a * amplitude * gather.peak) / frame.falloff;
    }
    return footprint;
}

// Sheet depths beyond every kernel's reach.
const WHOLE = 1e6;
