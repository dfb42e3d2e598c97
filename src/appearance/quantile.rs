//! Quantiles of many values, exact and without sorting them.

use rayon::prelude::*;

use crate::iso_range::{of_ordinal, ordinal};

/// Values that one thread counts at a time.
const CHUNK: usize = 1 << 20;

/// Of the values that count, those that have a share, in [0, 1], of the others before them when they are sorted; `None` if none
/// count. Values are finite.
pub fn quantiles<const N: usize>(
    values: &[f32],
    counts: impl Fn(f32) -> bool + Sync,
    shares: [f64; N],
) -> Option<[f32; N]> {
    // Two digits of 16 bits: first how many values have which upper one, then the lower ones of those that have the wanted one.
    let upper = histogram(values, |value| counts(value).then(|| (ordinal(value) >> 16) as u16));
    let last = upper.iter().sum::<u64>().checked_sub(1)?;
    Some(shares.map(|share| {
        let (digit, rank) = digit_at(&upper, (share * last as f64).round() as u64);
        let lower = histogram(values, |value| {
            let ordinal = ordinal(value);
            (ordinal >> 16 == digit && counts(value)).then_some(ordinal as u16)
        });
        of_ordinal(digit << 16 | digit_at(&lower, rank).0)
    }))
}

/// How many values have which of 65536 digits, or other properties.
pub(super) fn histogram(values: &[f32], digit: impl Fn(f32) -> Option<u16> + Sync) -> Vec<u64> {
    let zeros = || vec![0_u64; 1 << 16];
    let counted = values.par_chunks(CHUNK).fold(zeros, |mut counts, chunk| {
        for digit in chunk.iter().filter_map(|&value| digit(value)) {
            counts[usize::from(digit)] += 1;
        }
        counts
    });
    counted.reduce(zeros, |a, b| a.iter().zip(b).map(|(a, b)| a + b).collect())
}

/// The digit of the value of a rank, and its rank among those.
fn digit_at(counts: &[u64], mut rank: u64) -> (u32, u64) {
    for (digit, &count) in (0..).zip(counts) {
        if rank < count {
            return (digit, rank);
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
            assert_eq!(quantiles(&values, |_| true, [share]), Some([expected]), "{share}");
        }
        let positive: Vec<f32> = sorted.into_iter().filter(|&value| value > 5.0).collect();
        assert_eq!(quantiles(&values, |value| value > 5.0, [1.0, 0.0]), Some([f32::MAX, positive[0]]));
        assert_eq!(quantiles(&values, |_| false, [0.5]), None);
        assert_eq!(quantiles(&[], |_| true, [0.5]), None);
    }

    #[test]
    fn neighbours_far_from_the_origin_are_told_apart() {
        let values: Vec<f32> = (0..100_u32).map(|at| (1_000_000 + at) as f32).collect();
        assert_eq!(quantiles(&values, |_| true, [0.5]), Some([1_000_050.0]));
    }
}
