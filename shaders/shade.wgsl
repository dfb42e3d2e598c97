// Projects and shades voxels, once each, in bucket order (§5.1: the last, view-dependent step of the list's preparation).
// SPEC §3 for classification and shading; gradients are those of the unwarped space (§4.2).

struct Voxel {
    index: u32,
    value: f32,
    normal: u32,
    gradient_magnitude: f32,
}

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> voxels: array<Voxel>;
// The buckets: indices into `voxels`, sorted by first slab.
@group(0) @binding(2) var<storage, read> order: array<u32>;
@group(0) @binding(3) var<storage, read_write> splats: array<Splat>;
// The control points of all ramps, one ramp after the other: value, then rgb or (ordinate, 0, 0).
@group(0) @binding(4) var<storage, read> control_points: array<vec4f>;

override WORKGROUP_SIZE: u32 = 256u;

// Piecewise linear between the control points first..end, clamped outside.
fn ramp(first: u32, end: u32, value: f32) -> vec3f {
    var upper = first;
    while upper < end && control_points[upper].x <= value {
        upper += 1u;
    }
    let a = control_points[max(upper, first + 1u) - 1u];
    let b = control_points[min(upper, end - 1u)];
    // Halves, as points may be more than the largest f32 apart.
    let t = select(0.0, (0.5 * value - 0.5 * a.x) / (0.5 * b.x - 0.5 * a.x), a.x < b.x);
    return mix(a.yzw, b.yzw, t);
}

// The amount per unit length, m of SPEC §5.
fn amount(alpha: f32) -> f32 {
    if frame.compositing != EXPONENTIAL {
        return alpha;
    }
    // 1 - α loses a small α's digits in f32; there the series of -ln(1-α) is exact.
    if alpha < 0.0625 {
        return alpha * (1.0 + alpha * (0.5 + alpha * (1.0 / 3.0 + alpha * (0.25 + alpha * 0.2))));
    }
    return -log(1.0 - min(alpha, 0.9999));
}

// Unfolds the octahedron.
fn decode_normal(encoded: u32) -> vec3f {
    let e = unpack2x16snorm(encoded);
    let z = 1.0 - abs(e.x) - abs(e.y);
    let folded = (1.0 - abs(e.yx)) * select(vec2f(-1.0), vec2f(1.0), e >= vec2f(0.0));
    return normalize(vec3f(select(folded, e, z >= 0.0), z));
}

fn shade(color: vec3f, voxel: Voxel) -> vec3f {
    if frame.light.w == 0.0 {
        return color;
    }
    let ambient = frame.shading.x;
    if voxel.gradient_magnitude == 0.0 {
        return clamp(color * ambient, vec3f(0.0), vec3f(1.0));
    }
    let n = decode_normal(voxel.normal);
    let diffuse = frame.shading.y * abs(dot(n, frame.light.xyz));
    let highlight = frame.shading.z * pow(min(abs(dot(n, frame.half_vector.xyz)), 1.0), frame.shading.w);
    return clamp(color * (ambient + diffuse) + highlight, vec3f(0.0), vec3f(1.0));
}

@compute @workgroup_size(WORKGROUP_SIZE)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let slot = id.x + id.y * groups.x * WORKGROUP_SIZE;
    if slot >= arrayLength(&order) {
        return;
    }
    let voxel = voxels[order[slot]];
    let row = frame.dims.x;
    let slice = row * frame.dims.y;
    let p = vec4f(
        f32(voxel.index % row),
        f32(voxel.index % slice / row),
        f32(voxel.index / slice),
        1.0,
    );
    let color = ramp(0u, frame.ramps.x, voxel.value);
    let opacity = ramp(frame.ramps.x, frame.ramps.y, voxel.value).x;
    let gradient_opacity = ramp(frame.ramps.y, frame.ramps.z, voxel.gradient_magnitude).x;
    let m = amount(opacity * gradient_opacity);
    let c = shade(color, voxel) * m;
    splats[slot] = Splat(
        dot(frame.screen_from_voxel[0], p),
        dot(frame.screen_from_voxel[1], p),
        dot(frame.screen_from_voxel[2], p),
        pack2x16float(c.rg),
        pack2x16float(vec2f(c.b, m)),
    );
}
