//! `--annotate`: the scale bar, colour bar and legend drawn over images.

mod color_bar;
mod legend;
mod plate;
mod round;
mod scale_bar;

use std::ffi::OsStr;
use std::path::Path;

use clap::ValueEnum;
use sheetsplat::image::Image;
use sheetsplat::scene::Scene;
use sheetsplat::volume::Volume;

use crate::canvas::lay;
use crate::failure::Failure;

/// Pixels between plates, and between plates and the image's edges.
const MARGIN: u32 = 8;

/// The choice of annotations.
#[derive(clap::Args)]
pub(crate) struct Annotate {
    /// Draw over the image, separated by commas: scale, a bar of a round length; colors, the colour of each value, for
    /// each channel; legend, the colour of each label or channel.
    #[arg(long, value_name = "LIST", value_enum, value_delimiter = ',')]
    annotate: Vec<Annotation>,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum Annotation {
    Scale,
    Colors,
    Legend,
}

/// Plates and the positions of their upper left corners.
pub(crate) struct Overlay(Vec<([u32; 2], Image)>);

impl Annotate {
    /// Whether nothing is drawn over images.
    pub(crate) fn is_empty(&self) -> bool {
        self.annotate.is_empty()
    }

    /// The annotations for a scene's images, for any direction of its camera.
    pub(crate) fn overlay(&self, scene: &Scene, volume: &Volume) -> Result<Overlay, Failure> {
        let has = |annotation| self.annotate.contains(&annotation);
        let size = [scene.image.width, scene.image.height];
        if self.annotate.is_empty() {
            return Ok(Overlay(Vec::new()));
        }
        let transfer = scene.resolve(volume);
        let scale = has(Annotation::Scale).then(|| scale_bar::plate(scene, volume)).transpose()?;
        let colors = has(Annotation::Colors).then(|| color_bar::plate(scene, volume, &transfer)).transpose()?;
        let below = scale.as_ref().map_or(0, |plate| plate.height + MARGIN);
        let room = size[1].saturating_sub(below + 2 * MARGIN);
        let legend = has(Annotation::Legend).then(|| legend::plate(scene, volume, &transfer, room)).transpose()?;
        place(size, scale, colors, legend)
    }

    /// Checks that the output is a picture to look at, not data.
    pub(crate) fn check_format(&self, output: &Path) -> Result<(), Failure> {
        let is_data = |extension: &OsStr| ["exr", "npy"].iter().any(|data| extension.eq_ignore_ascii_case(data));
        let is_data = output.extension().is_some_and(is_data);
        if is_data && !self.annotate.is_empty() {
            let found = output.display();
            return Err(Failure::Input(format!("--annotate: found {found}, allowed: PNG files and movies")));
        }
        Ok(())
    }
}

/// Puts the legend into the upper left corner, the scale bar into the lower left one, and the colour bar to the right.
fn place(
    size: [u32; 2],
    scale: Option<Image>,
    colors: Option<Image>,
    legend: Option<Image>,
) -> Result<Overlay, Failure> {
    let [left, right] = [[legend.as_ref(), scale.as_ref()], [colors.as_ref(), None]].map(|column| {
        let plates = column.into_iter().flatten();
        plates.fold([0, 0], |[width, height], plate| [width.max(plate.width + MARGIN), height + plate.height + MARGIN])
    });
    let needed = [left[0] + right[0] + MARGIN, left[1].max(right[1]) + MARGIN];
    if size[0] < needed[0] || size[1] < needed[1] {
        let ([width, height], [least_width, least_height]) = (size, needed);
        return Err(Failure::Input(format!(
            "--annotate: image.width × image.height: found {width}×{height}, allowed: at least {least_width}×{least_height} for these"
        )));
    }
    let mut plates = Vec::new();
    if let Some(plate) = legend {
        plates.push(([MARGIN, MARGIN], plate));
    }
    if let Some(plate) = scale {
        plates.push(([MARGIN, size[1] - MARGIN - plate.height], plate));
    }
    if let Some(plate) = colors {
        plates.push(([size[0] - MARGIN - plate.width, (size[1] - plate.height) / 2], plate));
    }
    Ok(Overlay(plates))
}

impl Overlay {
    /// Adds what is drawn to a hash.
    pub(crate) fn add_to(&self, hash: &mut blake3::Hasher) {
        for ([x, y], Image { width, height, pixels }) in &self.0 {
            [x, y, width, height].iter().for_each(|number| _ = hash.update(&number.to_le_bytes()));
            let bytes: Vec<u8> = pixels.iter().flatten().flat_map(|channel| channel.to_le_bytes()).collect();
            hash.update(&bytes);
        }
    }

    pub(crate) fn draw(&self, image: &mut Image) {
        for (corner, plate) in &self.0 {
            lay(image, *corner, plate);
        }
    }
}
