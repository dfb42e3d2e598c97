//! Shading settings (SPEC §3). `shaders/shade.wgsl` computes the shading, `reference::shading` in f64.

use super::key::Keyed;
use super::light::Light;
use crate::error::setting::SettingError;

/// Gradients shorter than this (value per world unit) have no direction (SPEC §3).
pub const MIN_GRADIENT: f64 = 1e-12;

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
    /// How much of the ambient light matter keeps off that lies in front, in [0, 1] (SPEC §14).
    pub occlusion: f64,
    /// The variance, in `unit`s² per `unit` of its way, by which light spreads for [`Self::occlusion`], in [0, 64].
    pub occlusion_spread: f64,
    /// How much of the diffuse and specular light matter keeps off that lies towards the light, in [0, 1].
    pub shadow: f64,
    /// As [`Self::occlusion_spread`], for [`Self::shadow`]: the softness of shadows, in [0, 64].
    pub shadow_spread: f64,
    /// The distance of light sheets and the size of their pixels, in `unit`s, in [0.5, 16].
    pub light_step: f64,
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
            occlusion: 0.0,
            occlusion_spread: 8.0,
            shadow: 0.0,
            shadow_spread: 0.5,
            light_step: 2.0,
        }
    }
}

impl Shading {
    /// Checks that the values are in range.
    ///
    /// # Errors
    /// If a number is not finite or out of its range, or the light's direction is 0.
    pub fn check(&self) -> Result<(), SettingError> {
        self.check_keys("shading")
    }

    /// The key that asks for light sheets (SPEC §14), if one does and voxels are shaded.
    pub(crate) fn light_key(&self) -> Option<&'static str> {
        self.stated_light().filter(|_| self.enabled)
    }

    /// The key of light sheets that has no effect, and why: voxels are not shaded, or a spread has no amount.
    pub(crate) fn idle_light(&self) -> Option<(&'static str, &'static str)> {
        let default = Self::default();
        if let Some(key) = self.stated_light().filter(|_| !self.enabled) {
            return Some((key, "shading.enabled = false"));
        }
        if self.occlusion == 0.0 && self.occlusion_spread != default.occlusion_spread {
            return Some(("shading.occlusion_spread", "shading.occlusion = 0"));
        }
        if self.shadow == 0.0 && self.shadow_spread != default.shadow_spread {
            return Some(("shading.shadow_spread", "shading.shadow = 0"));
        }
        let is_idle = self.stated_light().is_none() && self.light_step != default.light_step;
        is_idle.then_some(("shading.light_step", "shading.occlusion = 0 and shading.shadow = 0"))
    }

    fn stated_light(&self) -> Option<&'static str> {
        if self.occlusion > 0.0 {
            return Some("shading.occlusion");
        }
        (self.shadow > 0.0).then_some("shading.shadow")
    }
}
