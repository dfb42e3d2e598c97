//! The scale bar, which has a round length.

use super::canvas::empty;
use super::kind::refused;
use super::round::{round_down, written};
use super::style::Style;
use super::text;
use crate::SettingError;
use crate::image::Image;
use crate::scene::Scene;
use crate::settings::Projection;
use crate::volume::Volume;

/// The bar's thickness in heights of the font; its maximum length, a fraction of the picture's width.
const THICKNESS: f32 = 0.2;
const SHARE: f64 = 0.25;

/// Checks that the camera is orthographic: in perspective, a length on the screen is a length in the volume on one plane only, and the image
/// does not show which parts lie there.
pub(super) fn check(scene: &Scene) -> Result<(), SettingError> {
    match scene.camera.projection {
        Projection::Orthographic { .. } => Ok(()),
        Projection::Perspective { .. } => {
            Err(refused("scale", "camera.projection = \"perspective\"", "\"orthographic\""))
        }
    }
}

/// The height of the bar with its label in pixels.
pub(super) fn height(style: &Style) -> u32 {
    style.line() + style.pixels(THICKNESS)
}

/// The bar for a picture of a scene that states its camera, at most `room` pixels wide; `None` for a camera in perspective.
pub(super) fn plate(scene: &Scene, volume: &Volume, style: &Style, room: u32) -> Option<Image> {
    let [width, rows] = [scene.image.width, scene.image.height];
    let shown = scene.camera.orthographic_height(volume.grid(), scene.splatting.radius, width, rows)?;
    let pixel = shown / f64::from(rows);
    let length = round_down((SHARE * f64::from(width)).max(1.0) * pixel);
    let bar = ((length / pixel).round() as u32).clamp(1, room.max(1));
    let unit = volume.unit().unwrap_or(if length == 1.0 { "unit" } else { "units" });
    let label = text::fitted(&format!("{} {unit}", written(length, length)), style.em, room);
    let words = style.width(&label);
    let inner = bar.max(words);
    let mut plate = empty([inner, height(style)]);
    style.write(&mut plate, [(inner - words) / 2, 0], &label);
    style.rule(&mut plate, [(inner - bar) / 2, style.line()], [bar, style.pixels(THICKNESS)]);
    Some(plate)
}
