//! Separates an object in a volume from its background.

use super::split::{Split, count_and_sum};
use crate::settings::transfer_function::Ramp;
use crate::volume::ValueSlice;

/// The levels of the object in a volume, from the histogram: `background < faint <= bright`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Object {
    /// The background's mean value.
    pub(super) background: f64,
    /// The upper bound of the object's faintest eighth.
    pub(super) faint: f64,
    /// The lower bound of the object's brightest eighth.
    pub(super) bright: f64,
    /// The greatest value that is not wild, such as metal's; infinite if none is wild.
    pub(super) ceiling: f64,
    /// Whether an `f32` that is scaled to hold every value keeps too few digits of the object's.
    pub(super) exceeds_digits: bool,
}

impl Object {
    /// The levels for the finite values that are not wild; `None` if the finite values are all equal.
    pub(super) fn find(values: ValueSlice<'_>) -> Option<Self> {
        let split = Split::of(values)?;
        let background = if split.is_cleared {
            split.start()
        } else {
            let (count, sum) = count_and_sum(&split.counts[..split.first]);
            split.value_of(sum / count)
        };
        let object = &split.counts[split.first..];
        let (object_count, _) = count_and_sum(object);
        let quantile = |share: f64| {
            let mut left = share * object_count;
            let bin = object.iter().position(|count| {
                left -= count;
                left <= 0.0
            });
            split.value_of((split.first + bin.unwrap_or(object.len() - 1)) as f64)
        };
        let (ceiling, exceeds_digits) = (split.ceiling(), split.exceeds_digits());
        Some(Self { background, faint: quantile(0.125), bright: quantile(0.875), ceiling, exceeds_digits })
    }

    /// The value at the object's surface. Otsu's threshold separates object from background, but lies half way between their means, which
    /// loses faint parts (skin, leaves, thin branches). Samples at the border mix both, so the surface is put half way between the
    /// background's mean and the object's faintest eighth.
    pub(super) fn threshold(&self) -> f64 {
        (self.background + self.faint) / 2.0
    }

    /// An opacity that rises at the surface.
    pub(super) fn surface(&self, opacity: f64) -> Ramp<f64> {
        let threshold = self.threshold();
        // Soft enough to hide voxel steps, but always clear of the background.
        let half_width = (threshold - self.background) / 3.0;
        Ramp::through(vec![(threshold - half_width, 0.0), (threshold + half_width, opacity)])
    }
}
