//! Numbers of 16 bits.

use std::num::ParseFloatError;
use std::str::FromStr;

/// A number of 16 bits by IEEE 754: a sign, an exponent of 5 bits and a fraction of 10.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Half(u16);

impl Half {
    pub(super) const MAX: Self = Self(0x7bff);

    /// The `f32` that equals it.
    pub(super) fn value(self) -> f32 {
        value(self.0)
    }

    pub(super) fn from_le_bytes(bytes: [u8; 2]) -> Self {
        Self(u16::from_le_bytes(bytes))
    }

    #[cfg(feature = "dicom")]
    pub(super) fn from_ne_bytes(bytes: [u8; 2]) -> Self {
        Self(u16::from_ne_bytes(bytes))
    }

    pub(super) fn to_ne_bytes(self) -> [u8; 2] {
        self.0.to_ne_bytes()
    }
}

/// The nearest number.
impl FromStr for Half {
    type Err = ParseFloatError;

    fn from_str(text: &str) -> Result<Self, ParseFloatError> {
        text.parse().map(|number| Self(of(number)))
    }
}

/// The value of a number's bits.
fn value(bits: u16) -> f32 {
    // The factor between the values that the exponents of `f32` and of 16 bits have with the same bits.
    const FACTOR: f32 = (1_u128 << 112) as f32;
    let size = u32::from(bits & 0x7fff);
    let value = match size >> 10 {
        31 => f32::from_bits(0x7f80_0000 | size << 13),
        _ => f32::from_bits(size << 13) * FACTOR,
    };
    if bits >> 15 == 1 { -value } else { value }
}

/// The nearest number of 16 bits, of two the even one.
fn of(value: f64) -> u16 {
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
