//! The scale bar, which has a round length.

use sheetsplat::image::Image;
use sheetsplat::scene::Scene;
use sheetsplat::volume::Volume;

use super::plate::{PADDING, plate_for};
use super::round::{round_down, written};
use crate::canvas::{LINE, rule, text_width, write};
use crate::failure::Failure;

/// The bar's thickness in pixels; its maximum length, a fraction of the image's width, follows.
const THICKNESS: u32 = 3;
const SHARE: f64 = 0.25;

/// The bar, for orthographic cameras only: in perspective, a length on the screen is a length in the volume on one plane only, and the
/// image does not show which parts lie there.
pub(super) fn plate(scene: &Scene, volume: &Volume) -> Result<Image, Failure> {
    let [width, height] = [scene.image.width, scene.image.height];
    let Some(shown) = scene.camera.orthographic_height(volume.grid(), scene.splatting.radius, width, height) else {
        let found = "camera.projection = \"perspective\"";
        return Err(Failure::Input(format!("--annotate: scale: found {found}, allowed: \"orthographic\"")));
    };
    let pixel = shown / f64::from(height);
    let length = round_down((SHARE * f64::from(width)).max(1.0) * pixel);
    let bar = ((length / pixel).round() as u32).max(1);
    let unit = volume.unit().unwrap_or(if length == 1.0 { "unit" } else { "units" });
    let label = format!("{} {unit}", written(length, length));

    let text = text_width(&label);
    let inner = bar.max(text);
    let mut plate = plate_for([inner, LINE + THICKNESS]);
    write(&mut plate, [PADDING + (inner - text) / 2, PADDING], &label);
    rule(&mut plate, [PADDING + (inner - bar) / 2, PADDING + LINE], [bar, THICKNESS]);
    Ok(plate)
}
