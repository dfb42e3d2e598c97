// The numbers that are splatted for voxels (SPEC §9). A stage that includes this declares `coefficients`, and what `volume` and `planes` need, and includes
// `exact`.

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
