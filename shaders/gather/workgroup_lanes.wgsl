// The same as `gather/subgroup_lanes.wgsl` for devices without subgroups: the lanes that draw a patch are a workgroup, and read one another's values from
// its memory.
//
// #import gather/barrier
// #import gather/state

// What lanes tell one another at once. Two places are used by turns, so that no lane writes to one before all have read it.
var<workgroup> told: array<vec2u, 2u * PATCH_THREADS>;

// The place that is used: the first lane's.
var<private> told_first: u32;

fn tell(own: vec2u) {
    told_first = PATCH_THREADS - told_first;
    told[told_first + lane] = own;
    meet();
}

fn of_lane(own: u32, other: u32) -> u32 {
    tell(vec2u(own, 0u));
    return told[told_first + other].x;
}

fn of_opposite(own: u32, bits: u32) -> u32 {
    return both_of_opposite(vec2u(own, 0u), bits).x;
}

fn both_of_opposite(own: vec2u, bits: u32) -> vec2u {
    tell(own);
    return told[told_first + (lane ^ bits)];
}

fn united(bits: u32) -> u32 {
    return together(vec2u(bits, 0u)).x;
}

// A workgroup has 8, 16 or 32 lanes. No loop, because a driver may count passes.
fn together(bits: vec2u) -> vec2u {
    tell(bits);
    var result = told_by_eight(0u);
    if THREADS > 8u {
        result |= told_by_eight(8u);
    }
    if THREADS > 16u {
        result |= told_by_eight(16u) | told_by_eight(24u);
    }
    return result;
}

fn told_by_eight(first: u32) -> vec2u {
    let at = told_first + first;
    return told[at] | told[at + 1u] | told[at + 2u] | told[at + 3u] | told[at + 4u] | told[at + 5u] | told[at + 6u] | told[at + 7u];
}

fn largest(own: u32) -> u32 {
    var result = max(own, of_opposite(own, 1u));
    result = max(result, of_opposite(result, 2u));
    result = max(result, of_opposite(result, 4u));
    if THREADS > 8u {
        result = max(result, of_opposite(result, 8u));
    }
    if THREADS > 16u {
        result = max(result, of_opposite(result, 16u));
    }
    return result;
}

fn sums_of_lanes(own: vec2u) -> vec2u {
    var result = own + both_of_opposite(own, 1u);
    result += both_of_opposite(result, 2u);
    result += both_of_opposite(result, 4u);
    if THREADS > 8u {
        result += both_of_opposite(result, 8u);
    }
    if THREADS > 16u {
        result += both_of_opposite(result, 16u);
    }
    return result;
}

fn control_point(ramp: Ramp, at: u32) -> vec4f {
    return control_points[ramp.first + at];
}

fn control_value(ramp: Ramp, at: u32) -> f32 {
    return control_points[min(ramp.first + at, ramp.end - 1u)].x;
}

// What lanes hold for one another, slot by slot.
override HELD: u32 = 128u;
var<workgroup> held_by_lanes: array<vec4f, HELD>;

fn begin_holding() {
    meet();
}

fn hold(slot: u32, own: vec4f) {
    held_by_lanes[slot * THREADS + lane] = own;
}

fn end_holding() {
    meet();
}

fn held(slot: u32, own: vec4f, other: u32) -> vec4f {
    return held_by_lanes[slot * THREADS + other];
}

fn held_pair(slot: u32, own: vec2f, other: u32) -> vec2f {
    return held_by_lanes[slot * THREADS + other].xy;
}

fn held_number(slot: u32, own: f32, other: u32) -> f32 {
    return held_by_lanes[slot * THREADS + other].x;
}
