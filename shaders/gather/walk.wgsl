// The walk through a sheet group's bricks behind a tile: their voxels whose kernels may reach the group and open pixels, as many at a
// time as there are lanes.
//
// Needs gather.wgsl: PERSPECTIVE, bricks, bricks_visited, entries, lane, lanes, passes.
// Needs gather/bits.wgsl: ballot, nth_set_bit, together.
// Needs shared/brick.wgsl: BRICK_VOXELS, in_brick.
// Needs shared/frame.wgsl: frame.
// Needs shared/project.wgsl: homogeneous.

// What voxels are looked for: homogeneous pixel coordinates seen from the image's middle, and sheet depths.
struct Sought {
    low: vec3f,
    high: vec3f,
}

fn is_sought(sought: Sought, p: vec4f) -> bool {
    if PERSPECTIVE {
        let is_on_screen = all(p.xy >= sought.low.xy * p.w) && all(p.xy <= sought.high.xy * p.w);
        return is_on_screen && p.z >= sought.low.z && p.z <= sought.high.z && p.w > frame.near;
    }
    return all(p.xyz >= sought.low) && all(p.xyz <= sought.high);
}

// Entries are fetched one per lane: the brick's number, corner and voxels.
var<private> walk_next: u32;
var<private> walk_end: u32;
var<private> to_visit: u32;
var<private> fetched: u32;
var<private> fetched_corner: vec3u;
var<private> fetched_present: vec2u;

// The brick that is visited, what of its voxels is sought, and how many of those have been found.
var<private> brick: u32;
var<private> corner: vec3u;
var<private> sought_voxels: vec2u;
var<private> sought_count: u32;
var<private> found_count: u32;

fn walk(first: u32, end: u32) {
    walk_next = first;
    walk_end = end;
    to_visit = 0u;
    sought_count = 0u;
    found_count = 0u;
}

fn is_walked() -> bool {
    return walk_next >= walk_end && to_visit == 0u && found_count == sought_count;
}

// Fetches as many bricks as there are lanes.
fn fetch_bricks(sought: Sought) {
    passes += 1u;
    fetched = entries[min(walk_next + lane, walk_end - 1u)];
    let record = bricks[fetched];
    fetched_corner = vec3u(record.x, record.y, record.z) & vec3u(~3u);
    fetched_present = record.present;
    var may_hold = walk_next + lane < walk_end;
    if !PERSPECTIVE {
        let middle = homogeneous(vec4f(vec3f(fetched_corner) + 1.5, 1.0)).xyz;
        let rows = frame.screen_from_voxel;
        // A little more than half the brick: its voxels are looked at with more care.
        let half = 1.501 * vec3f(dot(abs(rows[0].xyz), vec3f(1.0)), dot(abs(rows[1].xyz), vec3f(1.0)), dot(abs(rows[2].xyz), vec3f(1.0)));
        may_hold &= all(middle + half >= sought.low) && all(middle - half <= sought.high);
    }
    to_visit = ballot(may_hold);
    walk_next += lanes;
}

// Goes on to the next brick that was fetched.
fn visit_brick(sought: Sought) {
    let next = firstTrailingBit(to_visit);
    to_visit &= to_visit - 1u;
    brick = subgroupShuffle(fetched, next);
    corner = subgroupShuffle(fetched_corner, next);
    let present = subgroupShuffle(fetched_present, next);
    bricks_visited += 1u;

    // Every lane tests a run of the brick's places, two at a time.
    let run = BRICK_VOXELS / lanes;
    let first = homogeneous(vec4f(vec3f(corner + in_brick(lane * run)), 1.0));
    let across = homogeneous(vec4f(1.0, 0.0, 0.0, 0.0));
    let down = homogeneous(vec4f(0.0, 1.0, 0.0, 0.0));
    var reaching = 0u;
    for (var i = 0u; i < run; i += 2u) {
        let p = first + f32(i % 4u) * across + f32(i / 4u) * down;
        reaching |= select(0u, 1u, is_sought(sought, p)) << i;
        reaching |= select(0u, 2u, is_sought(sought, p + across)) << i;
    }
    passes += run / 2u + 3u;
    let shift = lane * run;
    let shifted = reaching << (shift % 32u);
    sought_voxels = present & together(select(vec2u(0u, shifted), vec2u(shifted, 0u), shift < 32u));
    let ones = countOneBits(sought_voxels);
    sought_count = ones.x + ones.y;
    found_count = 0u;
}

// A lane's voxel.
struct Found {
    // Brick and place, as in the queue.
    voxel: u32,
    at: vec3u,
}

// Finds voxels for as many lanes as there are voxels left. Returns for how many.
fn next_voxels(sought: Sought, found: ptr<function, Found>) -> u32 {
    var count = 0u;
    while count < lanes {
        while found_count == sought_count && (to_visit != 0u || walk_next < walk_end) {
            while to_visit == 0u && walk_next < walk_end {
                fetch_bricks(sought);
            }
            if to_visit == 0u {
                break;
            }
            visit_brick(sought);
        }
        if found_count == sought_count {
            break;
        }
        passes += 4u;
        let nth = lane - count;
        let place = nth_set_bit(sought_voxels, (nth + found_count) % BRICK_VOXELS);
        if lane >= count && nth < sought_count - found_count {
            *found = Found(brick * BRICK_VOXELS + place, corner + in_brick(place));
        }
        let taken = min(sought_count - found_count, lanes - count);
        count += taken;
        found_count += taken;
    }
    return count;
}
