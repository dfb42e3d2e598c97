// Bit masks, and values that a subgroup's lanes hold together.
//
// #import gather/lanes
// #import gather/state

// A mask of the lanes in which a condition holds.
fn ballot(holds: bool) -> u32 {
    return together(vec2u(select(0u, 1u << lane, holds), 0u)).x;
}

// The first bits of a mask, moved to the bits from a multiple of the number of lanes on.
fn bits_from(first: u32, bits: u32) -> vec2u {
    let moved = bits << (first % 32u);
    return select(vec2u(0u, moved), vec2u(moved, 0u), first < 32u);
}

// The position of the n-th set bit.
fn nth_set_bit(bits: vec2u, n: u32) -> u32 {
    let low = countOneBits(bits.x);
    let in_upper = nth_in_word(bits.y, n - low);
    return select(32u + in_upper, nth_in_word(bits.x, n), n < low);
}

// The same within one word, by parallel sums of bits over groups of two, four and eight.
fn nth_in_word(word: u32, n: u32) -> u32 {
    let twos = word - ((word >> 1u) & 0x55555555u);
    let fours = (twos & 0x33333333u) + ((twos >> 2u) & 0x33333333u);
    // In every byte, the number of bits set up to its end.
    let ends = ((fours + (fours >> 4u)) & 0x0f0f0f0fu) * 0x01010101u;
    // The top bits of the bytes that end before the n-th set bit.
    let passed = (((n * 0x01010101u) | 0x80808080u) - ends) & 0x80808080u;
    var at = (((passed >> 7u) * 0x01010101u) >> 24u) * 8u;
    var left = n - (((ends << 8u) >> at) & 255u);
    var count = (fours >> at) & 15u;
    var is_passed = left >= count;
    at += select(0u, 4u, is_passed);
    left -= select(0u, count, is_passed);
    count = (twos >> at) & 3u;
    is_passed = left >= count;
    at += select(0u, 2u, is_passed);
    left -= select(0u, count, is_passed);
    return at + select(0u, 1u, left >= ((word >> at) & 1u));
}
