// The economies of §8, which draw less where it is hardly visible: voxels that are projected whole instead of in sections, because of their
// low opacity or because they lie behind β, and footprints that end where they add too little. When off, every function here returns its
// input unchanged.
//
// #import gather/group
// #import gather/kernel
// #import gather/pixels
// #import gather/region
// #import gather/sheet_reach
// #import gather/state
// #import shared/frame

// In the queue's words of blocks, the bits from this one on hold one more than the sheet into which a voxel is projected whole.
const WHOLE_SHIFT = 8u;

// The mask `shallow` after a thread's pixels have reached some opacity.
fn shallow_after(words: vec4u, pixels: Pixels, opacity: vec4f) -> vec4u {
    if ECONOMIES {
        return with_blocks(words, pixels.thread, block_word(pixels.thread, pixels.is_inside & (opacity < vec4f(gather.beta))));
    }
    return words;
}

// The sheet of the group into which a voxel of the queue is projected whole; negative if it is drawn in sections.
fn whole_sheet(blocks: u32) -> f32 {
    if ECONOMIES {
        return f32(blocks >> WHOLE_SHIFT) - 1.0;
    }
    return -1.0;
}

// The blocks that a voxel of some amount and opacity is drawn to, of those that see it, combined with the sheet into which it is projected whole.
fn economic_blocks(blocks: u32, amount: vec4f, alpha: f32, p: vec4f, sheets: vec2f) -> u32 {
    if !ECONOMIES {
        return blocks;
    }
    let box = screen_box(p);
    let is_deep = blocks_seen(shallow, box, 1.0) == 0u;
    let is_whole = is_deep || alpha < gather.whole_below;
    var whole = -1.0;
    var is_here = true;
    if is_whole {
        let last_of_first = floor(max(sheets.x, 0.0) / f32(SHEETS)) * f32(SHEETS) + f32(SHEETS - 1u);
        let center_sheet = floor((p.z - gather.near) / frame.slab_width);
        let sheet = clamp(center_sheet, sheets.x, sheets.y - 1.0);
        whole = select(sheet, min(sheet, last_of_first), is_deep) - sheet_group.first_sheet;
        is_here = whole >= 0.0 && whole < f32(SHEETS);
    }
    let rims = footprint_at(p, sheet_group.near, whole, amount).rim;
    let rim = max(max(rims.x, rims.y), max(rims.z, rims.w));
    let part = sqrt(clamp(rim, 0.0, frame.support * frame.support)) / frame.support;
    let seen = select(0u, blocks_seen(open, box, part), is_here && rim > 0.0);
    return select(0u, seen | select(0u, (1u + u32(max(whole, 0.0))) << WHOLE_SHIFT, is_whole), seen != 0u);
}

// Whether a voxel with these blocks is drawn at all.
fn is_worthwhile(blocks: u32) -> bool {
    return !ECONOMIES || blocks != 0u;
}
