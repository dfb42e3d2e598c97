// Bits of masks.

// Where the n-th set bit is.
fn nth_set_bit(bits: vec2u, n: u32) -> u32 {
    let low = countOneBits(bits.x);
    var found = vec3u(bits.x, n, 0u);
    if n >= low {
        found = vec3u(bits.y, n - low, 32u);
    }
    return half(half(half(half(half(found, 16u), 8u), 4u), 2u), 1u).z;
}

// One step of a binary search in (word, bits to skip, position): goes on in the upper bits if the lower ones have too few.
fn half(found: vec3u, width: u32) -> vec3u {
    let count = countOneBits(found.x & ((1u << width) - 1u));
    return select(found, vec3u(found.x >> width, found.y - count, found.z + width), found.y >= count);
}
