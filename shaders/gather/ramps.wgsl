// Ramps whose first control points are distributed among the lanes of a subgroup.
//
// Needs gather/patch.wgsl: THREADS, control_points, lane, lanes.
// Needs gather/subgroup_lanes.wgsl: control_point, control_value.
// Needs gather/workgroup_lanes.wgsl: control_point, control_value.
// Needs shared/shading.wgsl: between.

// A ramp: the range of its control points, and this lane's share of the first of them.
struct Ramp {
    first: u32,
    end: u32,
    own: vec4f,
}

// Piecewise linear between the control points, at most one per lane, and clamped outside.
fn ramp_at(held: Ramp, value: f32) -> vec3f {
    let count = held.end - held.first;
    // The number of points at or below the value.
    var below = 0u;
    if THREADS >= 32u {
        let is_past = is_below(held, below + 15u, value);
        below += select(0u, 16u, lanes >= 32u && is_past);
    }
    if THREADS >= 16u {
        let is_past = is_below(held, below + 7u, value);
        below += select(0u, 8u, lanes >= 16u && is_past);
    }
    below += select(0u, 4u, is_below(held, below + 3u, value));
    below += select(0u, 2u, is_below(held, below + 1u, value));
    below += select(0u, 1u, is_below(held, below, value));
    below += select(0u, 1u, is_below(held, below, value));
    let a = control_point(held, max(below, 1u) - 1u);
    let b = control_point(held, min(below, min(count, lanes) - 1u));
    return between(a, b, value);
}

// Whether there are more control points than lanes.
fn is_long(held: Ramp) -> bool {
    return held.end - held.first > lanes;
}

// Whether one of the first control points is at or below a value. All lanes read another's point, also those that search behind the last one: a GPU gives
// nothing defined from lanes that do not take part.
fn is_below(held: Ramp, at: u32, value: f32) -> bool {
    let point = control_value(held, at % lanes);
    return at < min(held.end - held.first, lanes) && point <= value;
}

fn ramp_of(first: u32, end: u32) -> Ramp {
    return Ramp(first, end, control_points[min(first + lane, end - 1u)]);
}
