//! Separates an object in a volume from its background.

use super::padding::{AIR, is_padded};
use super::quantile::quantiles;
#[cfg(not(target_arch = "wasm32"))]
use crate::parallel::prelude::*;
use crate::settings::transfer_function::Ramp;
use crate::volume::ValueSlice;

const BINS: usize = 256;

/// The number of values that one thread counts at a time.
const CHUNK: usize = 1 << 18;

/// The fraction of values at either end that the histogram leaves out, such as hot pixels.
const TAIL: f64 = 0.0005;

/// The levels of the object in a volume, from the histogram: `background < faint <= bright`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Object {
    /// The background's mean value.
    pub(super) background: f64,
    /// The upper bound of the object's faintest eighth.
    pub(super) faint: f64,
    /// The lower bound of the object's brightest eighth.
    pub(super) bright: f64,
}

impl Object {
    /// The levels for the finite values; `None` if these are all equal.
    pub(super) fn find(values: ValueSlice<'_>) -> Option<Self> {
        let [lo, hi] = ends(values)?;
        let (start, range) = (f64::from(lo), f64::from(hi) - f64::from(lo));
        let bin = |value: f32| (f64::from(value) - start) / range * BINS as f64;
        let counted = values.par_chunks(CHUNK).map(|chunk| {
            let (mut counts, mut least_count) = ([0.0; BINS], 0.0);
            chunk.iter().filter(|value| !value.is_nan()).for_each(|value| {
                // Values below the first bin count in it.
                counts[(bin(value) as usize).min(BINS - 1)] += 1.0;
                least_count += if value <= lo { 1.0 } else { 0.0 };
            });
            (counts, least_count)
        });
        let (mut counts, least_count) = counted.reduce(
            || ([0.0; BINS], 0.0),
            |(a, least_a), (b, least_b)| (std::array::from_fn(|bin| a[bin] + b[bin]), least_a + least_b),
        );
        let value_of = |bin: f64| start + (bin + 0.5) / BINS as f64 * range;

        // In sparse data, such as a labelled cell, the background has been cleared and all the rest is object.
        let (background, first) = if least_count > 0.99 * counts.iter().sum::<f64>() {
            counts[0] -= least_count;
            (start, 0)
        } else {
            let first = otsu_split(&counts);
            let (count, sum) = count_and_sum(&counts[..first]);
            (value_of(sum / count), first)
        };
        let object = &counts[first..];
        let (object_count, _) = count_and_sum(object);
        let quantile = |share: f64| {
            let mut left = share * object_count;
            let bin = object.iter().position(|count| {
                left -= count;
                left <= 0.0
            });
            value_of((first + bin.unwrap_or(object.len() - 1)) as f64)
        };
        Some(Self { background, faint: quantile(0.125), bright: quantile(0.875) })
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

/// The range of the histogram; `None` if all values are equal.
fn ends(values: ValueSlice<'_>) -> Option<[f32; 2]> {
    // `f32::min` and `f32::max` ignore holes (NaN).
    let widen = |(lo, hi): (f32, f32), (a, b): (f32, f32)| (lo.min(a), hi.max(b));
    let extent = values.par_iter().map(|value| (value, value));
    let (least, greatest) = extent.reduce(|| (f32::INFINITY, f32::NEG_INFINITY), widen);
    if least >= greatest {
        return None;
    }
    // The maximum is excluded, because a cleared background may be nearly the whole volume.
    let [lo] = quantiles(values, |value| value < greatest, [TAIL])?;
    let [hi] = quantiles(values, |value| value > least, [1.0 - TAIL])?;
    let lo = if is_padded(values, least) { lo.max(AIR as f32) } else { lo };
    Some(if lo < hi { [lo, hi] } else { [least, greatest] })
}

/// The first bin of the upper class for which the variance between two classes is maximal (Otsu 1979). The first and the last bin must
/// not be empty.
fn otsu_split(counts: &[f64]) -> usize {
    let (total_count, total_sum) = count_and_sum(counts);
    let (mut count, mut sum) = (0.0, 0.0);
    let (mut best, mut best_variance) = (1, 0.0);
    for split in 1..counts.len() {
        count += counts[split - 1];
        sum += counts[split - 1] * (split - 1) as f64;
        let distance = (total_sum - sum) / (total_count - count) - sum / count;
        let variance = count * (total_count - count) * distance * distance;
        if variance > best_variance {
            (best, best_variance) = (split, variance);
        }
    }
    best
}

/// The number of values in some bins, and the sum of their bins' indices.
fn count_and_sum(counts: &[f64]) -> (f64, f64) {
    counts.iter().enumerate().fold((0.0, 0.0), |(count, sum), (bin, &n)| (count + n, sum + n * bin as f64))
}
