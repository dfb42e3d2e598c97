//! Shading settings (SPEC §3). `shaders/shade.wgsl` computes the shading, `reference::shading` in f64.

use glam::DVec3;

use super::camera::ViewBasis;
use crate::error::setting::{Interval, SettingError, check_direction, scaled};

/// Gradients shorter than this (value per world unit) have no direction (SPEC §3).
pub const MIN_GRADIENT: f64 = 1e-12;

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

/// The gradient from which normals are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Gradient {
    /// [`Self::Membership`] for channels that are label maps and [classified before splatting](super::Classification::Before), for others
    /// [`Self::Differences`].
    Auto,
    /// The voxels' central differences, interpolated like the values.
    Differences,
    /// The derivative of the reconstructed field, which is sharper but shows a scan's noise. Classified before splatting, as [`Self::Differences`].
    Kernel,
    /// That of the membership of a voxel's label, smoothed (SPEC §15), in channels that are label maps; as [`Self::Differences`] in others. Not for
    /// [`Classification::After`](super::Classification::After).
    Membership,
}

/// The cap of ambient, diffuse, specular and shininess, beyond which images no longer change. It avoids infinities in `f32`.
#[cfg(any(feature = "cpu", feature = "gpu"))]
pub(crate) const MAX_SHADING: f64 = 1e30;

/// Two-sided Phong shading with white highlights, computed in the unwarped space (§4.2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shading {
    /// Whether voxels are shaded; otherwise they keep their transfer function's colour.
    pub enabled: bool,
    /// The fraction of the colour that needs no light, at least 0.
    pub ambient: f64,
    /// The weight of the diffuse term, at least 0.
    pub diffuse: f64,
    /// The weight of the highlight, at least 0.
    pub specular: f64,
    /// The exponent of the highlight, above 0.
    pub shininess: f64,
    /// The direction of the light.
    pub light: Light,
    /// The gradient that is used.
    pub gradient: Gradient,
}

impl Default for Shading {
    fn default() -> Self {
        Self {
            enabled: true,
            ambient: 0.2,
            diffuse: 0.7,
            specular: 0.2,
            shininess: 20.0,
            light: Light::Headlight,
            gradient: Gradient::Auto,
        }
    }
}

impl Shading {
    /// Checks that the values are in range.
    ///
    /// # Errors
    /// If a number is not finite or out of its range, or the light's direction is 0.
    pub fn check(&self) -> Result<(), SettingError> {
        let Self { enabled: _, ambient, diffuse, specular, shininess, light, gradient: _ } = *self;
        Interval::NOT_NEGATIVE.check("shading.ambient", ambient)?;
        Interval::NOT_NEGATIVE.check("shading.diffuse", diffuse)?;
        Interval::NOT_NEGATIVE.check("shading.specular", specular)?;
        Interval::POSITIVE.check("shading.shininess", shininess)?;
        match light {
            Light::Headlight | Light::UpperLeft => Ok(()),
            Light::Direction(direction) => check_direction("shading.light", direction),
        }
    }
}
