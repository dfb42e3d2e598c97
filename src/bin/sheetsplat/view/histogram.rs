//! Counts of a volume's values.

use sheetsplat::volume::ValueSlice;

/// The number of bars in a [`Histogram`].
const BINS: usize = 256;

/// The distribution of a volume's values.
pub(super) struct Histogram {
    /// Heights in [0, 1], logarithmic, so that a background of millions does not hide an object of hundreds.
    pub(super) heights: Vec<f32>,
}

impl Histogram {
    /// Counts finite values within a range that is not empty.
    pub(super) fn new(values: ValueSlice<'_>, [lo, hi]: [f64; 2]) -> Self {
        let mut counts = [0_u64; BINS];
        let scale = BINS as f64 / (hi - lo);
        for value in values.iter().filter(|value| !value.is_nan()) {
            counts[(((f64::from(value) - lo) * scale) as usize).min(BINS - 1)] += 1;
        }
        let logarithm = |count: u64| (count as f64).ln_1p();
        let most = counts.iter().copied().max().map_or(1.0, logarithm).max(1.0);
        Self { heights: counts.iter().map(|&count| (logarithm(count) / most) as f32).collect() }
    }
}

/// The minimum and maximum finite value.
pub(super) fn extent(values: ValueSlice<'_>) -> [f64; 2] {
    // `f32::min` and `f32::max` ignore holes (NaN).
    let (lo, hi) = values.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)));
    [lo.into(), hi.into()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_stand_where_the_values_are_and_grow_with_the_logarithm() {
        let values: Vec<f32> = [vec![f32::NAN; 9999], vec![10.0; 999], vec![20.0; 9], vec![15.1; 99]].concat();
        let values = ValueSlice::from(&values);
        assert_eq!(extent(values), [10.0, 20.0]);
        let Histogram { heights } = Histogram::new(values, extent(values));
        assert_eq!(heights.len(), BINS);
        let third = 1.0 / 3.0;
        for (bin, expected) in [(0, 1.0), (BINS - 1, third), (BINS * 51 / 100, 2.0 * third)] {
            assert!((heights[bin] - expected).abs() < 1e-6, "{bin}: {}", heights[bin]);
        }
        assert_eq!(heights.iter().filter(|&&height| height > 0.0).count(), 3);
    }
}
