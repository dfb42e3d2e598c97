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
        // A filter's undershoot is no unit.
        let [least, greatest] = quantiles(values, |_| true, [0.001, 1.0]).unwrap_or_default().map(f64::from);
        if least < SIGNED_BELOW {
            return Self { water: 0.0, per_unit: 1.0 };
        }
        if UNSIGNED_GREATEST.contains(&greatest) {
            return Self { water: OFFSET, per_unit: 1.0 };
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
