//! The padding that CT scanners write outside the scanned cylinder.

use crate::volume::ValueSlice;

/// Air in Hounsfield units.
pub(super) const AIR: f64 = -1000.0;

/// Whether a volume holds Hounsfield units and has a value far below air's outside the scanned cylinder, as many scanners write.
pub(super) fn is_padded(values: ValueSlice<'_>, least: f32) -> bool {
    let near_air = |value: &f32| (f64::from(*value) - AIR).abs() < 124.0;
    let finite = || values.par_iter().filter(|value| !value.is_nan());
    // At least one value in 50 must be air.
    f64::from(least) < -1100.0 && finite().filter(near_air).count() >= finite().count() / 50
}
