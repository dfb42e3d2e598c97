// The look of values and gradients on a pixel's ray (SPEC §9). A stage that includes this declares `LABELS`, and what `cells`, `planes`, `ramps` and
// `slab_integral` need.

// The ramps of the voxel whose cell holds the point of a pixel's ray at a sheet depth.
fn ramps_at(at: vec3f, sheet_depth: f32) -> vec4u {
    if !LABELS {
        return vec4u(0u, frame.ramps.xyz);
    }
    return ramps_of(index_of(nearest_voxel(voxel_at(at, sheet_depth))));
}

// The amount per unit length (without a logarithm: the opacity) and the colour.
struct Look {
    amount: f32,
    color: vec3f,
}

// The gradient between those of two samples.
fn gradient_between(near: vec4f, far: vec4f, share: f32) -> Gradient {
    return gradient_of(0.5 * planes.per_number * mix(near.yzw, far.yzw, share));
}

// The opacity of a gradient.
fn gradient_opacity(ramps: vec4u, gradient: Gradient) -> f32 {
    return ramp(ramps.z, ramps.w, gradient.magnitude).x;
}

// The shaded means over the values between two samples, each a number and its gradient, from the nearer to the farther one.
fn look(near: vec4f, far: vec4f, ramps: vec4u, light: Lighting) -> Look {
    let means = slab_integral(ramps.w, near.x, far.x);
    if means.amount <= 0.0 {
        return Look(0.0, vec3f(0.0));
    }
    let gradient = gradient_between(near, far, means.share);
    return Look(means.amount * gradient_opacity(ramps, gradient), shade(means.color, gradient, light));
}
