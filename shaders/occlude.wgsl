// The occlusion buffer (§6): the opacity buffer convolved separably with a box of the footprint's size. The paper averages opacities clamped to
// the threshold and compares with it; testing whether all pixels of a box are opaque is the same decision without rounding, on bits. In
// perspective every group has its own box, and boxes shrink towards the back: the result of a larger box in front stays valid for a smaller
// one in tiles that are not computed again. One workgroup per tile, one thread per row of 32 pixels.
//
// #import shared/brick
// #import shared/frame
// #import shared/tile_list

@group(0) @binding(1) var<uniform> sheet_group: SheetGroup;
@group(0) @binding(2) var<storage, read> occluding: TileList;
@group(0) @binding(3) var<storage, read> source: array<u32>;
@group(0) @binding(4) var<storage, read_write> result: array<u32>;

struct Word {
    x: u32,
    y: u32,
    inside: bool,
}

fn word_of(workgroup: vec3u, thread: u32) -> Word {
    let at = unfold(workgroup);
    if at >= occluding.args.count {
        return Word(0u, 0u, false);
    }
    let tile = occluding.tiles[at];
    let words = tile_grid(frame.size).x;
    let y = tile / words * TILE + thread;
    return Word(tile % words, y, y < frame.size.y);
}

// Convolves along the columns, downwards from every pixel; rows off the image count as opaque.
@compute @workgroup_size(32)
fn columns(@builtin(local_invocation_index) thread: u32, @builtin(workgroup_id) workgroup: vec3u) {
    start(workgroup.z);
    let word = word_of(workgroup, thread);
    if !word.inside {
        return;
    }
    let words = tile_grid(frame.size).x;
    var all = 0xffffffffu;
    let last = min(word.y + sheet_group.box_filter.y, frame.size.y - 1u);
    for (var y = word.y; y <= last; y += 1u) {
        all &= source[y * words + word.x];
    }
    result[word.y * words + word.x] = all;
}

// A row's word; all opaque off the image.
fn row_word(y: u32, x: u32) -> u32 {
    let words = tile_grid(frame.size).x;
    if x >= words {
        return 0xffffffffu;
    }
    return source[y * words + x];
}

// Convolves along the rows, to the right from every pixel.
@compute @workgroup_size(32)
fn rows(@builtin(local_invocation_index) thread: u32, @builtin(workgroup_id) workgroup: vec3u) {
    start(workgroup.z);
    let word = word_of(workgroup, thread);
    if !word.inside {
        return;
    }
    var all = row_word(word.y, word.x);
    // Not the uniform alone, for the reason that `start` gives.
    let steps = sheet_group.box_filter.x + zero;
    for (var step = 1u; step <= steps; step += 1u) {
        let x = word.x + step / 32u;
        let part = step % 32u;
        var from_right = row_word(word.y, x) >> part;
        if part != 0u {
            from_right |= row_word(word.y, x + 1u) << (32u - part);
        }
        all &= from_right;
    }
    result[word.y * tile_grid(frame.size).x + word.x] = all;
}
