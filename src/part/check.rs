//! Whether a scene has parts, and a window is one.

use std::ops::Range;

use crate::error::setting::SettingError;
use crate::image::channels::Joining;
use crate::scene::Scene;
use crate::settings::splatting::Method;
use crate::settings::window::Window;
use crate::volume::Volume;

/// The most images that are added up.
pub(super) const MAX_IMAGES: usize = 256;

/// Whether each of a volume's channels has an image of its own, and these are added up. Of surfaces the nearest is shown, which is also that of the nearest
/// part that has one, so that their parts are of one image.
pub(crate) fn adds_up(volume: &Volume, scene: &Scene) -> bool {
    let (count, compositing) = (volume.channel_count(), scene.splatting.compositing);
    Joining::of_channels(count, compositing, scene.classification(volume)) == Some(Joining::Sum)
}

/// Checks that a renderer, which draws all channels at once, can draw parts of a scene.
///
/// # Errors
/// If channels share no sheets.
#[cfg(any(feature = "cpu", feature = "gpu"))]
pub(crate) fn check_sheets(volume: &Volume, scene: &Scene) -> Result<(), SettingError> {
    if !adds_up(volume, scene) {
        return Ok(());
    }
    let compositing = crate::settings::keys::name_of(crate::settings::keys::COMPOSITINGS, scene.splatting.compositing);
    let found = format!("\"{compositing}\" of several channels for a part of an image");
    Err(SettingError::new(
        "splatting.compositing",
        found,
        "\"linear\", \"exponential\" or \"xray\", or Headless::draw_part",
    ))
}

/// Checks, before anything is drawn, that a scene has parts, and that a window is one.
///
/// # Errors
/// If the scene's method is not image-aligned, an economy is in use, its compositing has no parts, or the window does not lie in the image.
pub(crate) fn check(volume: &Volume, scene: &Scene, window: &Window) -> Result<(), SettingError> {
    let splatting = &scene.splatting;
    let channels = volume.channel_count();
    if adds_up(volume, scene) && channels > MAX_IMAGES {
        let found = format!("{channels} channels whose images are added up for a part of an image");
        return Err(SettingError::new("volume", found, format!("at most {MAX_IMAGES}")));
    }
    if splatting.method != Method::ImageAligned {
        let method = crate::settings::keys::name_of(crate::settings::keys::METHODS, splatting.method);
        let found = format!("\"{method}\" for a part of an image");
        return Err(SettingError::new("splatting.method", found, "\"image-aligned\""));
    }
    if let Some(economy) = splatting.experimental.in_use() {
        let found = format!("{} for a part of an image", economy.value);
        return Err(SettingError::new(economy.key, found, economy.off.to_string()));
    }
    let Range { start, end } = window.slabs;
    if start > end {
        return Err(SettingError::new("slabs", format!("{start}..{end}"), "A..B, A at most B"));
    }
    window.region.check([scene.image.width, scene.image.height])
}
