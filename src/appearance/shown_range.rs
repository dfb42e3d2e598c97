//! The values that a volume shows.

use super::quantiles;
use crate::lists::iso_range::ValueSet;
use crate::settings::transfer_function::TransferFunction;
use crate::volume::Volume;

/// The range of values that a volume shows under a transfer function: the 0.5 % and 99.5 % quantiles of those with an opacity above 0 in
/// an iso-range, so that outliers do not use up most of a colour map. An end is no farther from the other one than three times the quartile on its
/// side: few voxels of most values are much brighter than the rest, such as the middles of beads. `None` if nothing shows. Tables of labels are ignored.
pub fn shown_range(volume: &Volume, transfer: &TransferFunction) -> Option<[f64; 2]> {
    const TAIL: f64 = 0.005;
    const QUARTILE: f64 = 0.25;
    let shown = ValueSet::of(transfer);
    let shares = [TAIL, QUARTILE, 1.0 - QUARTILE, 1.0 - TAIL];
    let ends = quantiles(volume.values(), |value| shown.contains(value), shares);
    ends.map(|ends| within_fences(ends.map(f64::from)))
}

/// The ends without what lies beyond three times the distance of the quartile on their side from the opposite end.
fn within_fences([low, lower, upper, high]: [f64; 4]) -> [f64; 2] {
    const FENCE: f64 = 3.0;
    // Where three quarters of the values are one value, the quartile tells nothing about the others. Products before the difference stay finite.
    let beyond = |end: f64, quartile: f64| FENCE * quartile - (FENCE - 1.0) * end;
    let top = if upper > low { high.min(beyond(low, upper)) } else { high };
    let bottom = if lower < high { low.max(beyond(high, lower)) } else { low };
    [bottom, top]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_extreme_values_do_not_widen_the_range() {
        assert_eq!(within_fences([0.0, 25.0, 75.0, 100.0]), [0.0, 100.0]);
        // Beads: most of a bead is dim.
        assert_eq!(within_fences([8.0, 10.0, 29.0, 128.0]), [8.0, 71.0]);
        assert_eq!(within_fences([-128.0, -29.0, -10.0, -8.0]), [-71.0, -8.0]);
        // Most values are one.
        assert_eq!(within_fences([3.0, 3.0, 3.0, 128.0]), [3.0, 128.0]);
        assert_eq!(within_fences([-9.0, 4.0, 4.0, 4.0]), [-9.0, 4.0]);
        assert_eq!(within_fences([5.0; 4]), [5.0, 5.0]);
        let most = f64::from(f32::MAX);
        assert_eq!(within_fences([-most, -most, most, most]), [-most, most]);
    }
}
