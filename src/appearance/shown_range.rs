//! The values that a volume shows.

use super::quantiles;
use crate::lists::iso_range::ValueSet;
use crate::settings::transfer_function::TransferFunction;
use crate::volume::Volume;

/// The range of values that a volume shows under a transfer function: the 0.5 % and 99.5 % quantiles of those with an opacity above 0 in
/// an iso-range, so that outliers do not use up most of a colour map. `None` if nothing shows. Tables of labels are ignored.
pub fn shown_range(volume: &Volume, transfer: &TransferFunction) -> Option<[f64; 2]> {
    const TAIL: f64 = 0.005;
    let shown = ValueSet::of(transfer);
    let ends = quantiles(volume.values(), |value| shown.contains(value), [TAIL, 1.0 - TAIL]);
    ends.map(|ends| ends.map(f64::from))
}
