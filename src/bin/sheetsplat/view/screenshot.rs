//! Saves pictures of the window, and the scene that it shows.

use std::path::{Path, PathBuf};

use eframe::egui::{ColorImage, Rect};
use sheetsplat::image::{Image, output};
use sheetsplat::scene::{Scene, TransferSettings};
use sheetsplat::settings::TransferFunction;
use sheetsplat::volume::Volume;

use crate::arguments::scene_file;
use crate::failure::Failure;

/// The first name among `sheetsplat-1.png`, `sheetsplat-2.png`, … (or with another extension) that does not exist in the current folder.
pub(super) fn free_name(extension: &str) -> PathBuf {
    let mut names = (1_u32..).map(|number| PathBuf::from(format!("sheetsplat-{number}.{extension}")));
    names.find(|name| name.symlink_metadata().is_err()).unwrap_or_default()
}

/// Saves a scene as shown, with the current transfer function.
pub(super) fn save_scene(
    scene: &Scene,
    transfer: &[TransferFunction],
    volume: &Volume,
    path: &Path,
) -> Result<(), Failure> {
    let mut scene = scene.clone();
    let channels = scene.channels.iter_mut().zip(transfer).zip(volume.channels());
    channels.for_each(|((of, transfer), channel)| of.transfer = TransferSettings::stating(transfer.clone(), channel));
    let text = scene_file(&scene.explicit(volume), path)?;
    output::write(path, &text).map_err(|error| Failure::Other(format!("{}: {error}", path.display())))
}

/// The image of the window's pixels, or of a part of them, given in pixels.
pub(super) fn image(window: &ColorImage, part: Option<Rect>) -> Image {
    let [width, height] = window.size;
    let [columns, rows] = part.map_or([0..width, 0..height], |part| {
        let range = |from: f32, to: f32, end: usize| (from.round() as usize).min(end)..(to.round() as usize).min(end);
        [range(part.min.x, part.max.x, width), range(part.min.y, part.max.y, height)]
    });
    let pixels = rows.clone().flat_map(|row| &window.pixels[row * width..][columns.clone()]);
    Image {
        width: columns.len() as u32,
        height: rows.len() as u32,
        pixels: pixels.map(|pixel| pixel.to_array().map(|channel| f32::from(channel) / 255.0)).collect(),
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use eframe::egui::{Color32, pos2};
    use sheetsplat::scene::VolumeSource;

    use super::*;

    #[test]
    fn a_saved_scene_is_what_is_shown() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("shown.toml");
        // The viewer always names the classification that it shows.
        let sets = ["image.width=70", "preset=ct-bone", "splatting.classification=after"].map(str::to_owned);
        let scene = Scene::from_volume(VolumeSource::Builtin("head:16".to_owned()), &sets).unwrap();
        let volume = scene.load_volume().unwrap();
        let mut edited = scene.resolve(&volume);
        edited.first_mut().iso_ranges = Some(vec![[3.0, 90.0]]);
        save_scene(&scene, &edited, &volume, &path).unwrap();
        let saved = Scene::open(&path, &[]).unwrap();
        assert_eq!(saved.resolve(&volume), edited);
        assert_eq!((saved.image, saved.shading, saved.splatting), (scene.image, scene.shading, scene.splatting));
    }

    #[test]
    fn a_part_of_the_window_is_cut_out() {
        let colors = (0..6).map(|at| Color32::from_rgb(at, 0, 255)).collect();
        let window = ColorImage::new([3, 2], colors);
        let reds =
            |image: &Image| image.pixels.iter().map(|pixel| (pixel[0] * 255.0).round() as u8).collect::<Vec<_>>();
        let whole = image(&window, None);
        assert_eq!((whole.width, whole.height, reds(&whole)), (3, 2, vec![0, 1, 2, 3, 4, 5]));
        let right = image(&window, Some(Rect::from_min_max(pos2(0.9999, 0.0), pos2(9.0, 9.0))));
        assert_eq!((right.width, right.height, reds(&right)), (2, 2, vec![1, 2, 4, 5]));
        assert_eq!(right.pixels[0][2..], [1.0, 1.0]);
    }
}
