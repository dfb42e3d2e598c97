//! Ranges of values: their minimum and maximum.

/// The range of no values.
pub const EMPTY: [f32; 2] = [f32::INFINITY, f32::NEG_INFINITY];

/// The range of two ranges' values; NaN is ignored.
pub fn union([min, max]: [f32; 2], [other_min, other_max]: [f32; 2]) -> [f32; 2] {
    [min.min(other_min), max.max(other_max)]
}

/// The range of some values; NaN is ignored. `None` if all are NaN.
pub fn range_of(values: impl Iterator<Item = f32>) -> Option<[f32; 2]> {
    let range = values.fold(EMPTY, |range, value| union(range, [value; 2]));
    (range[0] <= range[1]).then_some(range)
}

/// The range of those of some values that are finite, as others are holes (SPEC §3).
pub fn finite_range(values: &[f32]) -> [f32; 2] {
    // Several ranges at a time, because each value waits for the previous one of its range.
    const LANES: usize = 32;
    let mut ranges = [[f32::INFINITY; LANES], [f32::NEG_INFINITY; LANES]];
    let (whole, rest) = values.as_chunks::<LANES>();
    for values in whole {
        for (lane, &value) in values.iter().enumerate() {
            let [low, high] = if value.is_finite() { [value; 2] } else { EMPTY };
            ranges[0][lane] = if low < ranges[0][lane] { low } else { ranges[0][lane] };
            ranges[1][lane] = if high > ranges[1][lane] { high } else { ranges[1][lane] };
        }
    }
    let [low, high] = ranges;
    let lanes = low.into_iter().zip(high).map(|(low, high)| [low, high]);
    let rest = rest.iter().filter(|value| value.is_finite()).map(|&value| [value; 2]);
    lanes.chain(rest).fold(EMPTY, union)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finite_ranges_are_those_of_a_search() {
        let mut values: Vec<f32> = (0..131_u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as f32 - 100.0).collect();
        values.iter_mut().step_by(7).for_each(|value| *value = f32::NAN);
        values.iter_mut().skip(3).step_by(11).for_each(|value| *value = f32::INFINITY);
        values.iter_mut().skip(4).step_by(13).for_each(|value| *value = f32::NEG_INFINITY);
        for first in 0..values.len() {
            for end in [first, first + 1, first + 31, first + 32, first + 33, values.len()] {
                let some = &values[first..end.min(values.len())];
                let mut finite: Vec<f32> = some.iter().copied().filter(|value| value.is_finite()).collect();
                finite.sort_by(f32::total_cmp);
                let expected = finite.first().map_or(EMPTY, |&least| [least, finite[finite.len() - 1]]);
                assert_eq!(finite_range(some), expected, "{first}..{end}");
            }
        }
    }
}
