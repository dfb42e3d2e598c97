//! A histogram that is split into background and object, and wild values that would hide both.

use super::padding::{AIR, is_padded};
use super::quantile::quantiles;
use crate::volume::ValueSlice;

pub(super) const BINS: usize = 256;

/// The number of values that one thread counts at a time.
const CHUNK: usize = 1 << 18;

/// The fraction of values at either end that the histogram leaves out, such as hot pixels.
const TAIL: f64 = 0.0005;

/// The values that are not wild: at least the first one, and below the second.
#[derive(Clone, Copy, Debug)]
struct Bounds([f64; 2]);

impl Bounds {
    fn contain(self, value: f32) -> bool {
        (self.0[0]..self.0[1]).contains(&f64::from(value))
    }
}

/// A histogram of the finite values, those beyond its ends in the outermost bins, and its split by Otsu's threshold.
#[derive(Clone, Debug)]
pub(super) struct Split {
    bounds: Bounds,
    /// The least and the greatest of all values.
    extent: [f64; 2],
    /// The values at the histogram's ends.
    ends: [f64; 2],
    pub(super) counts: [f64; BINS],
    /// The number of values in each class, and of those beyond the bounds.
    background: f64,
    object: f64,
    wild: f64,
    /// The object's first bin.
    pub(super) first: usize,
    /// The variance between the classes over that of all values.
    separation: f64,
    /// Whether the background is one value that nearly all voxels have; it is not in the counts then, and all bins are the object's.
    pub(super) is_cleared: bool,
}

impl Split {
    /// The split of the finite values; `None` if these are all equal. Where few values are wild, such as those of metal, a filter's artefacts or -1e30
    /// in place of a measurement, the histogram is that of the others.
    pub(super) fn of(values: ValueSlice<'_>) -> Option<Self> {
        let whole = Self::within(Bounds([f64::NEG_INFINITY, f64::INFINITY]), values)?;
        Some(whole.without_wild(values).unwrap_or(whole))
    }

    /// The value in the middle of a bin, or between two.
    pub(super) fn value_of(&self, bin: f64) -> f64 {
        self.ends[0] + (bin + 0.5) / BINS as f64 * (self.ends[1] - self.ends[0])
    }

    /// The histogram's first value.
    pub(super) fn start(&self) -> f64 {
        self.ends[0]
    }

    /// The greatest value that is not wild; infinite if none is too great.
    pub(super) fn ceiling(&self) -> f64 {
        if self.bounds.0[1].is_finite() { self.ends[1] } else { f64::INFINITY }
    }

    /// Whether an `f32` keeps too few digits of the histogram's values where all values are scaled to about 1, as in SPEC §9.
    pub(super) fn exceeds_digits(&self) -> bool {
        // Eight bits of 24 are left.
        const MOST: f64 = (1_u32 << 16) as f64;
        let [[least, greatest], [low, high]] = [self.extent, self.ends];
        greatest - least >= MOST * (high - low)
    }

    fn within(bounds: Bounds, values: ValueSlice<'_>) -> Option<Self> {
        let (extent, [lo, hi]) = ends(values, bounds)?;
        let (start, range) = (f64::from(lo), f64::from(hi) - f64::from(lo));
        let bin = |value: f32| (f64::from(value) - start) / range * BINS as f64;
        let counted = values.par_chunks(CHUNK).map(|chunk| {
            let (mut counts, mut least_and_wild) = ([0.0; BINS], [0.0; 2]);
            chunk.iter().filter(|value| !value.is_nan()).for_each(|value| {
                // Values below the first bin count in it.
                counts[(bin(value) as usize).min(BINS - 1)] += 1.0;
                least_and_wild[0] += if value <= lo { 1.0 } else { 0.0 };
                least_and_wild[1] += if bounds.contain(value) { 0.0 } else { 1.0 };
            });
            (counts, least_and_wild)
        });
        let (mut counts, [least_count, wild]) = counted.reduce(
            || ([0.0; BINS], [0.0; 2]),
            |(a, of_a), (b, of_b)| (std::array::from_fn(|bin| a[bin] + b[bin]), [of_a[0] + of_b[0], of_a[1] + of_b[1]]),
        );
        let (all, _) = count_and_sum(&counts);
        // In sparse data, such as a labelled cell, the background has been cleared and all the rest is object.
        let is_cleared = least_count > 0.99 * all;
        let (first, separation) = if is_cleared { (0, 1.0) } else { otsu_split(&counts) };
        let background = if is_cleared { least_count } else { count_and_sum(&counts[..first]).0 };
        if is_cleared {
            counts[0] -= least_count;
        }
        let [extent, ends] = [extent, [lo, hi]].map(|ends| ends.map(f64::from));
        Some(Self {
            bounds,
            extent,
            ends,
            counts,
            background,
            object: all - background,
            wild,
            first,
            separation,
            is_cleared,
        })
    }

    /// The split of the other values if one of the classes is wild: at most one value in a hundred, and isolated.
    ///
    /// The others must form a background and an object that are far apart, each far more frequent than the wild values, because few bright beads in noise
    /// are not wild; or the wild values are so great that an `f32` could not tell the others apart beside them.
    fn without_wild(&self, values: ValueSlice<'_>) -> Option<Self> {
        /// At most this fraction of all values is wild.
        const SHARE: f64 = 0.01;
        /// Uniform values give 0.75, noise less, and bodies in air more than 0.9.
        const SEPARATION: f64 = 0.8;
        const MORE_FREQUENT: f64 = 10.0;
        /// The reciprocal of the precision of an `f32`.
        const BEYOND_PRECISION: f64 = (1_u32 << 24) as f64;
        // On each side there may be two kinds.
        const TRIALS: usize = 4;
        let most = SHARE * (self.background + self.object);
        let mut split = self.clone();
        for _ in 0..TRIALS {
            let edge = split.ends[0] + (split.ends[1] - split.ends[0]) * split.first as f64 / BINS as f64;
            let mut bounds = split.bounds;
            if split.is_cleared {
                return None;
            } else if split.object <= most {
                bounds.0[1] = edge;
            } else if split.background <= most {
                bounds.0[0] = edge;
            } else {
                return None;
            }
            split = Self { extent: self.extent, ..Self::within(bounds, values)? };
            if split.wild > most || !split.is_isolated(values) {
                return None;
            }
            let [low, high] = split.ends;
            let [least, greatest] = self.extent;
            let are_beyond_precision = greatest - least >= BEYOND_PRECISION * (high - low);
            let least_frequent = split.object.min(split.background);
            let are_apart = split.separation >= SEPARATION && least_frequent >= MORE_FREQUENT * split.wild;
            if are_apart || are_beyond_precision && least_frequent > most {
                return Some(split);
            }
        }
        None
    }

    /// Whether the wild values on each side are far from the others: three quarters of them are beyond half of their median's distance. Tails, such as those of
    /// fluorescence, decrease from the others on.
    fn is_isolated(&self, values: ValueSlice<'_>) -> bool {
        let [low, high] = self.ends;
        let is_far = |[median, quartile]: [f32; 2], end: f64| {
            (f64::from(quartile) - end).abs() >= (f64::from(median) - end).abs() / 2.0
        };
        let above = quantiles(values, |value| f64::from(value) >= self.bounds.0[1], [0.5, 0.25]);
        let below = quantiles(values, |value| f64::from(value) < self.bounds.0[0], [0.5, 0.75]);
        above.is_none_or(|above| is_far(above, high)) && below.is_none_or(|below| is_far(below, low))
    }
}

/// The least and the greatest of the values within bounds, and the ends of their histogram; `None` if all of them are equal.
fn ends(values: ValueSlice<'_>, bounds: Bounds) -> Option<([f32; 2], [f32; 2])> {
    // `f32::min` and `f32::max` ignore holes (NaN).
    let widen = |(lo, hi): (f32, f32), (a, b): (f32, f32)| (lo.min(a), hi.max(b));
    let extent = values.par_iter().filter(|value| bounds.contain(*value)).map(|value| (value, value));
    let (least, greatest) = extent.reduce(|| (f32::INFINITY, f32::NEG_INFINITY), widen);
    if least >= greatest {
        return None;
    }
    // The maximum is excluded, because a cleared background may be nearly the whole volume.
    let [lo] = quantiles(values, |value| value < greatest && bounds.contain(value), [TAIL])?;
    let [hi] = quantiles(values, |value| value > least && bounds.contain(value), [1.0 - TAIL])?;
    let lo = if is_padded(values, least) { lo.max(AIR as f32) } else { lo };
    let extent = [least, greatest];
    Some((extent, if lo < hi { [lo, hi] } else { extent }))
}

/// The first bin of the upper class for which the variance between two classes is maximal (Otsu 1979), and this variance over that of all bins. The first and the last bin must
/// not be empty.
fn otsu_split(counts: &[f64]) -> (usize, f64) {
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
    let mean = total_sum / total_count;
    let squares = counts.iter().enumerate().map(|(bin, &n)| n * (bin as f64 - mean) * (bin as f64 - mean));
    (best, best_variance / (total_count * squares.sum::<f64>()))
}

/// The number of values in some bins, and the sum of their bins' indices.
pub(super) fn count_and_sum(counts: &[f64]) -> (f64, f64) {
    counts.iter().enumerate().fold((0.0, 0.0), |(count, sum), (bin, &n)| (count + n, sum + n * bin as f64))
}
