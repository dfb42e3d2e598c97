//! Ranges of values: their minimum and maximum.

/// The range of no values.
pub(crate) const EMPTY: [f32; 2] = [f32::INFINITY, f32::NEG_INFINITY];

/// The range of two ranges' values; NaN is ignored.
pub(crate) fn union([min, max]: [f32; 2], [other_min, other_max]: [f32; 2]) -> [f32; 2] {
    [min.min(other_min), max.max(other_max)]
}

/// The range of some values; NaN is ignored. `None` if all are NaN.
pub(crate) fn range_of(values: impl Iterator<Item = f32>) -> Option<[f32; 2]> {
    let range = values.fold(EMPTY, |range, value| union(range, [value; 2]));
    (range[0] <= range[1]).then_some(range)
}
