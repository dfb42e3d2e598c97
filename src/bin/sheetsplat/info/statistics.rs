//! How a volume's values are distributed.

use rayon::prelude::*;
use sheetsplat::iso_range::ordinal;

/// Values that one thread takes at a time.
const CHUNK: usize = 1 << 20;

/// Bins of a histogram.
const BINS: usize = 256;

/// The least and the largest value, and the mean, the same in every run.
pub(super) fn extent_and_mean(values: &[f32]) -> [f64; 3] {
    let of_chunk = |chunk: &[f32]| {
        let start = [f64::INFINITY, f64::NEG_INFINITY, 0.0];
        chunk.iter().fold(start, |[least, largest, sum], &value| {
            let value = f64::from(value);
            [least.min(value), largest.max(value), sum + value]
        })
    };
    // Collected, so that the sums are added in one order.
    let chunks: Vec<[f64; 3]> = values.par_chunks(CHUNK).map(of_chunk).collect();
    let [least, largest, sum] = chunks
        .into_iter()
        .reduce(|[a, b, c], [least, largest, sum]| [a.min(least), b.max(largest), c + sum])
        .unwrap_or_default();
    [least, largest, sum / values.len() as f64]
}

/// The values that have these shares, in [0, 1], of the others before them when all are sorted.
pub(super) fn quantiles(values: &[f32], shares: &[f64]) -> Vec<f64> {
    // Two digits of 16 bits: first how many values have which upper one, then the lower ones of those that have a wanted one.
    let upper = count(values, |value| Some((ordinal(value) >> 16) as usize), 1 << 16);
    let ranks = shares.iter().map(|share| (share * (values.len() - 1) as f64).round() as u64);
    let places: Vec<(usize, u64)> = ranks.map(|rank| bin_of_rank(&upper, rank)).collect();
    let mut wanted: Vec<usize> = places.iter().map(|&(bin, _)| bin).collect();
    wanted.dedup();
    let lower = count(
        values,
        |value| {
            let ordinal = ordinal(value);
            let at = wanted.binary_search(&((ordinal >> 16) as usize)).ok()?;
            Some(at << 16 | (ordinal & 0xffff) as usize)
        },
        wanted.len() << 16,
    );
    let value = |&(bin, rank): &(usize, u64)| {
        let at = wanted.binary_search(&bin).unwrap_or_default();
        let (digit, _) = bin_of_rank(&lower[at << 16..][..1 << 16], rank);
        value_of((bin << 16 | digit) as u32)
    };
    places.iter().map(value).collect()
}

/// The value that has an ordinal.
fn value_of(ordinal: u32) -> f64 {
    let bits = if ordinal >> 31 == 1 { ordinal & !(1 << 31) } else { !ordinal };
    f32::from_bits(bits).into()
}

/// The bin of the value of a rank, and its rank in there.
fn bin_of_rank(counts: &[u64], mut rank: u64) -> (usize, u64) {
    for (bin, &count) in counts.iter().enumerate() {
        if rank < count {
            return (bin, rank);
        }
        rank -= count;
    }
    (0, 0)
}

/// How many values are in which bin.
fn count(values: &[f32], bin: impl Fn(f32) -> Option<usize> + Sync, bins: usize) -> Vec<u64> {
    let zeros = || vec![0_u64; bins];
    let counted = values.par_chunks(CHUNK).fold(zeros, |mut counts, chunk| {
        for bin in chunk.iter().filter_map(|&value| bin(value)) {
            counts[bin] += 1;
        }
        counts
    });
    counted.reduce(zeros, |a, b| a.iter().zip(b).map(|(a, b)| a + b).collect())
}

/// How often values occur from a value to a larger one; what is beyond is in the bins at the ends.
pub(super) struct Histogram {
    pub(super) range: [f64; 2],
    pub(super) counts: Vec<u64>,
}

impl Histogram {
    pub(super) fn new(values: &[f32], [low, high]: [f64; 2]) -> Self {
        let scale = BINS as f64 / (high - low);
        let bin = |value: f32| Some((((f64::from(value) - low) * scale) as usize).min(BINS - 1));
        Self { range: [low, high], counts: count(values, bin, BINS) }
    }

    /// Where values fall into three classes, or into two if there are no more: the classes' variances are the least (Otsu 1979).
    pub(super) fn iso_values(&self) -> Vec<f64> {
        // Numbers of values, and sums of their bins, below each bin.
        let mut below = vec![[0.0; 2]];
        for (bin, &count) in self.counts.iter().enumerate() {
            let [number, sum] = below[bin];
            below.push([number + count as f64, sum + bin as f64 * count as f64]);
        }
        // Largest where variances within classes are the least; `None` for an empty class.
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
        // Between two classes many splits are as good: the middle of the bins that are empty there.
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
    fn quantiles_are_those_of_the_sorted_values() {
        let mut values: Vec<f32> = (0..5001_i32).map(|at| ((at * 7919 % 5001 - 900) as f32).powi(3) * 1e-4).collect();
        values.extend([f32::MAX, f32::MIN, 0.0, -0.0, 1e-40]);
        let mut sorted = values.clone();
        sorted.sort_by(f32::total_cmp);
        let shares = [0.0, 0.001, 0.25, 0.5, 0.77, 0.9999, 1.0];
        let expected = shares.map(|share| f64::from(sorted[(share * (sorted.len() - 1) as f64).round() as usize]));
        assert_eq!(quantiles(&values, &shares), expected);
        assert_eq!(quantiles(&[7.0], &[0.0, 1.0]), [7.0, 7.0]);
    }

    #[test]
    fn extents_and_means() {
        assert_eq!(extent_and_mean(&[3.0, -1.0, 4.0]), [-1.0, 4.0, 2.0]);
    }

    #[test]
    fn iso_values_lie_between_classes() {
        let peak = |center: f32, count: u16| (0..count).map(move |at| center + f32::from(at % 21) - 10.0);
        let three: Vec<f32> = peak(10.0, 5000).chain(peak(200.0, 3000)).chain(peak(700.0, 500)).collect();
        let isos = Histogram::new(&three, [0.0, 710.0]).iso_values();
        assert!(isos.len() == 2 && (20.0..190.0).contains(&isos[0]) && (210.0..690.0).contains(&isos[1]), "{isos:?}");
        let two: Vec<f32> = [vec![0.0; 100], vec![255.0; 3]].concat();
        let isos = Histogram::new(&two, [0.0, 255.0]).iso_values();
        assert!(isos.len() == 1 && (isos[0] - 127.5).abs() < 1.0, "{isos:?}");
    }
}
