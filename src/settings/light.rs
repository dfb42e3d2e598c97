//! Where light comes from (SPEC §3).

use glam::DVec3;

use super::camera::ViewBasis;
use crate::error::setting::scaled;

/// The direction of the light.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Light {
    /// From the eye.
    Headlight,
    /// From the viewer's upper left: `normalize(-w - u/2 + v/2)` of the camera's axes.
    UpperLeft,
    /// From a fixed world direction that points to the light, of any length except 0.
    Direction(DVec3),
}

impl Light {
    /// The unit vector to the light, for a camera's axes; `None` for a headlight, which in perspective is another for every point.
    pub(crate) fn direction(&self, basis: &ViewBasis) -> Option<DVec3> {
        match *self {
            Self::Headlight => None,
            Self::UpperLeft => Some((-basis.w - basis.u / 2.0 + basis.v / 2.0).normalize()),
            Self::Direction(direction) => Some(scaled(direction).normalize()),
        }
    }
}
