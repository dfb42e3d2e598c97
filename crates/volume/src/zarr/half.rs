//! Numbers of 16 bits.

/// The bytes of numbers of 32 bits with the values of numbers of 16 bits, in the machine's byte order.
pub(super) fn widen(bytes: &[u8]) -> Vec<u8> {
    bytes.as_chunks().0.iter().flat_map(|&half| value(u16::from_ne_bytes(half)).to_ne_bytes()).collect()
}

/// The value of a number by IEEE 754: a sign, an exponent of 5 bits and a fraction of 10.
fn value(bits: u16) -> f32 {
    let (exponent, fraction) = (bits >> 10 & 31, f32::from(bits & 0x3ff) / 1024.0);
    let size = match exponent {
        0 => fraction * 2.0_f32.powi(-14),
        31 if fraction > 0.0 => f32::NAN,
        31 => f32::INFINITY,
        _ => (1.0 + fraction) * 2.0_f32.powi(i32::from(exponent) - 15),
    };
    if bits >> 15 == 1 { -size } else { size }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_have_their_values() {
        for (bits, expected) in
            [(0x3c00, 1.0), (0xc000, -2.0), (0x3555, 0.333_251_95), (1, 5.960_464_5e-8), (0x7bff, 65504.0)]
        {
            assert_eq!(value(bits), expected, "{bits:#x}");
        }
        assert_eq!(value(0xfc00), f32::NEG_INFINITY);
        assert!(value(0x7c01).is_nan());
    }
}
