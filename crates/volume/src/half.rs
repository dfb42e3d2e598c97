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

/// The nearest number of 16 bits, of two the even one.
#[cfg(feature = "zarr")]
pub(super) fn of(value: f64) -> u16 {
    let exponent = ((value.to_bits() >> 52 & 0x7ff) as i32 - 1023).max(-14);
    let bits = match exponent {
        _ if value.is_nan() => 0x7e00,
        16.. => 0x7c00,
        // A fraction that is rounded up to 2 raises the exponent.
        _ => {
            let fraction = (value.abs() * 2.0_f64.powi(10 - exponent)).round_ties_even();
            ((exponent + 14) << 10) as u16 + fraction as u16
        }
    };
    if value.is_sign_negative() { bits | 1 << 15 } else { bits }
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

    #[cfg(feature = "zarr")]
    #[test]
    fn every_half_is_its_own_nearest() {
        for bits in (0..=u16::MAX).filter(|&bits| !value(bits).is_nan()) {
            assert_eq!(of(value(bits).into()), bits, "{bits:#x}");
        }
        assert_eq!(of(f64::NAN), 0x7e00);
        // Halfway between neighbours: to the even one.
        for (number, bits) in [
            (1.0 + 1.0 / 2048.0, 0x3c00),
            (1.0 + 3.0 / 2048.0, 0x3c02),
            (65519.9, 0x7bff),
            (65520.0, 0x7c00),
            (1e300, 0x7c00),
            (2.9e-8, 0),
            (-6e-8, 0x8001),
            (6.103e-5, 0x0400),
        ] {
            assert_eq!(of(number), bits, "{number}");
        }
    }
}
