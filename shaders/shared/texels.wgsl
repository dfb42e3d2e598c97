// The places of voxels in texture arrays that `gpu::volume_texture` folds. Where an array holds numbers of several channels, one channel follows the
// other.

// The column, row and layer of a voxel's texel in layers whose side is a power of two.
fn texel_of(index: u32, side: u32) -> vec3u {
    let row = index >> firstTrailingBit(side);
    return vec3u(index & (side - 1u), row & (side - 1u), row >> firstTrailingBit(side));
}

// The index of a voxel in the volume, x fastest.
fn index_of(voxel: vec3u) -> u32 {
    return voxel.x + frame.dims.x * (voxel.y + frame.dims.y * voxel.z);
}

// The number of voxels in the volume.
fn voxel_count() -> u32 {
    return frame.dims.x * frame.dims.y * frame.dims.z;
}
