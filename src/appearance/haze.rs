//! The appearance of constant volumes.

use glam::DVec3;

use crate::settings::transfer_function::{Ramp, TransferFunction};

/// A grey haze, for constant volumes.
pub(super) fn constant(opacity: f64) -> TransferFunction {
    TransferFunction::by_value(Ramp::through(vec![(0.0, DVec3::splat(0.7))]), Ramp::through(vec![(0.0, opacity)]))
}
