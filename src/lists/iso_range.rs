//! Iso-ranges as sets of `f32` values (§5): the values that can take part under a transfer function, and the difference of two sets.
//!
//! Every finite `f32` has an ordinal that sorts like the value, so intervals with open or closed ends are half-open ranges of integers.

use std::ops::Range;

use crate::settings::transfer_function::{Ramp, Tables, TransferFunction};
use crate::volume::ValueSlice;

/// A set of values: ranges of ordinals that are ascending, disjoint and not adjacent.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ValueSet {
    ranges: Vec<Range<u32>>,
}

/// The position of a value among all `f32`; both zeros have the same.
pub fn ordinal(value: f32) -> u32 {
    let bits = (value + 0.0).to_bits();
    if bits >> 31 == 1 { !bits } else { bits | 1 << 31 }
}

/// The value with an [`ordinal`].
pub fn of_ordinal(ordinal: u32) -> f32 {
    f32::from_bits(if ordinal >> 31 == 1 { ordinal & !(1 << 31) } else { !ordinal })
}

/// Above the ordinals of all finite values, and below that of a hole.
pub const END: u32 = f32::INFINITY.to_bits() | 1 << 31;

/// The ordinal of the smallest `f32` that is at least `x`.
fn at_least(x: f64) -> u32 {
    let nearest = x as f32;
    ordinal(if f64::from(nearest) < x { nearest.next_up() } else { nearest })
}

/// The ordinal of the smallest `f32` above `x`.
fn above(x: f64) -> u32 {
    let nearest = x as f32;
    ordinal(if f64::from(nearest) <= x { nearest.next_up() } else { nearest })
}

impl ValueSet {
    /// The values that can take part under a transfer function (SPEC §3) without labels: in an iso-range, and with an opacity above 0.
    pub fn of(transfer: &TransferFunction) -> Self {
        Self::of_tables(&transfer.tables(None))
    }

    /// The values that can take part under a label's tables.
    pub fn of_tables(tables: &Tables) -> Self {
        if !tables.visible {
            return Self::default();
        }
        let opaque = Self::support(tables.opacity);
        match tables.iso_ranges {
            None => opaque,
            Some(ranges) => {
                opaque.intersection(&Self::of_ranges(ranges.iter().map(|&[lo, hi]| at_least(lo)..above(hi)).collect()))
            }
        }
    }

    /// Where a ramp that is nowhere negative is above 0.
    fn support(ramp: &Ramp<f64>) -> Self {
        let points = ramp.points();
        let mut ranges = Vec::new();
        for (at, &(x, y)) in points.iter().enumerate() {
            let before = at.checked_sub(1).map(|before| points[before]);
            // The interval from the previous point to this one, clamped before the first.
            if y > 0.0 || before.is_some_and(|(_, y)| y > 0.0) {
                ranges.push(before.map_or(0, |(x, _)| above(x))..at_least(x));
            }
            if y > 0.0 {
                ranges.push(at_least(x)..above(x));
                if at + 1 == points.len() {
                    ranges.push(above(x)..END);
                }
            }
        }
        Self::of_ranges(ranges)
    }

    fn of_ranges(mut ranges: Vec<Range<u32>>) -> Self {
        ranges.retain(|range| range.start < range.end);
        ranges.sort_unstable_by_key(|range| range.start);
        let mut merged: Vec<Range<u32>> = Vec::new();
        for range in ranges {
            match merged.last_mut() {
                Some(last) if range.start <= last.end => last.end = last.end.max(range.end),
                _ => merged.push(range),
            }
        }
        Self { ranges: merged }
    }

    /// The common values, by one walk over both lists.
    fn intersection(&self, other: &Self) -> Self {
        let (mut ranges, mut at, mut at_other) = (Vec::new(), 0, 0);
        while let (Some(a), Some(b)) = (self.ranges.get(at), other.ranges.get(at_other)) {
            ranges.push(a.start.max(b.start)..a.end.min(b.end));
            if a.end < b.end { at += 1 } else { at_other += 1 }
        }
        Self::of_ranges(ranges)
    }

    /// The values in either set.
    pub fn union(&self, other: &Self) -> Self {
        Self::of_ranges([self.ranges.clone(), other.ranges.clone()].concat())
    }

    /// The values in any of several sets, whose ranges are sorted once.
    pub fn union_of(sets: impl IntoIterator<Item = Self>) -> Self {
        Self::of_ranges(sets.into_iter().flat_map(|set| set.ranges).collect())
    }

    /// The values in exactly one of the two sets.
    pub fn symmetric_difference(&self, other: &Self) -> Self {
        // The rest of both between their common parts.
        let common = self.intersection(other);
        let starts = common.ranges.iter().map(|range| range.end);
        let ends = common.ranges.iter().map(|range| range.start);
        let gaps = std::iter::once(0).chain(starts).zip(ends.chain(std::iter::once(END)));
        self.union(other).intersection(&Self::of_ranges(gaps.map(|(start, end)| start..end).collect()))
    }

    /// The ranges of ordinals.
    pub fn ranges(&self) -> &[Range<u32>] {
        &self.ranges
    }

    /// Whether any value from `min` to `max` is in the set.
    pub fn meets(&self, min: f32, max: f32) -> bool {
        let (first, last) = (ordinal(min), ordinal(max));
        self.ends_behind(first).is_some_and(|range| range.start <= last)
    }

    /// The first range that ends behind an ordinal.
    fn ends_behind(&self, ordinal: u32) -> Option<&Range<u32>> {
        self.ranges.get(self.ranges.partition_point(|range| range.end <= ordinal))
    }

    /// Whether a value is in the set.
    pub fn contains(&self, value: f32) -> bool {
        let at = ordinal(value);
        self.ends_behind(at).is_some_and(|range| range.start <= at)
    }

    /// Sets the flags of those of as many values that are in the set.
    pub fn flag(&self, values: ValueSlice, flags: &mut [bool]) {
        /// The most ranges for which comparing all values with each is faster than a search for each value.
        const FEW: usize = 8;
        if self.ranges.len() > FEW {
            return values.flag(flags, |value| self.contains(value));
        }
        for range in &self.ranges {
            let (start, length) = (range.start, range.end - range.start);
            values.flag(flags, |value| ordinal(value).wrapping_sub(start) < length);
        }
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use std::collections::BTreeMap;

    use glam::DVec3;

    use super::*;

    fn transfer(opacity: &[(f64, f64)], iso_ranges: Option<&[[f64; 2]]>) -> TransferFunction {
        TransferFunction {
            color: Ramp::new(vec![(0.0, DVec3::ONE)]).unwrap(),
            opacity: Ramp::new(opacity.to_vec()).unwrap(),
            gradient_opacity: None,
            membership: false,
            iso_ranges: iso_ranges.map(<[[f64; 2]]>::to_vec),
            labels: BTreeMap::new(),
        }
    }

    #[test]
    fn ordinals_order_as_values_do() {
        let values = [f32::MIN, -1.0, -f32::from_bits(1), 0.0, f32::from_bits(1), 1.0, 1.0_f32.next_up(), f32::MAX];
        assert!(values.map(ordinal).is_sorted_by(|a, b| a < b));
        assert_eq!(ordinal(-0.0), ordinal(0.0));
        assert_eq!(values.map(ordinal).map(of_ordinal), values);
        assert_eq!([ordinal(f32::MAX) + 1, ordinal(f32::INFINITY)], [END; 2]);
        assert!(ordinal(f32::NAN) > END);
    }

    /// By pairs of ranges these would take 80 GB.
    #[test]
    fn sets_of_many_ranges_are_walked_through_once() {
        let ranges = |offset: f64| (0..100_000).map(move |at| [f64::from(at) + offset, f64::from(at) + offset + 0.25]);
        let set = |offset: f64| ValueSet::of(&transfer(&[(0.0, 1.0)], Some(&ranges(offset).collect::<Vec<_>>())));
        let [a, b] = [0.0, 0.125].map(set);
        let (difference, union) = (a.symmetric_difference(&b), ValueSet::union_of([a.clone(), b]));
        assert_eq!((difference.ranges().len(), union.ranges().len()), (200_000, 100_000));
        let middle = |share: f32| 50_000.0 + share;
        assert_eq!([0.0, 0.2, 0.3, 0.5].map(|share| union.contains(middle(share))), [true, true, true, false]);
        assert_eq!([0.0, 0.2, 0.3, 0.5].map(|share| difference.contains(middle(share))), [true, false, true, false]);
        assert!(a.meets(middle(0.3), middle(1.0)) && !a.meets(middle(0.3), middle(0.9)));
        let values: Vec<f32> = (0..1000).map(|at| 70_000.0 + at as f32 / 16.0).collect();
        let mut flags = vec![false; values.len()];
        a.flag((&values).into(), &mut flags);
        assert!(
            values.iter().zip(flags).all(|(&value, flag)| flag == a.contains(value) && flag == (value.fract() <= 0.25))
        );
    }

    #[test]
    fn a_value_is_in_the_set_where_it_has_an_opacity() {
        let cases = [
            transfer(&[(10.0, 0.0), (20.0, 0.5)], None),
            transfer(&[(10.0, 0.4), (20.0, 0.0), (30.0, 0.0), (40.0, 1.0), (50.0, 0.0)], None),
            transfer(&[(0.1, 0.0), (0.3, 1.0), (0.7, 0.0)], Some(&[[0.2, 0.2], [0.25, 0.5]])),
            transfer(&[(0.0, 1.0)], Some(&[[-1.0, 0.0], [5.0, 60.0], [50.0, 70.0]])),
            transfer(&[(0.0, 0.0)], None),
        ];
        let sets = cases.each_ref().map(ValueSet::of);
        let around = |x: f64| [(x as f32).next_down(), x as f32, (x as f32).next_up()];
        let spots = [
            -1e30, -1.0, 0.0, 0.1, 0.15, 0.2, 0.25, 0.3, 0.5, 0.7, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 40.0, 50.0, 60.0,
            70.0, 1e30,
        ];
        assert!(sets.iter().all(|set| !set.contains(f32::NAN)), "a hole has no value");
        for value in spots.into_iter().flat_map(around) {
            let expected = cases.each_ref().map(|transfer| transfer.alpha(f64::from(value), 0.0) > 0.0);
            assert_eq!(sets.each_ref().map(|set| set.contains(value)), expected, "{value:?}");
            for (a, in_a) in sets.iter().zip(expected) {
                for (b, in_b) in sets.iter().zip(expected) {
                    assert_eq!(a.symmetric_difference(b).contains(value), in_a != in_b, "{value:?}");
                    assert_eq!(a.union(b).contains(value), in_a || in_b, "{value:?}");
                }
            }
        }
    }
}
