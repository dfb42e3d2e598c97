// The walk through a sheet group's bricks behind a patch, which finds the voxels whose kernels may reach the group and open pixels, one per lane at
// a time.
//
// #import gather/bits
// #import gather/group
// #import gather/lanes
// #import gather/reach
// #import gather/state
// #import shared/brick
// #import shared/frame
// #import shared/project

fn is_searched_for(search: SearchBounds, p: vec4f) -> bool {
    if PERSPECTIVE {
        return is_searched_in_perspective(search, p);
    }
    return all(p.xyz >= search.low) && all(p.xyz <= search.high);
}

// The state of the walk.
struct Walk {
    // The entries that have not been tested yet.
    next: u32,
    end: u32,
    // A mask of the layers whose bricks are visited.
    wanted: u32,
    // Bricks are tested one per lane: a mask of the lanes whose bricks must be visited.
    to_visit: u32,
    // The visited brick, a mask of its layers, its voxels that match the search, and the number of those that have been found.
    brick: u32,
    in_layers: u32,
    corner: vec3u,
    matching_voxels: vec2u,
    matching_count: u32,
    found_count: u32,
}

var<private> walk_state: Walk;

fn walk(first: u32, end: u32, wanted: u32) {
    walk_state.wanted = wanted;
    walk_state.next = first;
    walk_state.end = end;
    walk_state.to_visit = 0u;
    walk_state.matching_count = 0u;
    walk_state.found_count = 0u;
}

fn is_walked() -> bool {
    return walk_state.next >= walk_state.end && walk_state.to_visit == 0u && walk_state.found_count == walk_state.matching_count;
}

// The first voxel of a brick.
fn corner_of(record: Brick) -> vec3u {
    return vec3u(record.x, record.y, record.z) & vec3u(~3u);
}

// Tests one brick per lane.
fn test_bricks(search: SearchBounds) {
    passes += 1u;
    let record = bricks[bins[min(walk_state.next + lane, walk_state.end - 1u)]];
    var may_hold = walk_state.next + lane < walk_state.end;
    may_hold &= layers() == 1u || (layers_of(record) & walk_state.wanted) != 0u;
    if !PERSPECTIVE {
        let middle = homogeneous(vec4f(vec3f(corner_of(record)) + 1.5, 1.0)).xyz;
        let rows = frame.screen_from_voxel;
        // A little more than half the brick, because its voxels are tested more exactly.
        let half = 1.501 * vec3f(dot(abs(rows[0].xyz), vec3f(1.0)), dot(abs(rows[1].xyz), vec3f(1.0)), dot(abs(rows[2].xyz), vec3f(1.0)));
        may_hold &= all(middle + half >= search.low) && all(middle - half <= search.high);
    }
    walk_state.to_visit = ballot(may_hold);
    walk_state.next += lanes;
}

// Goes to the next brick that must be visited.
fn visit_brick(search: SearchBounds) {
    let next = firstTrailingBit(walk_state.to_visit);
    walk_state.to_visit &= walk_state.to_visit - 1u;
    walk_state.brick = bins[walk_state.next - lanes + next];
    let record = bricks[walk_state.brick];
    walk_state.corner = corner_of(record);
    walk_state.in_layers = layers_of(record);
    bricks_visited += 1u;

    // Every lane tests a run of the brick's slots, two at a time.
    let run = BRICK_VOXELS / lanes;
    let first = homogeneous(vec4f(vec3f(walk_state.corner + in_brick(lane * run)), 1.0));
    let across = homogeneous(vec4f(1.0, 0.0, 0.0, 0.0));
    let down = homogeneous(vec4f(0.0, 1.0, 0.0, 0.0));
    var reaching = 0u;
    for (var i = 0u; i < run; i += 2u) {
        let p = first + f32(i % 4u) * across + f32(i / 4u) * down;
        reaching |= select(0u, 1u, is_searched_for(search, p)) << i;
        reaching |= select(0u, 2u, is_searched_for(search, p + across)) << i;
    }
    passes += run / 2u + 3u;
    let shift = lane * run;
    let shifted = reaching << (shift % 32u);
    walk_state.matching_voxels = record.present & together(select(vec2u(0u, shifted), vec2u(shifted, 0u), shift < 32u));
    let ones = countOneBits(walk_state.matching_voxels);
    walk_state.matching_count = ones.x + ones.y;
    walk_state.found_count = 0u;
}

// A lane's voxel.
struct Found {
    // Brick and slot, as in the queue.
    voxel: u32,
    at: vec3u,
    // As `layers_of` tells them.
    in_layers: u32,
}

// Finds a voxel for each lane, as long as there are any. Returns their number.
fn next_voxels(search: SearchBounds, found: ptr<function, Found>) -> u32 {
    var count = 0u;
    while count < lanes {
        while walk_state.found_count == walk_state.matching_count && (walk_state.to_visit != 0u || walk_state.next < walk_state.end) {
            while walk_state.to_visit == 0u && walk_state.next < walk_state.end {
                test_bricks(search);
            }
            if walk_state.to_visit == 0u {
                break;
            }
            visit_brick(search);
        }
        if walk_state.found_count == walk_state.matching_count {
            break;
        }
        passes += 4u;
        let nth = lane - count;
        let place = nth_set_bit(walk_state.matching_voxels, (nth + walk_state.found_count) % BRICK_VOXELS);
        if lane >= count && nth < walk_state.matching_count - walk_state.found_count {
            *found = Found(walk_state.brick * BRICK_VOXELS + place, walk_state.corner + in_brick(place), walk_state.in_layers);
        }
        let taken = min(walk_state.matching_count - walk_state.found_count, lanes - count);
        count += taken;
        walk_state.found_count += taken;
    }
    return count;
}
