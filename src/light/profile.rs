//! Kernel sections by tables (SPEC §4): `S = g(ρ²)·(K(t1) - K(t0))` with `g = exp(-falloff·ρ²)`, `K(t) = ∫κ·exp(-falloff·s²) ds` from 0 to t, and both ends
//! clamped to half the chord c that the kernel's ball cuts from the ray. K grows with t, so that clamping K does the same as clamping t; and `K(c)/c` is smooth
//! where the chord ends.

use crate::kernel::Kernel;

/// The intervals of a table.
const INTERVALS: usize = 1024;

/// 1.5·2²³: added to a number of magnitude up to 2²², it rounds to a whole one, which is then in the low bits.
const MAGIC: f32 = 12_582_912.0;

/// The low bits of a rounded number.
const LOW: u32 = (1 << 22) - 1;

/// A kernel's tables.
#[derive(Clone, Debug)]
pub(super) struct Profile {
    /// By ρ²: g, its slope, `K(c)/c`, and its slope; slopes are per interval.
    rim: Vec<[f32; 4]>,
    /// By t from 0: K and its slope.
    along: Vec<[f32; 2]>,
    /// Intervals per grid unit² of ρ².
    per_square: f32,
    /// Intervals per grid unit of t.
    per_length: f32,
    /// The kernel's radius, squared.
    square: f32,
    /// The ρ² from which on a section is too small for `f32`.
    pub(super) reach: f32,
}

impl Profile {
    pub(super) fn new(kernel: &Kernel) -> Self {
        let reach = kernel.support() * kernel.support();
        let gauss = |square: f64| libm::exp(-kernel.falloff() * square);
        let whole = |length: f64| kernel.cumulative(0.0, length);
        let chord = |square: f64| match kernel.half_chord(square) {
            0.0 => kernel.value(0.0),
            half => whole(half) / half,
        };
        // Values at the middles of intervals' halves to both sides, so that the nearest entry and its slope give a number.
        let sampled = |of: &dyn Fn(f64) -> f64, end: f64, at: usize| {
            let place = |at: f64| (end * at / INTERVALS as f64).clamp(0.0, end);
            let at = at as f64;
            let (before, after) = (place(at - 0.5), place(at + 0.5));
            let step = end / INTERVALS as f64;
            [of(place(at)), (of(after) - of(before)) * step / (after - before)].map(|number| number as f32)
        };
        let rim = |at| {
            let ([g, slope], [end, end_slope]) = (sampled(&gauss, reach, at), sampled(&chord, reach, at));
            [g, slope, end, end_slope]
        };
        Self {
            rim: (0..=INTERVALS).map(rim).collect(),
            along: (0..=INTERVALS).map(|at| sampled(&whole, kernel.radius(), at)).collect(),
            per_square: (INTERVALS as f64 / reach) as f32,
            per_length: (INTERVALS as f64 / kernel.radius()) as f32,
            square: (kernel.radius() * kernel.radius()) as f32,
            reach: reach as f32,
        }
    }

    /// g and K at the end of the chord, for ρ² from 0 to [`Self::reach`].
    #[inline(always)]
    pub(super) fn rim(&self, square: f32) -> [f32; 2] {
        let (at, rest) = parts(square * self.per_square);
        let [g, slope, end, end_slope] = self.rim[at.min(INTERVALS)];
        let half = most(self.square - square, 0.0).sqrt();
        [g + slope * rest, (end + end_slope * rest) * half]
    }

    /// K(t); beyond the kernel's radius that of the radius.
    #[inline(always)]
    pub(super) fn along(&self, t: f32) -> f32 {
        let (at, rest) = parts(least(t.abs() * self.per_length, INTERVALS as f32));
        let [length, slope] = self.along[at.min(INTERVALS)];
        (length + slope * rest).copysign(t)
    }
}

/// The nearest whole number, and what is left.
#[inline(always)]
fn parts(number: f32) -> (usize, f32) {
    let rounded = number + MAGIC;
    ((rounded.to_bits() & LOW) as usize, number - (rounded - MAGIC))
}

/// The nearest whole number, for numbers of magnitude up to 2²¹.
#[inline(always)]
pub(super) fn nearest(number: f32) -> i32 {
    (number + MAGIC).to_bits() as i32 - MAGIC.to_bits() as i32
}

/// The smaller of two numbers that are not NaN, by one instruction.
#[inline(always)]
pub(super) fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The larger of two numbers that are not NaN.
#[inline(always)]
pub(super) fn most(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// `(2^f - 1)/f` for `|f| ≤ 1/2`.
const EXP2: [f32; 6] =
    [std::f32::consts::LN_2, 0.240_226_5, 0.055_503_57, 0.009_618_082, 0.001_339_086_3, 0.000_154_531_63];

/// `exp(-x)` for x from 0 on; at least 2⁻¹⁰⁰, so that no number is subnormal.
#[inline(always)]
pub(super) fn passed(x: f32) -> f32 {
    let exponent = most(x * -std::f32::consts::LOG2_E, -100.0);
    let rounded = exponent + MAGIC;
    let f = exponent - (rounded - MAGIC);
    let square = f * f;
    let (low, middle, high) = (f * EXP2[1] + EXP2[0], f * EXP2[3] + EXP2[2], f * EXP2[5] + EXP2[4]);
    let less_one = f * (low + square * (middle + square * high));
    // The whole exponent is in the low bits; the shift drops all others.
    let power = f32::from_bits((rounded.to_bits() << 23).wrapping_add(127 << 23));
    power + power * less_one
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_that_passes_is_the_exponential() {
        for step in 0..40_000 {
            let x = step as f32 * 5e-4;
            let exact = (-f64::from(x)).exp();
            assert!((f64::from(passed(x)) / exact - 1.0).abs() < 2e-6, "{x}: {}", passed(x));
        }
        assert!(passed(1e9) < 1e-30 && passed(0.0) == 1.0);
    }

    #[test]
    fn tables_give_sections() {
        for (radius, falloff) in [(2.0, 2.0), (1.0, 0.05), (4.0, 16.0), (4.0, 0.5)] {
            let kernel = Kernel::new(radius, falloff);
            let profile = Profile::new(&kernel);
            let peak = kernel.section(0.0, -radius, radius);
            let mut worst: f64 = 0.0;
            for (row, column) in (0..200).flat_map(|row| (0..40).map(move |column| (row, column))) {
                let square = kernel.support().powi(2) * f64::from(row) / 200.0;
                let (t0, width) = (radius * (f64::from(column) / 16.0 - 1.25), radius / 3.0);
                let [g, end] = profile.rim(square as f32);
                let [a, b] = [t0, t0 + width].map(|t| profile.along(t as f32).clamp(-end, end));
                let error = f64::from(g * (b - a)) - kernel.section(square, t0, t0 + width);
                worst = worst.max(error.abs() / peak);
            }
            assert!(worst < 1e-4, "{radius} {falloff}: {worst:e}");
        }
    }
}
