//! Pictures that show nothing: the likely reason.

use crate::image::Image;
use crate::scene::image_settings::premultiplied;
use crate::stats::Stats;
use crate::volume::Volume;

/// The largest difference of a channel that no screen shows: half a step of 255.
const UNSEEN: f32 = 0.5 / 255.0;

/// Whether no pixel differs from the background. A number that is not finite differs.
pub(super) fn is_blank(image: &Image, background: [f64; 4]) -> bool {
    let background = premultiplied(background);
    let is_behind =
        |pixel: &[f32; 4]| pixel.iter().zip(background).all(|(channel, behind)| (channel - behind).abs() <= UNSEEN);
    image.pixels.iter().all(is_behind)
}

/// Why a picture with these statistics is blank. `volume` is the volume, or a sample of it.
pub(super) fn reason(stats: &Stats, volume: &Volume) -> String {
    let reason = if stats.counts.voxels_in_range == 0 {
        let values = volume.channels().flat_map(|channel| channel.values().iter()).filter(|value| value.is_finite());
        let [low, high] =
            values.fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)]);
        format!(
            "no voxel takes part: the values go from {low} to {high}, see transfer.opacity, transfer.iso_ranges and what is cut"
        )
    } else {
        "the voxels that take part lie outside the picture or are transparent: see the camera's direction, center and height (distance), and transfer.opacity"
            .to_owned()
    };
    format!("no pixel differs from the background: {reason}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_pixel_that_differs_is_something() {
        let background = [1.0, 0.5, 0.0, 0.5];
        let image = |pixel: [f32; 4]| Image { width: 2, height: 1, pixels: vec![[0.5, 0.25, 0.0, 0.5], pixel] };
        assert!(is_blank(&image([0.5, 0.25, 0.0, 0.5]), background));
        assert!(is_blank(&image([0.5, 0.251, 0.0, 0.5]), background));
        for pixel in [[0.5, 0.25, 0.01, 0.5], [0.5, 0.25, 0.0, 0.6], [f32::NAN, 0.25, 0.0, 0.5]] {
            assert!(!is_blank(&image(pixel), background), "{pixel:?}");
        }
    }
}
