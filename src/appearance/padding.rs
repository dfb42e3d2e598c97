//! What CT scanners write around the cylinder that they see.

use rayon::prelude::*;

/// Air, in Hounsfield units.
pub(super) const AIR: f64 = -1000.0;

/// Whether a volume has Hounsfield units and around the scanned cylinder a value far below that of air, as many scanners write it.
pub(super) fn is_padded(values: &[f32], least: f32) -> bool {
    let near_air = |value: &&f32| (f64::from(**value) - AIR).abs() < 124.0;
    let finite = || values.par_iter().filter(|value| !value.is_nan());
    // At least one value in 50.
    f64::from(least) < -1100.0 && finite().filter(near_air).count() >= finite().count() / 50
}
