// The places of voxels in texture arrays that `gpu::volume_texture` folds. Where an array holds numbers of several channels, one channel follows the
// other. Of a volume that is read while it is drawn an array has only some pages, cubes of voxels, in slots (`headless::boxed::page_pool`). Then voxels are counted
// page by page, and the texture `pages` has the slot of every page of every channel.
// The stage declares `pages`.
//
// #import shared/frame

// The bits of a voxel's place in its page along each axis; 0 where the array has all voxels.
override PAGE_BITS: u32 = 0u;

// The column, row and layer of a voxel's texel in layers whose side is a power of two.
fn texel_of(index: u32, side: u32) -> vec3u {
    if PAGE_BITS == 0u {
        return folded(index, side);
    }
    let page = folded(index >> (3u * PAGE_BITS), textureDimensions(pages).x);
    let slot = textureLoad(pages, page.xy, page.z, 0).x;
    return folded((slot << (3u * PAGE_BITS)) | (index & ((1u << (3u * PAGE_BITS)) - 1u)), side);
}

fn folded(index: u32, side: u32) -> vec3u {
    let row = index >> firstTrailingBit(side);
    return vec3u(index & (side - 1u), row & (side - 1u), row >> firstTrailingBit(side));
}

// The index of a voxel in the volume: x fastest, in its page and among pages. Voxels that are not in pages are pages of one voxel.
fn index_of(voxel: vec3u) -> u32 {
    let page = voxel >> vec3u(PAGE_BITS);
    let across = pages_across();
    let at = voxel & vec3u((1u << PAGE_BITS) - 1u);
    let number = page.x + across.x * (page.y + across.y * page.z);
    return (number << (3u * PAGE_BITS)) | (at.z << (2u * PAGE_BITS)) | (at.y << PAGE_BITS) | at.x;
}

// The number of voxels in the volume, or in its pages.
fn voxel_count() -> u32 {
    let across = pages_across();
    return (across.x * across.y * across.z) << (3u * PAGE_BITS);
}

// The number of pages along each axis.
fn pages_across() -> vec3u {
    return (frame.dims.xyz + ((1u << PAGE_BITS) - 1u)) >> vec3u(PAGE_BITS);
}
