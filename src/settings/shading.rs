//! Shading settings (SPEC §3). The arithmetic itself is `shaders/shade.wgsl`, its twin `reference::shading`.

use glam::DVec3;

use crate::setting_error::{Interval, SettingError, check_direction};

/// Below this length (value per world unit) a gradient has no direction (SPEC §3).
pub const MIN_GRADIENT: f64 = 1e-12;

/// Where the light comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Light {
    /// From the eye.
    Headlight,
    /// From a fixed world direction, pointing to the light; any length but 0.
    Direction(DVec3),
}

/// Which gradient the normals are of for [`Classification::After`](super::Classification::After).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Gradient {
    /// The voxels' central differences, interpolated like the values.
    Differences,
    /// The derivative of the reconstructed field: sharper, but it shows the noise of a scan.
    Kernel,
}

/// Two-sided Phong shading with white highlights, computed in the unwarped space (§4.2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shading {
    /// Without shading a voxel keeps its transfer function colour.
    pub enabled: bool,
    /// Share of the colour that needs no light, at least 0.
    pub ambient: f64,
    /// Weight of the diffuse term, at least 0.
    pub diffuse: f64,
    /// Weight of the highlight, at least 0.
    pub specular: f64,
    /// Exponent of the highlight, above 0.
    pub shininess: f64,
    /// Where the light comes from.
    pub light: Light,
    /// Which gradient is used; without effect for [`Classification::Before`](super::Classification::Before).
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
    /// Checks what types do not say.
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
