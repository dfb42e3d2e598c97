// Masks of a patch's pixels (§6): a word for each of its four blocks, with eight bits for each of the block's rows. Blocks are numbered row by
// row.
//
// #import gather/lanes
// #import gather/state
// #import shared/frame

// The width of a patch in pixels.
const PATCH_WIDTH = 16u;

// The height of a patch in pixels.
const PATCH_HEIGHT = 8u;

// The part of its block's word that a thread's subgroup has, given its place in the patch and which of its own four pixels are in the mask.
fn block_word(thread: u32, is_in: vec4<bool>) -> u32 {
    let rows = vec4u(1u, 1u << 8u, 1u << 16u, 1u << 24u) << vec4u(thread % 8u);
    let bits = select(vec4u(0u), rows, is_in);
    var word = bits.x | bits.y | bits.z | bits.w;
    word |= of_opposite(word, 1u);
    word |= of_opposite(word, 2u);
    // A subgroup of four threads has half a block.
    return select(word, word | of_opposite(word, 4u), lanes >= 8u);
}

// The words with the pixels of a thread's subgroup replaced: of its block, or of half of that, and of the other blocks in its subgroup.
fn with_blocks(words: vec4u, thread: u32, word: u32) -> vec4u {
    var result = words;
    // The columns of each row that a subgroup has in a block.
    let own = select(0xffffffffu, 0x0f0f0f0fu << (thread & 4u), lanes < 8u);
    for (var i = 0u; i < lanes; i += 8u) {
        let is_here = vec4u(0u, 1u, 2u, 3u) == vec4u(of_lane(thread, i) / 8u);
        result = select(result, (words & vec4u(~own)) | vec4u(of_lane(word, i)), is_here);
    }
    return result;
}

// The blocks' bits.
const BLOCK_BITS = vec4u(1u, 2u, 4u, 8u);

// Bounds of a patch's pixels, relative to the first.
struct Bounds {
    low: vec2f,
    high: vec2f,
}

fn bounds_of(words: vec4u) -> Bounds {
    let columns = columns_of(words.x | words.z) | (columns_of(words.y | words.w) << 8u);
    let upper = words.x | words.y;
    let lower = words.z | words.w;
    let first_row = select(firstTrailingBit(upper) / 8u, 4u + firstTrailingBit(lower) / 8u, upper == 0u);
    let last_row = select(4u + firstLeadingBit(lower) / 8u, firstLeadingBit(upper) / 8u, lower == 0u);
    return Bounds(
        vec2f(f32(firstTrailingBit(columns)), f32(first_row)),
        vec2f(f32(firstLeadingBit(columns)), f32(last_row)),
    );
}

// A mask of the columns in which a block has a pixel.
fn columns_of(word: u32) -> u32 {
    let two = word | (word >> 16u);
    return (two | (two >> 8u)) & 255u;
}

// A mask of the blocks in which the box around a footprint contains a pixel of the mask. Its centre is relative to the patch's first pixel.
fn blocks_in_box(words: vec4u, center: vec2f, half_box: vec2f) -> u32 {
    let rows = run(vec4f(center.y), half_box.y, f32(PATCH_HEIGHT)).x;
    // A bit in the byte of every row that the box reaches.
    let bytes = (((vec2u(rows) >> vec2u(0u, 4u)) & vec2u(15u)) * 0x204081u) & vec2u(0x01010101u);
    let columns = run(vec4f(center.x), half_box.x, f32(PATCH_WIDTH)).x;
    let halves = vec2u(columns & 255u, columns >> 8u);
    return blocks_with(words, vec4u(bytes.x * halves, bytes.y * halves));
}

// The same for the intersection of the box and the parallelogram of Fig. 13, whose sides follow the shear of eq. 9, and whose corners reach out of
// the box.
fn blocks_in_parallelogram(words: vec4u, center: vec2f, half_box: vec2f, half_width: f32) -> u32 {
    let rows = run(vec4f(center.y), half_box.y, f32(PATCH_HEIGHT)).x;
    let columns = run(vec4f(center.x), half_box.x, f32(PATCH_WIDTH)).x;
    let box = row_of_blocks(rows, columns, 0u, center, half_width) | (row_of_blocks(rows, columns, 1u, center, half_width) << vec4u(8u))
        | (row_of_blocks(rows, columns, 2u, center, half_width) << vec4u(16u))
        | (row_of_blocks(rows, columns, 3u, center, half_width) << vec4u(24u));
    return blocks_with(words, box);
}

// The box around a footprint on the screen, relative to the patch's first pixel.
struct ScreenBox {
    center: vec2f,
    half: vec2f,
}

// A mask of the blocks in which the box around a footprint, scaled by `part`, contains a pixel of the mask.
fn blocks_seen(words: vec4u, box: ScreenBox, part: f32) -> u32 {
    let half = box.half * part + BOX_SLACK;
    if PARALLELOGRAM {
        return blocks_in_parallelogram(words, box.center, half, gather.half_width * part + BOX_SLACK);
    }
    return blocks_in_box(words, box.center, half);
}

// The pixels of the parallelogram in one row of every block, within some rows and columns.
fn row_of_blocks(rows: u32, columns: u32, row: u32, center: vec2f, half_width: f32) -> vec4u {
    let row_of = vec4u(row, row, row + 4u, row + 4u);
    let across = run(center.x + gather.shear * (vec4f(row_of) - center.y), half_width, f32(PATCH_WIDTH)) & vec4u(columns);
    let is_reached = ((vec4u(rows) >> row_of) & vec4u(1u)) != vec4u(0u);
    return select(vec4u(0u), (across >> vec4u(0u, 8u, 0u, 8u)) & vec4u(255u), is_reached);
}

// A mask of the blocks in which two sets of pixels intersect.
fn blocks_with(words: vec4u, others: vec4u) -> u32 {
    let blocks = select(vec4u(0u), BLOCK_BITS, (words & others) != vec4u(0u));
    return blocks.x | blocks.y | blocks.z | blocks.w;
}

// A mask of the pixels of a row or column within a distance of a point.
fn run(center: vec4f, distance: f32, count: f32) -> vec4u {
    let first = vec4u(clamp(ceil(center - distance), vec4f(0.0), vec4f(count)));
    let end = vec4u(clamp(floor(center + distance) + 1.0, vec4f(0.0), vec4f(count)));
    return select(vec4u(0u), (vec4u(1u) << end) - (vec4u(1u) << first), end > first);
}
