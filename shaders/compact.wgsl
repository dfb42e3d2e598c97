// Lists the voxels that a sheet group draws, and those of them that are drawn for the first time, without gaps and in the order of the visits.
// One workgroup, in which every thread writes a run of visits.
//
// #import shared/brick
// #import shared/culled
// #import shared/scan

@group(0) @binding(0) var<storage, read> visits: array<Visit>;
@group(0) @binding(1) var<storage, read> visit_args: Indirect;
@group(0) @binding(2) var<storage, read_write> instances: array<u32>;
@group(0) @binding(3) var<storage, read_write> draw_args: Indirect;
@group(0) @binding(4) var<storage, read_write> fresh: array<u32>;
@group(0) @binding(5) var<storage, read_write> fresh_args: Indirect;
@group(0) @binding(6) var<storage, read_write> culled: Culled;

fn count_bits(bits: vec2u) -> u32 {
    let count = countOneBits(bits);
    return count.x + count.y;
}

@compute @workgroup_size(256)
fn main(@builtin(local_invocation_index) thread: u32) {
    let count = visit_args.count;
    let run = (count + WORKGROUP_SIZE - 1u) / WORKGROUP_SIZE;
    let first = min(thread * run, count);
    let end = min(first + run, count);
    var own = vec2u(0u);
    for (var i = first; i < end; i += 1u) {
        own += vec2u(count_bits(visits[i].drawn), count_bits(visits[i].fresh));
    }
    // The numbers of drawn and fresh voxels before the thread's run.
    var slot = sum_up_to(thread, own) - own;
    for (var i = first; i < end; i += 1u) {
        for (var word = 0u; word < 2u; word += 1u) {
            var drawn = visits[i].drawn[word];
            let new_ones = visits[i].fresh[word];
            while drawn != 0u {
                let bit = firstTrailingBit(drawn);
                let id = visits[i].brick * BRICK_VOXELS + word * 32u + bit;
                instances[slot.x] = id;
                slot.x += 1u;
                if (new_ones & (1u << bit)) != 0u {
                    fresh[slot.y] = id;
                    slot.y += 1u;
                }
                drawn &= drawn - 1u;
            }
        }
    }
    if thread == 0u {
        let total = ends[WORKGROUP_SIZE - 1u];
        draw_args = indirect(total.x);
        fresh_args = indirect_workgroups(total.y, SHADE_WORKGROUP);
        atomicAdd(&culled.tally.quads, total.x);
    }
}
