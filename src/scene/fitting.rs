//! The preset that fits a volume, where a scene states nothing about its appearance.

use crate::appearance::Preset;
use crate::settings::key::{Key, Keyed};
use crate::settings::shading::Shading;
use crate::volume::{Grid, Volume, builtin};

/// The pixels along a side of light sheets that a preset takes at most, unless the volume has more at the greatest step.
const MOST_PIXELS: f64 = 257.0;

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
    /// [`Shading::light`].
    pub light: bool,
    /// [`Shading::occlusion`].
    pub occlusion: bool,
    /// [`Shading::shadow`].
    pub shadow: bool,
    /// [`Shading::light_step`], which depends on the volume's size where a preset lights it, also one that the scene names.
    pub light_step: bool,
    /// [`Splatting::compositing`](crate::settings::Splatting::compositing).
    pub compositing: bool,
    /// [`Clip::shade_faces`](crate::settings::Clip::shade_faces).
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
            light: is,
            occlusion: is,
            shadow: is,
            light_step: is,
            compositing: is,
            shade_faces: is,
        }
    }

    /// The settings by their keys, which only one table has.
    pub(super) fn keys(&mut self) -> [(&'static str, &mut bool); 11] {
        [
            ("enabled", &mut self.enabled),
            ("ambient", &mut self.ambient),
            ("diffuse", &mut self.diffuse),
            ("specular", &mut self.specular),
            ("shininess", &mut self.shininess),
            ("light", &mut self.light),
            ("occlusion", &mut self.occlusion),
            ("shadow", &mut self.shadow),
            ("light_step", &mut self.light_step),
            ("compositing", &mut self.compositing),
            ("shade_faces", &mut self.shade_faces),
        ]
    }

    /// Whether a key is left to a preset.
    pub(super) fn leaves(mut self, key: &str) -> bool {
        self.keys().iter().any(|(name, is_open)| *name == key && **is_open)
    }

    /// Settings, with a preset's where they are left to it.
    pub(super) fn fitted<T: Keyed>(self, mut stated: T, mut of_preset: T) -> T {
        let mut default = T::default();
        for Key { slot, .. } in T::KEYS.iter().filter(|key| self.leaves(key.name)) {
            slot(&mut stated).fit(slot(&mut default), slot(&mut of_preset));
        }
        stated
    }

    /// The step of light sheets on a grid, where it is open and a preset lights the volume: the stated one, doubled until sheets have at most
    /// [`MOST_PIXELS`] along a side, so that large volumes take neither much memory nor long frames.
    pub(super) fn light_step(self, stated: &Shading, (preset, radius): (Preset, f64), grid: &Grid) -> f64 {
        let step = stated.light_step;
        let is_open = self.light_step && step == Shading::default().light_step;
        if !is_open || preset.shading().light_key().is_none() {
            return step;
        }
        let is_small = |step: &f64| 2.0 * (grid.bounding_radius(radius) / grid.unit() / step).ceil() < MOST_PIXELS;
        [1.0, 2.0, 4.0].map(|factor| factor * step).into_iter().find(is_small).unwrap_or(8.0 * step)
    }
}

/// Whether a volume is the builtin head, of any size: it comes from no file, and its labels have the names of the head's.
pub(super) fn is_builtin_head(volume: &Volume) -> bool {
    let (names, head) = (volume.label_names(), builtin::labels("head").unwrap_or_default());
    let is_named = |(label, name): &(u16, &str)| names.get(label).is_some_and(|named| named == name);
    volume.encoding().is_none() && names.len() == head.len() && head.iter().all(is_named)
}
