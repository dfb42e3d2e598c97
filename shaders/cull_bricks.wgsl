// Finds the bricks that a sheet group visits (§6): those that reach into the group and are not entirely behind opaque pixels. One workgroup,
// so that the visits keep the order of the bricks: the same frame gives the same bytes.
//
// #import shared/brick
// #import shared/culled
// #import shared/frame
// #import shared/project
// #import shared/scan

@group(0) @binding(1) var<uniform> sheet_group: SheetGroup;
@group(0) @binding(2) var<storage, read> bricks: array<Brick>;
// Bricks by their first sheet group.
@group(0) @binding(3) var<storage, read> order: array<u32>;
@group(0) @binding(4) var<storage, read> states: array<BrickState>;
// The occlusion buffer: a bit is set where the box filter that starts at a pixel finds only opaque pixels.
@group(0) @binding(5) var<storage, read> occluded: array<u32>;
@group(0) @binding(6) var<storage, read_write> visits: array<Visit>;
@group(0) @binding(7) var<storage, read_write> args: Indirect;
@group(0) @binding(8) var<storage, read_write> culled: Culled;

// The number of sheets in a group.
override SHEETS: u32 = 4u;
// Whether a group is not sheets, but the plane at its near end (SPEC §9).
override PLANE: bool = false;

// Whether all pixels are opaque in the boxes of footprints with centres from low to high.
fn is_behind(low: vec2f, high: vec2f) -> bool {
    let last = vec2f(frame.size - 1u);
    let margin = sheet_group.half_box + BOX_SLACK;
    let first_pixel = vec2u(clamp(ceil(low - margin - 0.5), vec2f(0.0), last));
    let end = vec2u(clamp(floor(high + margin - 0.5) - vec2f(sheet_group.box_filter), vec2f(0.0), last));
    let last_pixel = max(first_pixel, end);
    let words = tile_grid(frame.size).x;
    for (var word = first_pixel.x / TILE; word <= last_pixel.x / TILE; word += 1u) {
        let from_bit = max(first_pixel.x, word * TILE) - word * TILE;
        let to_bit = min(last_pixel.x, word * TILE + TILE - 1u) - word * TILE;
        let needed = (0xffffffffu >> (31u - to_bit)) & (0xffffffffu << from_bit);
        for (var y = first_pixel.y; y <= last_pixel.y; y += 1u) {
            if (occluded[y * words + word] & needed) != needed {
                return false;
            }
        }
    }
    return true;
}

fn is_visited(at: u32) -> bool {
    let brick = bricks[at];
    if all((brick.present & ~states[at].hidden) == vec2u(0u)) {
        return false;
    }
    let half_extent = 0.5 * vec3f(vec3u(brick.extent & 3u, (brick.extent >> 2u) & 3u, (brick.extent >> 4u) & 3u));
    let center = vec4f(vec3f(vec3u(brick.x, brick.y, brick.z)) + half_extent, 1.0);
    let rows = frame.screen_from_voxel;
    let p = homogeneous(center);
    let spread = vec4f(
        dot(abs(rows[0].xyz), half_extent),
        dot(abs(rows[1].xyz), half_extent),
        dot(abs(rows[2].xyz), half_extent),
        dot(abs(rows[3].xyz), half_extent),
    );
    // Rounding must not lose a voxel that barely touches.
    let slack = 1e-3;
    let depth_reach = spread.z + frame.reach + slack;
    let far = sheet_group.near + select(f32(SHEETS) * frame.slab_width, 0.0, PLANE);
    if p.z + depth_reach <= sheet_group.near || p.z - depth_reach >= far {
        return false;
    }
    if PLANE && frame.near > 0.0 && p.w - spread.w <= CLOSE * frame.reach {
        return true;
    }
    let farthest = p.w + spread.w;
    if farthest <= frame.near {
        return false;
    }
    let nearest = max(p.w - spread.w, select(1.0, frame.near, frame.near > 0.0));
    let low_h = p.xy - spread.xy;
    let high_h = p.xy + spread.xy;
    let low = min(low_h / nearest, low_h / farthest) + 0.5 * vec2f(frame.size) - slack;
    let high = max(high_h / nearest, high_h / farthest) + 0.5 * vec2f(frame.size) + slack;
    if any(high + sheet_group.half_box < vec2f(0.5)) || any(low - sheet_group.half_box > vec2f(frame.size) - 0.5) {
        return false;
    }
    // Not the uniform alone, for the reason that `start` gives.
    return (sheet_group.culling | zero) == 0u || !is_behind(low, high);
}

@compute @workgroup_size(256)
fn main(@builtin(local_invocation_index) thread: u32, @builtin(workgroup_id) workgroup: vec3u) {
    start(workgroup.z);
    // Every thread tests a run of bricks, at most 32 at a time, so that the results fit a word.
    var total = 0u;
    // Plus a 0 as `start` needs it, which browsers know to be the same for all threads, as barriers follow.
    let count = sheet_group.brick_count + workgroup.z;
    for (var base = 0u; base < count; base += WORKGROUP_SIZE * 32u) {
        let rest = min(count - base, WORKGROUP_SIZE * 32u);
        let run = (rest + WORKGROUP_SIZE - 1u) / WORKGROUP_SIZE;
        let first = min(thread * run, rest);
        let end = min(first + run, rest);
        var visited = 0u;
        for (var i = first; i < end; i += 1u) {
            if is_visited(order[sheet_group.first_brick + base + i]) {
                visited |= 1u << (i - first);
            }
        }
        let own = countOneBits(visited);
        var slot = total + sum_up_to(thread, vec2u(own, 0u)).x - own;
        for (var i = first; i < end; i += 1u) {
            if (visited & (1u << (i - first))) != 0u {
                let at = order[sheet_group.first_brick + base + i];
                visits[slot] = Visit(vec2u(0u), vec2u(0u), at, 0u);
                slot += 1u;
            }
        }
        total += ends[WORKGROUP_SIZE - 1u].x;
        workgroupBarrier();
    }
    if thread == 0u {
        args = indirect(total);
        atomicAdd(&culled.tally.bricks_tested, sheet_group.brick_count);
        atomicAdd(&culled.tally.bricks_visited, total);
    }
}
