// The voxels that a subgroup draws in a sheet group: found once for all pixels of a patch, shaded once for each layer, and kept for as long as their kernels reach
// into the next sheet group. They are in workgroup memory, of which every subgroup has its own part.
//
// #import gather/bits
// #import gather/reach
// #import gather/state
// #import shared/brick

// The number of voxels in all parts; a multiple of 32.
override QUEUE: u32 = 96u;

// Each voxel's screen coordinates from `project` as bits, with its brick and slot in place of the depth from the eye; and its amount (C·m, m).
var<workgroup> queue_points: array<vec4u, QUEUE>;
var<workgroup> queue_amounts: array<vec4f, QUEUE>;
// The colours of voxels' own, if they count.
override QUEUE_COLORS: u32 = 1u;
var<workgroup> queue_colors: array<vec4f, QUEUE_COLORS>;
// A mask of the blocks to whose pixels the voxel is drawn; see also `WHOLE_SHIFT`. Where there are several layers, it has the voxel's from bit 16 on.
var<workgroup> queue_blocks: array<u32, QUEUE>;

// The number of voxels of the queue that are tested at a time, one bit each.
const BATCH = 64u;

// The start of the subgroup's part.
var<private> queue_first: u32;
var<private> queue_size: u32;
var<private> queue_count: u32;

fn empty_queue(thread: u32) {
    queue_size = QUEUE / (THREADS / lanes);
    queue_first = thread / lanes * queue_size;
    queue_count = 0u;
}

// The number of a ballot's lanes before this one.
fn before(lanes_in: u32) -> u32 {
    return countOneBits(lanes_in & ((1u << lane) - 1u));
}

// Appends the voxels of some lanes. Returns this lane's position.
fn enqueue(is_in: bool, voxel: u32, point: vec4f, blocks: u32) -> u32 {
    let lanes_in = ballot(is_in);
    let slot = queue_first + queue_count + before(lanes_in);
    if is_in {
        queue_points[slot] = vec4u(bitcast<vec3u>(point.xyz), voxel);
        queue_blocks[slot] = blocks;
    }
    queue_count += countOneBits(lanes_in);
    return slot;
}

// Whether there is an n-th voxel of the current layer that some of the given blocks see.
fn is_queued_for(blocks: u32, n: u32) -> bool {
    let word = queue_blocks[queue_first + min(n, queue_count - 1u)];
    return n < queue_count && (word & blocks) != 0u && is_of_layer(word);
}

// Whether a voxel is of the current layer, given its mask of blocks.
fn is_of_layer(blocks: u32) -> bool {
    return layers() == 1u || (blocks & layer_bit(current_layer())) != 0u;
}

// A mask of the voxels, among `BATCH` of the queue from `first` on, that any of the given blocks sees.
fn seen_in_batch(blocks: u32, first: u32) -> vec2u {
    let count = min(queue_count - first, BATCH);
    var seen = vec2u(0u);
    for (var i = 0u; i < count; i += 2u * lanes) {
        passes += 1u;
        seen |= bits_from(i, ballot(is_queued_for(blocks, first + i + lane)));
        seen |= bits_from(i + lanes, ballot(is_queued_for(blocks, first + i + lanes + lane)));
    }
    return seen;
}
