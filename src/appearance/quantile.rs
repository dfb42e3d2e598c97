//! Histograms, and exact quantiles without sorting.

use crate::lists::iso_range::{of_ordinal, ordinal};
use crate::volume::ValueSlice;

/// The number of values that one thread counts at a time.
const CHUNK: usize = 1 << 20;

/// The quantiles of the values for which the predicate holds, at the given fractions in [0, 1]; `None` if it holds for none. Holes are
/// ignored.
pub fn quantiles<const N: usize>(
    values: ValueSlice<'_>,
    counts: impl Fn(f32) -> bool + Sync,
    shares: [f64; N],
) -> Option<[f32; N]> {
    // A value has two digits of 16 bits. The first pass counts the upper digits, the second the lower ones below the wanted upper digits.
    let digits = |value: f32| ((ordinal(value) >> 16) as usize, (ordinal(value) & 0xffff) as usize);
    let upper = histogram(values, 1 << 16, |value| counts(value).then(|| digits(value).0));
    let last = upper.iter().sum::<u64>().checked_sub(1)?;
    let places = shares.map(|share| bin_at(&upper, (share * last as f64).round() as u64));
    let mut wanted = places.map(|(digit, _)| digit).to_vec();
    wanted.sort_unstable();
    wanted.dedup();
    let lower = histogram(values, wanted.len() << 16, |value| {
        let (digit, rest) = digits(value);
        let at = wanted.binary_search(&digit).ok()?;
        counts(value).then_some(at << 16 | rest)
    });
    Some(places.map(|(digit, rank)| {
        let at = wanted.binary_search(&digit).unwrap_or_default();
        let (rest, _) = bin_at(&lower[at << 16..][..1 << 16], rank);
        of_ordinal((digit << 16 | rest) as u32)
    }))
}

/// The number of values in each bin. Values for which `bin` is `None`, and holes (NaN), are in no bin.
pub fn histogram(values: ValueSlice<'_>, bins: usize, bin: impl Fn(f32) -> Option<usize> + Sync) -> Vec<u64> {
    let zeros = || vec![0_u64; bins];
    let counted = values.par_chunks(CHUNK).fold(zeros, |mut counts, chunk| {
        chunk.iter().filter(|value| !value.is_nan()).filter_map(&bin).for_each(|bin| counts[bin] += 1);
        counts
    });
    counted.reduce(zeros, |a, b| a.iter().zip(b).map(|(a, b)| a + b).collect())
}

/// The bin that contains the value of a rank, and the rank within that bin.
fn bin_at(counts: &[u64], mut rank: u64) -> (usize, u64) {
    for (bin, &count) in counts.iter().enumerate() {
        if rank < count {
            return (bin, rank);
        }
        rank -= count;
    }
    (0, 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_sorted_values() {
        let mut values: Vec<f32> = (0..5001_i32).map(|at| ((at * 7919 % 5001 - 900) as f32).powi(3) * 1e-4).collect();
        values.extend([f32::MAX, f32::MIN, 0.0, 1e-40]);
        let mut sorted = values.clone();
        sorted.sort_by(f32::total_cmp);
        for share in [0.0, 0.001, 0.25, 0.5, 0.77, 0.9999, 1.0] {
            let expected = sorted[(share * (sorted.len() - 1) as f64).round() as usize];
            assert_eq!(quantiles((&values).into(), |_| true, [share]), Some([expected]), "{share}");
        }
        let positive: Vec<f32> = sorted.into_iter().filter(|&value| value > 5.0).collect();
        assert_eq!(quantiles((&values).into(), |value| value > 5.0, [1.0, 0.0]), Some([f32::MAX, positive[0]]));
        assert_eq!(quantiles((&values).into(), |_| false, [0.5]), None);
        assert_eq!(quantiles(ValueSlice::F32(&[]), |_| true, [0.5]), None);
        // Only finite values count.
        assert_eq!(
            quantiles(ValueSlice::F32(&[f32::NAN, 3.0, f32::NAN, 1.0, 2.0, f32::NAN]), |_| true, [0.0, 0.5, 1.0]),
            Some([1.0, 2.0, 3.0])
        );
        assert_eq!(quantiles(ValueSlice::F32(&[f32::NAN]), |_| true, [0.5]), None);
    }

    #[test]
    fn neighbours_far_from_the_origin_are_told_apart() {
        let values: Vec<f32> = (0..100_u32).map(|at| (1_000_000 + at) as f32).collect();
        assert_eq!(quantiles((&values).into(), |_| true, [0.5]), Some([1_000_050.0]));
    }
}
