// The numbers that are splatted for voxels (SPEC §9).
// The stage declares `coefficients` and `planes`.
//
// #import shared/exact
// #import shared/frame
// #import shared/texels
// #import shared/volume

// A voxel's coefficient in the channel that is read, as a number.
fn number_at(index: u32) -> f32 {
    if EXACT {
        let texel = texel_of(first_value + index, textureDimensions(coefficients).x);
        return bitcast<f32>(textureLoad(coefficients, texel.xy, texel.z, 0).x);
    }
    let stored = stored_at(index);
    let value = select(bitcast<f32>(stored), f32(stored), frame.whole_values != 0u);
    return (value + planes.value_bias) * planes.value_scale;
}
