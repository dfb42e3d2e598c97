//! Shading settings (SPEC §3). `shaders/shade.wgsl` computes the shading, `reference::shading` in f64.

use glam::DVec3;

use crate::error::setting::{Interval, SettingError, check_direction};

/// Gradients shorter than this (value per world unit) have no direction (SPEC §3).
pub const MIN_GRADIENT: f64 = 1e-12;

/// The direction of the light.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Light {
    /// From the eye.
    Headlight,
    /// From a fixed world direction that points to the light, of any length except 0.
    Direction(DVec3),
}

/// The gradient from which [`Classification::After`](super::Classification::After) takes normals.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Gradient {
    /// The voxels' central differences, interpolated like the values.
    Differences,
    /// The derivative of the reconstructed field, which is sharper but shows a scan's noise.
    Kernel,
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
    /// The gradient that is used; without effect for [`Classification::Before`](super::Classification::Before).
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
            gradient: Gradient::Differences,
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
            Light::Headlight => Ok(()),
            Light::Direction(direction) => check_direction("shading.light", direction),
        }
    }
}
