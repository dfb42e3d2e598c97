//! Samples at uneven distances along an axis, as in a series with a missing slice: they are resampled to even ones.

use std::collections::TryReserveError;

use super::voxel::{Many, Voxel};
use super::voxels::Voxels;

/// Distances up to this many of the smallest count as equal to it.
const ALIKE: f64 = 1.1;
/// Even places closer to a sample than this fraction of their distance are the sample's own.
pub(super) const SAME_PLACE: f64 = 0.01;
/// The maximum ratio of even places to samples.
pub(super) const MAX_GROWTH: f64 = 4.0;

/// Even places along an axis, as positions among uneven samples.
#[derive(Debug, PartialEq)]
pub(super) struct Even {
    /// The distance between neighbouring places.
    pub(super) step: f64,
    /// For each place the sample at or before it, and the fraction of the way to the next one.
    pub(super) places: Vec<(usize, f64)>,
}

impl Even {
    /// Places from the first to the last of at least two ascending positions, at the finest distance between neighbours.
    ///
    /// # Errors
    /// The distances, if more than four times as many places as samples would be needed.
    pub(super) fn of(positions: &[f64]) -> Result<Self, String> {
        let steps: Vec<f64> = positions.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let [least, most] =
            steps.iter().fold([f64::INFINITY, 0.0_f64], |[least, most], &step| [least.min(step), most.max(step)]);
        let alike: Vec<f64> = steps.into_iter().filter(|&step| step <= ALIKE * least).collect();
        let finest = alike.iter().sum::<f64>() / alike.len() as f64;
        let (first, last) = (positions[0], positions[positions.len() - 1]);
        let count = ((last - first) / finest).round();
        if count.is_nan() || count + 1.0 > MAX_GROWTH * positions.len() as f64 {
            return Err(format!("distances from {least:.4} to {most:.4}, which need {} samples", count + 1.0));
        }
        let step = (last - first) / count;
        let mut before = 0;
        let mut place = |at: usize| {
            let place = first + at as f64 * step;
            while before + 2 < positions.len() && positions[before + 1] <= place {
                before += 1;
            }
            let [left, right] = [place - positions[before], positions[before + 1] - place];
            if left <= SAME_PLACE * step {
                (before, 0.0)
            } else if right <= SAME_PLACE * step {
                (before + 1, 0.0)
            } else {
                (before, left / (left + right))
            }
        };
        Ok(Self { step, places: (0..=count as usize).map(&mut place).collect() })
    }

    /// The places, each moved to the nearest sample.
    #[cfg(feature = "dicom")]
    pub(super) fn nearest(self) -> Self {
        let places = self.places.into_iter().map(|(at, part)| (at + usize::from(part >= 0.5), 0.0)).collect();
        Self { places, ..self }
    }

    /// Values along an axis of `samples` samples, each of `inner` neighbouring values, resampled; those behind them, too. Values between samples are
    /// interpolated linearly, labels are those of the nearest sample.
    ///
    /// # Errors
    /// If there is no memory for them.
    pub(super) fn resampled(&self, values: &Voxels, inner: usize, samples: usize) -> Result<Voxels, TryReserveError> {
        match values {
            Voxels::Values(values) => Ok(self.resampled_of::<f32>(values, inner, samples)?.into()),
            Voxels::Ids(ids) => Ok(self.resampled_of::<u64>(ids, inner, samples)?.into()),
        }
    }

    fn resampled_of<T: Voxel>(
        &self,
        values: &T::Many,
        inner: usize,
        samples: usize,
    ) -> Result<T::Many, TryReserveError> {
        let mut resampled = T::Many::default();
        let mut row = Vec::new();
        for outer in 0..values.count() / (inner * samples) {
            for &(sample, part) in &self.places {
                let from = (outer * samples + sample) * inner;
                row.clear();
                row.try_reserve_exact(inner)?;
                row.extend((from..from + inner).map(|at| match part {
                    0.0 => values.at(at),
                    part => values.at(at).between(values.at(at + inner), part),
                }));
                resampled.append(&row)?;
            }
        }
        Ok(resampled)
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::super::values::Values;
    use super::*;

    #[test]
    fn a_missing_sample_lies_between_its_neighbours() {
        let even = Even::of(&[0.0, 2.0, 6.0, 8.0]).unwrap();
        assert_eq!(even, Even { step: 2.0, places: vec![(0, 0.0), (1, 0.0), (1, 0.5), (2, 0.0), (3, 0.0)] });
        let values = Values::from(vec![0.0, 1.0, 10.0, 11.0, 30.0, 31.0, 40.0, 41.0]);
        let resampled = even.resampled_of::<f32>(&values, 2, 4).unwrap();
        assert_eq!(resampled.as_slice(), [0.0, 1.0, 10.0, 11.0, 20.0, 21.0, 30.0, 31.0, 40.0, 41.0]);
        let labels = even.resampled_of::<u64>(&vec![1, 2, 3, 4].into(), 1, 4).unwrap();
        assert_eq!((0..labels.count()).map(|at| labels.at(at)).collect::<Vec<_>>(), [1, 2, 3, 3, 4]);
    }

    /// A field that is linear along the axis stays as it is, wherever its samples lie.
    #[test]
    fn linear_fields_stay() {
        let positions = [-3.0, -1.0, 0.5, 1.0, 5.0, 6.25];
        let even = Even::of(&positions).unwrap();
        let values = Values::from(positions.map(|at| 3.0 * at as f32).to_vec());
        let resampled = even.resampled_of::<f32>(&values, 1, positions.len()).unwrap();
        for (at, value) in resampled.as_slice().iter().enumerate() {
            let expected = 3.0 * (-3.0 + at as f64 * even.step);
            assert!((f64::from(value) - expected).abs() <= 3.0 * SAME_PLACE * even.step + 1e-5, "{at}: {value}");
        }
    }

    #[test]
    fn many_times_the_samples_are_refused() {
        let found = Even::of(&[0.0, 0.1, 10.0]).unwrap_err();
        assert_eq!(found, "distances from 0.1000 to 9.9000, which need 101 samples");
        assert!(Even::of(&[0.0, f64::MIN_POSITIVE, 1e300]).is_err());
    }
}
