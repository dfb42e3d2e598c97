//! Elementary functions of eight numbers at once, by IEEE `+ - × ÷ √` alone (SPEC §12).
//!
//! Nothing here is contracted to fused operations, and no system function is called, so that every instruction set gives the
//! same bits. Polynomials are Chebyshev interpolants, good to the last few bits of an `f32`.

use fearless_simd::prelude::*;
use fearless_simd::{f32x4, f32x8};

/// Numbers in a vector.
pub(super) const LANES: usize = 8;

/// The bits of a mantissa.
const MANTISSA: u32 = 23;

/// `(2^f - 1) / f` for `|f| ≤ 1/2`.
const EXP2: [f32; 6] =
    [std::f32::consts::LN_2, 0.240_226_5, 0.055_503_57, 0.009_618_082, 0.001_339_086_3, 0.000_154_531_63];

/// `atanh(s) / s` over s², for the s that mantissas from √½ to √2 lead to.
const ATANH: [f32; 5] = [1.0, 0.333_333_34, 0.200_001_92, 0.142_675_14, 0.118_084_05];

/// 0, 1, …, 7.
#[inline(always)]
pub(super) fn iota<S: Simd>(simd: S) -> f32x8<S> {
    f32x8::load_array(simd, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0])
}

/// Eight rows of four numbers, as four columns.
#[inline(always)]
pub(super) fn columns<S: Simd>(simd: S, rows: [&[f32; 4]; LANES]) -> [f32x8<S>; 4] {
    let row = |at: usize| f32x4::load_array_ref(simd, rows[at]);
    let [a, b, c, d] = transposed([row(0), row(1), row(2), row(3)]);
    let [e, f, g, h] = transposed([row(4), row(5), row(6), row(7)]);
    [a.combine(e), b.combine(f), c.combine(g), d.combine(h)]
}

/// Four rows of four numbers, as four columns.
#[inline(always)]
pub(super) fn transposed<S: Simd>([a, b, c, d]: [f32x4<S>; 4]) -> [f32x4<S>; 4] {
    let ([first, last], [second, third]) = ([a.zip_low(c), a.zip_high(c)], [b.zip_low(d), b.zip_high(d)]);
    [first.zip_low(second), first.zip_high(second), last.zip_low(third), last.zip_high(third)]
}

/// `2^x` as `2^n` and `2^f - 1`, with `x = n + f` and n whole, for x from -126 to 126.
#[inline(always)]
fn exp2_parts<S: Simd, V: SimdFloat<S, Element = f32>>(simd: S, x: V) -> (V, V) {
    // Adding 1.5·2²³ rounds to a whole number, which is then in the low bits.
    let magic = V::splat(simd, 12_582_912.0);
    let rounded = x + magic;
    let f = x - (rounded - magic);
    let squared = f * f;
    let low = f * EXP2[1] + EXP2[0];
    let middle = f * EXP2[3] + EXP2[2];
    let high = f * EXP2[5] + EXP2[4];
    let less_one = f * (low + squared * (middle + squared * high));
    (V::from_bits((rounded.to_bits() << MANTISSA) + (127 << MANTISSA)), less_one)
}

/// `2^x`, for x from -126 to 126.
#[inline(always)]
pub(super) fn exp2<S: Simd, V: SimdFloat<S, Element = f32>>(simd: S, x: V) -> V {
    let (power, less_one) = exp2_parts(simd, x);
    power + power * less_one
}

/// The least exponent of 2 for which powers are computed: their products with polynomials are normal numbers. Processors take many times as long for
/// smaller, subnormal numbers, and these would be rounded away beside a number of magnitude 1.
const LEAST_EXPONENT: f32 = -100.0;

/// `(1 - exp(-x)) / x`, 1 at 0, for x from 0 on; to full relative precision.
#[inline(always)]
pub(super) fn saturation<S: Simd>(simd: S, x: f32x8<S>) -> f32x8<S> {
    // The square of this is a normal number, too.
    let x = x.max(f32x8::splat(simd, 1e-15));
    let exponent = (x * -std::f32::consts::LOG2_E).max(f32x8::splat(simd, LEAST_EXPONENT));
    let (power, less_one) = exp2_parts(simd, exponent);
    ((1.0 - power) - power * less_one) / x
}

/// The exponent and `atanh((m - 1) / (m + 1))` of numbers above 0, whose mantissas m are from √½ to √2. `less_one` is the number less 1, more
/// exactly than the number tells it.
#[inline(always)]
fn log_parts<S: Simd, V: SimdFloat<S, Element = f32>>(simd: S, x: V, less_one: V) -> (V, V) {
    const ROOT_HALF: u32 = std::f32::consts::FRAC_1_SQRT_2.to_bits();
    // The bits of 2²³, in which a whole number's bits are the lowest ones.
    const WHOLE: u32 = 8_388_608_f32.to_bits();
    let splat = |bits| V::Bits::splat(simd, bits);
    // The bias makes exponents positive, so that an unsigned shift works.
    let moved = x.to_bits() - splat(ROOT_HALF) + splat(128 << MANTISSA);
    let exponent = V::from_bits((moved >> MANTISSA) + splat(WHOLE)) - (8_388_608.0 + 128.0);
    let mantissa = V::from_bits((moved & splat((1 << MANTISSA) - 1)) + splat(ROOT_HALF));
    let is_whole = exponent.simd_eq(V::splat(simd, 0.0));
    let above = is_whole.select(less_one, mantissa - 1.0);
    let s = above / (above + 2.0);
    let squared = s * s;
    let low = squared * ATANH[1] + ATANH[0];
    let high = squared * ATANH[3] + ATANH[2];
    let fourth = squared * squared;
    (exponent, s * (low + fourth * (high + fourth * ATANH[4])))
}

/// `-ln(1 - x)` for x from 0 to 0.9999, to full relative precision: the optical depth per unit length for an opacity per unit length.
#[inline(always)]
pub(super) fn optical_depth<S: Simd, V: SimdFloat<S, Element = f32>>(simd: S, x: V) -> V {
    let (exponent, atanh) = log_parts(simd, V::splat(simd, 1.0) - x, -x);
    exponent * -std::f32::consts::LN_2 - atanh * 2.0
}

/// `x^y` for x from 0 to about 1 and one y above 0; 0 at 0.
#[inline(always)]
pub(super) fn power<S: Simd>(simd: S, x: f32x8<S>, y: f32) -> f32x8<S> {
    let is_zero = x.simd_eq(f32x8::splat(simd, 0.0));
    let base = x.max(f32x8::splat(simd, 1e-37));
    let (exponent, atanh) = log_parts(simd, base, base - 1.0);
    let log2 = exponent + atanh * (2.0 * std::f32::consts::LOG2_E);
    let scaled = (log2 * y).max(f32x8::splat(simd, LEAST_EXPONENT)).min(f32x8::splat(simd, 126.0));
    is_zero.select(f32x8::splat(simd, 0.0), exp2(simd, scaled))
}

/// The polynomial of 4 of 16 coefficients, given z and z².
// No closure, which would not be compiled for the instruction set.
#[inline(always)]
fn cubic<S: Simd, V: SimdFloat<S, Element = f32>>(c: &[f32; 16], at: usize, [z, squared]: [V; 2]) -> V {
    (z * c[at + 1] + c[at]) + squared * (z * c[at + 3] + c[at + 2])
}

/// A polynomial of 16 coefficients, the constant one first.
#[inline(always)]
pub(super) fn polynomial<S: Simd, V: SimdFloat<S, Element = f32>>(c: &[f32; 16], z: V) -> V {
    let squared = z * z;
    let fourth = squared * squared;
    let (z, eighth) = ([z, squared], fourth * fourth);
    (cubic(c, 0, z) + fourth * cubic(c, 4, z)) + eighth * (cubic(c, 8, z) + fourth * cubic(c, 12, z))
}

/// The same without the last four coefficients.
#[inline(always)]
pub(super) fn short_polynomial<S: Simd, V: SimdFloat<S, Element = f32>>(c: &[f32; 16], z: V) -> V {
    let squared = z * z;
    let fourth = squared * squared;
    let (z, eighth) = ([z, squared], fourth * fourth);
    (cubic(c, 0, z) + fourth * cubic(c, 4, z)) + eighth * cubic(c, 8, z)
}

/// Lanes by bits.
#[inline(always)]
pub(super) fn mask<S: Simd>(simd: S, bits: u32) -> fearless_simd::mask32x8<S> {
    fearless_simd::mask32x8::from_bitmask(simd, bits.into())
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;
    use crate::cpu::simd::{chosen, dispatch};

    /// The largest relative error of a function against another over numbers from `low` to `high`.
    fn worst(low: f64, high: f64, ours: impl Fn([f32; LANES]) -> [f32; LANES], exact: impl Fn(f64) -> f64) -> f64 {
        let at = |step: usize| (low + (high - low) * step as f64 / 80_000.0) as f32;
        let errors = (0..=80_000 / LANES).flat_map(|batch| {
            let x: [f32; LANES] = std::array::from_fn(|lane| at((batch * LANES + lane).min(80_000)));
            let pairs: [_; LANES] = std::array::from_fn(|lane| (f64::from(ours(x)[lane]), exact(f64::from(x[lane]))));
            pairs.map(|(ours, exact)| ((ours - exact) / exact).abs())
        });
        // Unlike `max` this keeps NaN.
        errors.fold(0.0, |worst, error| if error <= worst { worst } else { error })
    }

    #[test]
    fn functions_are_good_to_the_last_bits() {
        let (_, level) = chosen().unwrap();
        let of = |x: [f32; LANES]| dispatch!(level, simd => exp2(simd, f32x8::load_array(simd, x)).to_array());
        assert!(worst(-126.0, 10.0, of, |x| x.exp2()) < 3e-7);
        let of = |x: [f32; LANES]| dispatch!(level, simd => saturation(simd, f32x8::load_array(simd, x)).to_array());
        for (low, high) in [(1e-30, 1e-20), (1e-9, 1e-3), (1e-3, 3.0), (1.0, 1000.0)] {
            assert!(worst(low, high, of, |x| -(-x).exp_m1() / x) < 3e-7, "{low} {high}");
        }
        assert_eq!(of([0.0; LANES]), [1.0; LANES]);
        let of = |x: [f32; LANES]| dispatch!(level, simd => optical_depth(simd, f32x8::load_array(simd, x)).to_array());
        for (low, high) in [(1e-30, 1e-20), (1e-9, 1e-3), (1e-3, 0.4), (0.2, 0.9999)] {
            assert!(worst(low, high, of, |x| -(-x).ln_1p()) < 4e-7, "{low} {high}");
        }
        for exponent in [0.01, 1.0, 20.0, 150.0] {
            let of = |x: [f32; LANES]| dispatch!(level, simd => power(simd, f32x8::load_array(simd, x), exponent).to_array());
            let exact = |x: f64| x.powf(f64::from(exponent));
            assert!(worst(0.8, 1.0, of, exact) < 1e-6 * f64::from(exponent).max(1.0), "{exponent}");
            assert_eq!(of([0.0; LANES]), [0.0; LANES]);
        }
    }
}
