//! The distribution of a volume's values.

use rayon::prelude::*;
use sheetsplat::appearance::histogram;
use sheetsplat::volume::ValueSlice;

/// The number of values that one thread processes at a time.
const CHUNK: usize = 1 << 20;

/// The number of bins in a histogram.
const BINS: usize = 256;

/// The minimum, maximum and mean of the finite values, the same in every run.
pub(super) fn extent_and_mean(values: ValueSlice<'_>) -> [f64; 3] {
    let of_chunk = |chunk: ValueSlice<'_>| {
        let start = [f64::INFINITY, f64::NEG_INFINITY, 0.0, 0.0];
        let finite = chunk.iter().filter(|value| !value.is_nan());
        finite.fold(start, |[least, largest, sum, count], value| {
            let value = f64::from(value);
            [least.min(value), largest.max(value), sum + value, count + 1.0]
        })
    };
    // The sums are collected, so that they are added in a fixed order.
    let chunks: Vec<ValueSlice<'_>> = values.chunks(CHUNK).collect();
    let chunks: Vec<[f64; 4]> = chunks.into_par_iter().map(of_chunk).collect();
    let [least, largest, sum, count] = chunks
        .into_iter()
        .reduce(|[a, b, c, d], [least, largest, sum, count]| [a.min(least), b.max(largest), c + sum, d + count])
        .unwrap_or_default();
    [least, largest, sum / count]
}

/// Counts of values from a minimum to a maximum; values beyond are in the outermost bins.
pub(super) struct Histogram {
    pub(super) range: [f64; 2],
    pub(super) counts: Vec<u64>,
}

impl Histogram {
    pub(super) fn new(values: ValueSlice<'_>, [low, high]: [f64; 2]) -> Self {
        let scale = BINS as f64 / (high - low);
        let bin = |value: f32| Some((((f64::from(value) - low) * scale) as usize).min(BINS - 1));
        Self { range: [low, high], counts: histogram(values, BINS, bin) }
    }

    /// The thresholds between three classes of values, or two if there are no more, that minimise the variance within classes (Otsu 1979).
    pub(super) fn iso_values(&self) -> Vec<f64> {
        // The number of values, and the sum of their bins, below each bin.
        let mut below = vec![[0.0; 2]];
        for (bin, &count) in self.counts.iter().enumerate() {
            let [number, sum] = below[bin];
            below.push([number + count as f64, sum + bin as f64 * count as f64]);
        }
        // Maximal where the variance within classes is minimal; `None` for an empty class.
        let class = |from: usize, to: usize| {
            let [number, sum] = [0, 1].map(|i| below[to][i] - below[from][i]);
            (number > 0.0).then(|| sum * sum / number)
        };
        let mut best: (f64, Vec<usize>) = (f64::NEG_INFINITY, Vec::new());
        let mut consider = |splits: &[usize]| {
            let ends = [&[0], splits, &[BINS]].concat();
            let classes: Option<f64> = ends.windows(2).map(|ends| class(ends[0], ends[1])).sum();
            if let Some(score) = classes.filter(|&score| score > best.0) {
                best = (score, splits.to_vec());
            }
        };
        for first in 1..BINS {
            consider(&[first]);
            (first + 1..BINS).for_each(|second| consider(&[first, second]));
        }
        // Between two classes many splits are equally good: the middle of the empty bins is used.
        let empty_from = |split: usize| (0..split).rev().take_while(|&bin| self.counts[bin] == 0).count();
        let empty_to = |split: usize| (split..BINS).take_while(|&bin| self.counts[bin] == 0).count();
        let place = |split: usize| split as f64 + (empty_to(split) as f64 - empty_from(split) as f64) / 2.0;
        let [low, high] = self.range;
        best.1.into_iter().map(|split| low + (high - low) * place(split) / BINS as f64).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extents_and_means() {
        assert_eq!(extent_and_mean(ValueSlice::F32(&[3.0, -1.0, 4.0])), [-1.0, 4.0, 2.0]);
        assert_eq!(extent_and_mean(ValueSlice::F32(&[f32::NAN, 3.0, -1.0, f32::NAN, 4.0])), [-1.0, 4.0, 2.0]);
    }

    #[test]
    fn iso_values_lie_between_classes() {
        let peak = |center: f32, count: u16| (0..count).map(move |at| center + f32::from(at % 21) - 10.0);
        let three: Vec<f32> = peak(10.0, 5000).chain(peak(200.0, 3000)).chain(peak(700.0, 500)).collect();
        let isos = Histogram::new((&three).into(), [0.0, 710.0]).iso_values();
        assert!(isos.len() == 2 && (20.0..190.0).contains(&isos[0]) && (210.0..690.0).contains(&isos[1]), "{isos:?}");
        let two: Vec<f32> = [vec![0.0; 100], vec![255.0; 3]].concat();
        let isos = Histogram::new((&two).into(), [0.0, 255.0]).iso_values();
        assert!(isos.len() == 1 && (isos[0] - 127.5).abs() < 1.0, "{isos:?}");
    }
}
