// Ramps whose first control points are distributed among the lanes of a subgroup.
//
// #import gather/lanes
// #import gather/state
// #import shared/frame
// #import shared/shading

var<private> color_ramp: Ramp;
var<private> opacity_ramp: Ramp;
var<private> gradient_opacity_ramp: Ramp;

// Distributes the ramps' control points among the lanes.
fn hold_ramps() {
    color_ramp = ramp_of(0u, frame.ramps.x);
    opacity_ramp = ramp_of(frame.ramps.x, frame.ramps.y);
    gradient_opacity_ramp = ramp_of(frame.ramps.y, frame.ramps.z);
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
