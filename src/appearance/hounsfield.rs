//! Which values of a CT volume are which Hounsfield units.

use rayon::prelude::*;

use super::object::Object;
use super::quantile::quantile;

/// Air, in Hounsfield units.
pub(super) const AIR: f64 = -1000.0;

/// What is added to Hounsfield units where they are kept as unsigned numbers.
const OFFSET: f64 = 1024.0;

/// A volume with values below this has Hounsfield units.
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
    /// Units as they are where a value is below -100; stored with 1024 added where the least value is not and the greatest lies within
    /// 1500 to 8191. For all else what is around the object is taken for air (-1000), and the object's faintest eighth for water (0).
    pub(super) fn of(values: &[f32]) -> Self {
        let [least, greatest] = [0.0, 1.0].map(|share| quantile(values, |_| true, share).map_or(0.0, f64::from));
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

/// Whether a volume has Hounsfield units and around the scanned cylinder a value far below that of air, as many scanners write it.
pub(super) fn is_padded(values: &[f32], least: f32) -> bool {
    let near_air = |value: &&f32| (f64::from(**value) - AIR).abs() < 124.0;
    // At least one value in 50.
    f64::from(least) < -1100.0 && values.par_iter().filter(near_air).count() >= values.len() / 50
}
