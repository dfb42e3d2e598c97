//! The preset that fits a volume, where a scene states nothing about its appearance.

use crate::appearance::Preset;
use crate::settings::clip::Clip;
use crate::settings::shading::Shading;
use crate::settings::splatting::Splatting;

/// The choice of the preset that fits the volume ([`Preset::suggested`]), for a scene without a transfer function: these settings, as long as they have
/// their defaults, besides colours and opacities. Others than the defaults count as stated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fitting {
    /// Whether there is such a choice at all: the scene names no preset.
    pub is_open: bool,
    /// [`Shading::enabled`].
    pub enabled: bool,
    /// [`Shading::ambient`].
    pub ambient: bool,
    /// [`Shading::diffuse`].
    pub diffuse: bool,
    /// [`Shading::specular`].
    pub specular: bool,
    /// [`Shading::shininess`].
    pub shininess: bool,
    /// [`Splatting::compositing`].
    pub compositing: bool,
    /// [`Clip::shade_faces`].
    pub shade_faces: bool,
}

impl Fitting {
    /// A scene states everything, or names a preset.
    pub const NONE: Self = Self::all(false);

    /// A scene states nothing.
    pub const ALL: Self = Self::all(true);

    const fn all(is: bool) -> Self {
        Self {
            is_open: is,
            enabled: is,
            ambient: is,
            diffuse: is,
            specular: is,
            shininess: is,
            compositing: is,
            shade_faces: is,
        }
    }

    /// The shading, with a preset's where it is open.
    pub(super) fn shading(self, stated: Shading, preset: Preset) -> Shading {
        let (of_preset, default) = (preset.shading(), Shading::default());
        let number = |is_open: bool, of: fn(&Shading) -> f64| {
            of(if is_open && of(&stated) == of(&default) { &of_preset } else { &stated })
        };
        Shading {
            enabled: if self.enabled && stated.enabled { of_preset.enabled } else { stated.enabled },
            ambient: number(self.ambient, |shading| shading.ambient),
            diffuse: number(self.diffuse, |shading| shading.diffuse),
            specular: number(self.specular, |shading| shading.specular),
            shininess: number(self.shininess, |shading| shading.shininess),
            ..stated
        }
    }

    /// The cuts, with a preset's shading of their faces where it is open.
    pub(super) fn clip(self, stated: Clip, preset: Preset) -> Clip {
        let shade_faces = stated.shade_faces && (!self.shade_faces || preset.clip().shade_faces);
        Clip { shade_faces, ..stated }
    }

    /// The splatting settings, with a preset's compositing where it is open.
    pub(super) fn splatting(self, stated: Splatting, preset: Preset) -> Splatting {
        let is_open = self.compositing && stated.compositing == Splatting::default().compositing;
        Splatting { compositing: if is_open { preset.compositing() } else { stated.compositing }, ..stated }
    }
}
