// The pixels of a thread of the tile rasterizer, in the compositing buffer and among first hits.
//
// #import gather/lanes
// #import gather/reach
// #import gather/region
// #import gather/state
// #import shared/frame

// A thread's four pixels.
struct Pixels {
    // The thread, and its block, in the patch.
    thread: u32,
    block: u32,
    first: vec2u,
    // The pixels' centres.
    column: f32,
    rows: vec4f,
    // The first pixel's index in the compositing buffer.
    slot: u32,
    is_inside: vec4<bool>,
}

// For a thread's four pixels: the sheet depths between which their rays count, and the depths of first hits, as bits.
var<private> shown_from: vec4f;
var<private> shown_to: vec4f;
var<private> hits: vec4u;

const PIXELS = vec4u(0u, 1u, 2u, 3u);

// A mask of the halves of blocks, four threads each, in which a subgroup has the threads of a round.
fn halves_of(thread: u32) -> u32 {
    return united(1u << (thread / 4u));
}

fn pixels_of(corner: vec2u, thread: u32) -> Pixels {
    let block = thread / 8u;
    let first = corner + vec2u((block & 1u) * 8u + thread % 8u, (block >> 1u) * 4u);
    let is_inside = vec4<bool>(first.x < frame.size.x) & (vec4u(first.y) + vec4u(0u, 1u, 2u, 3u) < vec4u(frame.size.y));
    let slot = (first.y - patch_range.first_row) * frame.size.x + first.x;
    return Pixels(thread, block, first, f32(first.x) + 0.5, f32(first.y) + vec4f(0.5, 1.5, 2.5, 3.5), slot, is_inside);
}

fn load_image(pixels: Pixels) -> mat4x4f {
    let row = frame.size.x;
    let last = arrayLength(&acc) - 1u;
    let slots = min(vec4u(pixels.slot) + vec4u(0u, row, 2u * row, 3u * row), vec4u(last));
    return mat4x4f(acc[slots.x], acc[slots.y], acc[slots.z], acc[slots.w]);
}

fn store_image(pixels: Pixels, image: mat4x4f) {
    let row = frame.size.x;
    if pixels.is_inside.x {
        acc[pixels.slot] = image[0];
    }
    if pixels.is_inside.y {
        acc[pixels.slot + row] = image[1];
    }
    if pixels.is_inside.z {
        acc[pixels.slot + 2u * row] = image[2];
    }
    if pixels.is_inside.w {
        acc[pixels.slot + 3u * row] = image[3];
    }
}

fn load_hits(pixels: Pixels) {
    let word = gather.hits + pixels.first.y * frame.size.x + pixels.first.x;
    let last = gather.hits + frame.size.x * frame.size.y - 1u;
    let words = min(vec4u(word) + vec4u(0u, 1u, 2u, 3u) * frame.size.x, vec4u(last));
    hits = vec4u(
        atomicLoad(&gathered.words[words.x]),
        atomicLoad(&gathered.words[words.y]),
        atomicLoad(&gathered.words[words.z]),
        atomicLoad(&gathered.words[words.w]),
    );
}

fn store_hits(pixels: Pixels) {
    let word = gather.hits + pixels.first.y * frame.size.x + pixels.first.x;
    for (var i = 0u; i < 4u; i += 1u) {
        if pixels.is_inside[i] {
            atomicStore(&gathered.words[word + i * frame.size.x], hits[i]);
        }
    }
}

// A mask of a thread's pixels that are not opaque. Pixels off the image count as opaque, and whatever lies behind a cut is hidden, as behind opaque
// voxels.
fn open_word(pixels: Pixels, opacity: vec4f, depth: f32) -> u32 {
    var is_open = pixels.is_inside & (opacity < vec4f(select(3e38, frame.opacity_threshold, frame.culling != 0u)));
    if cuts_rays() {
        is_open &= shown_from < shown_to;
        is_open &= vec4<bool>(frame.culling == 0u) | (min(shown_to, vec4f(cut.slabs.y)) > vec4f(depth));
    }
    return block_word(pixels.thread, is_open);
}
