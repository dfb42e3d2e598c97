// Classification and shading (SPEC §3).

// On the line between two control points.
fn between(a: vec4f, b: vec4f, value: f32) -> vec3f {
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

fn shade(color: vec3f, gradient: Gradient) -> vec3f {
    if frame.light.w == 0.0 {
        return color;
    }
    let ambient = frame.shading.x;
    if gradient.magnitude == 0.0 {
        return clamp(color * ambient, vec3f(0.0), vec3f(1.0));
    }
    let n = gradient.normal;
    let diffuse = frame.shading.y * abs(dot(n, frame.light.xyz));
    let highlight = frame.shading.z * pow(min(abs(dot(n, frame.half_vector.xyz)), 1.0), frame.shading.w);
    return clamp(color * (ambient + diffuse) + highlight, vec3f(0.0), vec3f(1.0));
}
