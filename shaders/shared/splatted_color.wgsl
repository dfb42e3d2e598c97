// What is splatted for voxels with colours of their own (SPEC §§9, 10). If `EXACT`, the texture array has the bits of coefficients.
//
// #import shared/colors
// #import shared/exact

// The colour and A of a voxel, given by its index, or their coefficients.
fn splatted_color(place: u32, index: u32) -> vec4f {
    if EXACT {
        return bitcast<vec4f>(stored_texel(place, index));
    }
    return stored_color(place, index);
}
