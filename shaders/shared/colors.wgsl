// Colours of voxels' own (SPEC §10). A stage that includes this includes `texels` and declares `colors`, a texture array that `gpu::volume_texture`
// folds, of the colours of all channels that have any.

// The number that stands for 1 in them; 0 if voxels have none of their own.
override FULL_COLOR: u32 = 0u;

// The colour and A of a voxel, given by its index, in one of these channels, counted from 1.
fn stored_color(place: u32, index: u32) -> vec4f {
    let texel = texel_of((place - 1u) * voxel_count() + index, textureDimensions(colors).x);
    return vec4f(textureLoad(colors, texel.xy, texel.z, 0)) / f32(FULL_COLOR);
}
