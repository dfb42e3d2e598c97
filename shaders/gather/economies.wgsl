// The economies of §8, which draw less where it is hardly visible: voxels that are projected whole instead of in sections, because of their
// low opacity or because they lie behind β, and footprints that end where they add too little. When off, every function here returns its
// input unchanged.
//
// Needs gather/amounts.wgsl: Shaded, screen_box.
// Needs gather/kernel.wgsl: RIM_SLOT, footprint_at.
// Needs gather/patch.wgsl: PERSPECTIVE, SHEETS, gather, open, sheet_group.
// Needs gather/pixels.wgsl: Pixels.
// Needs gather/region.wgsl: block_word, with_blocks.
// Needs gather/subgroup_lanes.wgsl: held, hold.
// Needs gather/voxels.wgsl: blocks_seen.
// Needs gather/workgroup_lanes.wgsl: held, hold.
// Needs shared/frame.wgsl: frame.
// Needs shared/local_ray.wgsl: SectionMaps.

// Whether any economy is on.
override ECONOMIES: bool = false;

// Sheet depths beyond every kernel's reach.
const WHOLE = 1e6;

// In the queue's words of blocks, the bits from this one on hold one more than the sheet into which a voxel is projected whole.
const WHOLE_SHIFT = 8u;

// A mask of the subgroup's pixels, over all its rounds, that have not reached β.
var<private> shallow: vec4u;

// That mask after a thread's pixels have reached some opacity.
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

// The blocks that a voxel is drawn to, of those that see it, combined with the sheet into which it is projected whole.
fn economic_blocks(blocks: u32, shaded: Shaded, p: vec4f, sheets: vec2f) -> u32 {
    if !ECONOMIES {
        return blocks;
    }
    let box = screen_box(p);
    let is_deep = blocks_seen(shallow, box, 1.0) == 0u;
    let is_whole = is_deep || shaded.alpha < gather.whole_below;
    var whole = -1.0;
    var is_here = true;
    if is_whole {
        let last_of_first = floor(max(sheets.x, 0.0) / f32(SHEETS)) * f32(SHEETS) + f32(SHEETS - 1u);
        let center_sheet = floor((p.z - gather.near) / frame.slab_width);
        let sheet = clamp(center_sheet, sheets.x, sheets.y - 1.0);
        whole = select(sheet, min(sheet, last_of_first), is_deep) - sheet_group.first_sheet;
        is_here = whole >= 0.0 && whole < f32(SHEETS);
    }
    let rims = footprint_at(p, sheet_group.near, whole, shaded.amount).rim;
    let rim = max(max(rims.x, rims.y), max(rims.z, rims.w));
    let part = sqrt(clamp(rim, 0.0, frame.support * frame.support)) / frame.support;
    let seen = select(0u, blocks_seen(open, box, part), is_here && rim > 0.0);
    return select(0u, seen | select(0u, (1u + u32(max(whole, 0.0))) << WHOLE_SHIFT, is_whole), seen != 0u);
}

// Whether a voxel with these blocks is drawn at all.
fn is_worthwhile(blocks: u32) -> bool {
    return !ECONOMIES || blocks != 0u;
}

// The distances from a voxel to the planes of a group: the first plane, and the four after it.
struct KernelPlanes {
    first: f32,
    others: vec4f,
}

// Planes that put a whole kernel into the sheet `whole`, beyond the kernel's reach on either side of it.
fn economic_planes(planes: KernelPlanes, whole: f32) -> KernelPlanes {
    if ECONOMIES && whole >= 0.0 {
        return KernelPlanes(-WHOLE, select(vec4f(-WHOLE), vec4f(WHOLE), vec4f(1.0, 2.0, 3.0, 4.0) > vec4f(whole)));
    }
    return planes;
}

// The ρ² from which on a footprint adds too little, for each sheet.
fn economic_rim(amount: f32, maps: SectionMaps) -> vec4f {
    if ECONOMIES {
        let amplitude = select(vec4f(1.0), maps.amplitude, PERSPECTIVE);
        return log(amount * amplitude * gather.peak) / frame.falloff;
    }
    return vec4f(0.0);
}

// Holds this lane's rim for the others.
fn hold_rim(own: vec4f) {
    if ECONOMIES {
        hold(RIM_SLOT, own);
    }
}

// Another lane's rim.
fn rim_of(own: vec4f, other: u32) -> vec4f {
    if ECONOMIES {
        return held(RIM_SLOT, own, other);
    }
    return own;
}

// The Gaussian of ρ², up to the footprint's rim.
fn within_rim(in_plane: vec4f, rho_squared: vec4f, rim: f32) -> vec4f {
    if ECONOMIES {
        return select(vec4f(0.0), in_plane, rho_squared < vec4f(rim));
    }
    return in_plane;
}
