// Colours of voxels' own (SPEC §10). `colors` is a texture array that `gpu::volume_texture` folds, of the colours of all channels that have any.
// The stage declares `colors`.
//
// #import shared/texels

// The number that stands for 1 in them; 0 if voxels have none of their own.
override FULL_COLOR: u32 = 0u;

// What is stored for a voxel, given by its index, in one of these channels, counted from 1.
fn stored_texel(place: u32, index: u32) -> vec4u {
    let texel = texel_of((place - 1u) * voxel_count() + index, textureDimensions(colors).x);
    return textureLoad(colors, texel.xy, texel.z, 0);
}

// The colour and A of such a voxel.
fn stored_color(place: u32, index: u32) -> vec4f {
    return vec4f(stored_texel(place, index)) / f32(FULL_COLOR);
}
