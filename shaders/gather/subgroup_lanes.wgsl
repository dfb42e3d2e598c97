// The lanes that draw a patch: a subgroup, as the other files call them. They read one another's registers. `gather/workgroup_lanes.wgsl` has the same
// functions for devices without subgroups.
//
// #import gather/state

// Another lane's number. As in all of these functions, all lanes take part.
fn of_lane(own: u32, other: u32) -> u32 {
    return subgroupShuffle(own, other);
}

// The same of the lane whose place differs from this one's in some bits.
fn of_opposite(own: u32, bits: u32) -> u32 {
    return subgroupShuffleXor(own, bits);
}

// The union of all lanes' bits.
fn united(bits: u32) -> u32 {
    return subgroupOr(bits);
}

// The same of twice as many, in fewer steps than a software driver's `subgroupOr`, which asks one lane after the other.
fn together(bits: vec2u) -> vec2u {
    if THREADS > 8u {
        return subgroupOr(bits);
    }
    var result = bits;
    result |= subgroupShuffleXor(result, 1u);
    result |= subgroupShuffleXor(result, 2u);
    return select(result, result | subgroupShuffleXor(result, 4u), vec2<bool>(lanes == 8u));
}

// The largest of all lanes' numbers.
fn largest(own: u32) -> u32 {
    return subgroupMax(own);
}

// The sums of all lanes' numbers.
fn sums_of_lanes(own: vec2u) -> vec2u {
    return subgroupAdd(own);
}

// A control point of those that lanes hold.
fn control_point(ramp: Ramp, at: u32) -> vec4f {
    return subgroupShuffle(ramp.own, at);
}

fn control_value(ramp: Ramp, at: u32) -> f32 {
    return subgroupShuffle(ramp.own.x, at);
}

// Lanes hold numbers in slots for one another between `begin_holding` and the next one. Here their registers do.
fn begin_holding() {}

fn hold(slot: u32, own: vec4f) {}

fn end_holding() {}

// What another lane holds, given what this one does.
fn held(slot: u32, own: vec4f, other: u32) -> vec4f {
    return subgroupShuffle(own, other);
}

// The first two numbers, and the first one.
fn held_pair(slot: u32, own: vec2f, other: u32) -> vec2f {
    return subgroupShuffle(own, other);
}

fn held_number(slot: u32, own: f32, other: u32) -> f32 {
    return subgroupShuffle(own, other);
}
