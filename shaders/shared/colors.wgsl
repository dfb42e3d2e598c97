// Colours of voxels' own in the first channel (SPEC §10). A stage that includes this includes `volume` and declares `colors`, a texture array that
// `gpu::volume_texture` folds.

// The number that stands for 1 in them; 0 if voxels have none of their own.
override FULL_COLOR: u32 = 0u;

// The colour and A of a voxel, given by its index; without one of its own a given colour and 1.
fn own_color(index: u32, given: vec3f) -> vec4f {
    if FULL_COLOR == 0u {
        return vec4f(given, 1.0);
    }
    let texel = texel_of(index, textureDimensions(colors).x);
    return vec4f(textureLoad(colors, texel.xy, texel.z, 0)) / f32(FULL_COLOR);
}
