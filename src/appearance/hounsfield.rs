//! Which values of a CT volume are which Hounsfield units.

use super::object::Object;
use super::padding::AIR;
use super::quantile::quantiles;

/// What is added to Hounsfield units where they are kept as unsigned numbers.
const OFFSET: f64 = 1024.0;

/// Volumes with values below this have Hounsfield units.
const SIGNED_BELOW: f64 = -100.0;

/// The greatest values of unsigned 12-bit scanners, with room for metal; beyond, values have been scaled.
const UNSIGNED_GREATEST: std::ops::RangeInclusive<f64> = 1500.0..=8191.0;

/// What is added to values that may be Hounsfield units: 0 where one in a thousand is below -100; else 1024 where the greatest lies within
/// 1500 to 8191.
pub(super) fn offset_of(values: &[f32]) -> Option<f64> {
    // A filter's undershoot is no unit.
    let [least, greatest] = quantiles(values, |_| true, [0.001, 1.0]).unwrap_or_default().map(f64::from);
    match least < SIGNED_BELOW {
        true => Some(0.0),
        false => UNSIGNED_GREATEST.contains(&greatest).then_some(OFFSET),
    }
}

/// Values over Hounsfield units, a straight line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Hounsfield {
    /// The value at 0 units, water.
    water: f64,
    /// What one unit more adds, above 0.
    per_unit: f64,
}

impl Hounsfield {
    /// Units as they are where one value in a thousand is below -100; else stored with 1024 added where the greatest lies within 1500
    /// to 8191. For all else what is around the object is taken for air (-1000), and the object's faintest eighth for water (0).
    pub(super) fn of(values: &[f32]) -> Self {
        if let Some(water) = offset_of(values) {
            return Self { water, per_unit: 1.0 };
        }
        match Object::find(values) {
            Some(Object { background, faint, .. }) => Self { water: faint, per_unit: (faint - background) / -AIR },
            None => Self { water: 0.0, per_unit: 1.0 },
        }
    }

    /// The value of a number of units.
    pub(super) fn value(&self, units: f64) -> f64 {
        self.water + self.per_unit * units
    }
}
