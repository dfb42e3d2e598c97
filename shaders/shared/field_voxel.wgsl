// A voxel that is drawn onto slab planes; `gpu::layout::FieldVoxel` documents the fields.
struct FieldVoxel {
    x: f32,
    y: f32,
    depth: f32,
    number: f32,
    gradient_xy: u32,
    gradient_z: u32,
}

// 2 to a power from -126 to 127, from its bits: WGSL leaves the precision of `ldexp` and `exp2` to the driver.
fn power_of_2(exponent: i32) -> f32 {
    return bitcast<f32>(u32(exponent + 127) << 23u);
}

// Three numbers with a common exponent, each rounded to 15 bits of the largest.
fn packed(v: vec3f) -> vec2u {
    let largest = max(max(abs(v.x), abs(v.y)), abs(v.z));
    let exponent = clamp(i32((bitcast<u32>(largest) >> 23u) & 0xffu) - 126, -120, 120);
    let shares = v * power_of_2(-exponent);
    return vec2u(pack2x16snorm(shares.xy), (pack2x16snorm(vec2f(shares.z, 0.0)) & 0xffffu) | (u32(exponent + 256) << 16u));
}

fn unpacked(xy: u32, z: u32) -> vec3f {
    return vec3f(unpack2x16snorm(xy), unpack2x16snorm(z).x) * power_of_2(i32(z >> 16u) - 256);
}
