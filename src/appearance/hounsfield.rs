//! The relation between a CT volume's values and Hounsfield units.

use super::object::Object;
use super::padding::AIR;
use super::quantile::quantiles;
use crate::volume::ValueSlice;

/// The offset of Hounsfield units that are stored as unsigned numbers.
const OFFSET: f64 = 1024.0;

/// Volumes with values below this hold Hounsfield units.
const SIGNED_BELOW: f64 = -100.0;

/// The range of maxima of unsigned 12-bit scanners, with room for metal. Larger values have been scaled.
const UNSIGNED_GREATEST: std::ops::RangeInclusive<f64> = 1500.0..=8191.0;

/// The offset of values that may be Hounsfield units: 0 if one in a thousand is below -100, or else 1024 if the maximum lies within 1500
/// to 8191.
pub(super) fn offset_of(values: ValueSlice<'_>) -> Option<f64> {
    // A quantile is used because a filter's undershoot may lie below the units.
    let [least, greatest] = quantiles(values, |_| true, [0.001, 1.0]).unwrap_or_default().map(f64::from);
    match least < SIGNED_BELOW {
        true => Some(0.0),
        false => UNSIGNED_GREATEST.contains(&greatest).then_some(OFFSET),
    }
}

/// Values as a linear function of Hounsfield units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Hounsfield {
    /// The value at 0 units, water.
    water: f64,
    /// The value's increase per unit, above 0.
    per_unit: f64,
}

impl Hounsfield {
    /// Values with an offset (see [`offset_of`]), or else a fit: the background is assumed to be air (-1000), and the object's faintest
    /// eighth water (0).
    pub(super) fn of(values: ValueSlice<'_>) -> Self {
        if let Some(water) = offset_of(values) {
            return Self { water, per_unit: 1.0 };
        }
        match Object::find(values) {
            Some(Object { background, faint, .. }) => Self { water: faint, per_unit: (faint - background) / -AIR },
            None => Self { water: 0.0, per_unit: 1.0 },
        }
    }

    /// The value at a number of units.
    pub(super) fn value(&self, units: f64) -> f64 {
        self.water + self.per_unit * units
    }
}
