//! The numbers that are splatted for values (SPEC §9): differences from the middle of the values' range, scaled by a power of two to about 1. An
//! `f32` then keeps the digits in which values differ, sums of products cannot overflow, and scaling rounds nothing.

use crate::volume::range::range_of;

/// From values to the numbers that are splatted, `(value - base)·scale`, and back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Normalization {
    /// The value that becomes 0; an `f32`.
    pub base: f64,
    /// A power of two.
    pub scale: f64,
    /// The minimum and maximum number.
    pub range: [f32; 2],
}

/// The scales' largest exponent, up or down: they and their inverses are normal `f32`s.
const MAX_EXPONENT: i32 = 126;

impl Normalization {
    /// The numbers for values from `min` to `max`.
    pub fn new([min, max]: [f64; 2]) -> Self {
        let base = f64::from(((min + max) / 2.0) as f32);
        let farthest = (max - base).max(base - min);
        // For a constant only the base matters.
        let exponent = if farthest > 0.0 { libm::log2(farthest).ceil().clamp(-126.0, 126.0) as i32 } else { 0 };
        debug_assert!(exponent.abs() <= MAX_EXPONENT);
        let scale = 2.0_f64.powi(-exponent);
        let normalization = Self { base, scale, range: [0.0; 2] };
        Self { range: [min, max].map(|value| normalization.apply(value) as f32), ..normalization }
    }

    /// The numbers for the range of some values; NaN is ignored. `None` if all are NaN.
    pub fn of(values: impl Iterator<Item = f32>) -> Option<Self> {
        range_of(values).map(|range| Self::new(range.map(f64::from)))
    }

    /// The number of a value.
    pub fn apply(&self, value: f64) -> f64 {
        (value - self.base) * self.scale
    }

    /// The rounding error of `Σ c·g·δ / N - f·Σ g·δ / N` with a kernel of this radius, whose terms are added one by one: where all values are equal it is no
    /// longer, and a direction made of it would be noise.
    pub fn min_moment(&self, radius: f64) -> f32 {
        // About as many units in the last place as a kernel of the default radius reaches voxels.
        const UNITS: f32 = 32.0;
        UNITS * f32::EPSILON * radius as f32 * self.range[0].abs().max(self.range[1].abs())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_about_1_and_tell_neighbours_apart() {
        for [min, max] in [[0.0_f32, 255.0], [1e6, 1e6 + 1.0], [-3.0e38, 3.0e38], [1e-40, 3e-40], [-5.0, 1e30]] {
            let numbers = Normalization::new([min, max].map(f64::from));
            let [first, last] = numbers.range;
            assert!(first.abs() <= 4.0 && last.abs() <= 4.0 && first < last, "{min} {max}: {numbers:?}");
            assert_eq!(numbers.scale.log2().fract(), 0.0);
            let [a, b] = [min, min.next_up()].map(|value| numbers.apply(f64::from(value)) as f32);
            assert!(a < b || max / min > 1e7 || min < 0.0, "{min}: {a} {b}");
        }
        let constant = Normalization::new([7.5; 2]);
        assert_eq!((constant.apply(7.5), constant.range), (0.0, [0.0; 2]));
        assert_eq!(Normalization::of([f32::NAN].into_iter()), None);
        assert_eq!(Normalization::of([2.0, f32::NAN, 4.0].into_iter()), Some(Normalization::new([2.0, 4.0])));
    }
}
