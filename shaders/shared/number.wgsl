// The numbers that are splatted for voxels (SPEC §9). A stage that includes this declares `coefficients`, and what `volume` and `planes` need.

// Whether coefficients differ from the values.
override EXACT: bool = false;

// A voxel's coefficient, as a number.
fn number_at(index: u32) -> f32 {
    if EXACT {
        let texel = texel_of(index, textureDimensions(coefficients).x);
        return bitcast<f32>(textureLoad(coefficients, texel.xy, texel.z, 0).x);
    }
    let stored = stored_at(index);
    let value = select(bitcast<f32>(stored), f32(stored), frame.whole_values != 0u);
    return (value + planes.value_bias) * planes.value_scale;
}
