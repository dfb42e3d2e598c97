//! Pictures that show nothing: the likely reason.

use crate::rendering::Rendering;
use crate::scene::Scene;
use crate::volume::Volume;

/// The largest difference of a channel that no screen shows: half a step of 255.
const UNSEEN: f32 = 0.5 / 255.0;

/// Why no pixel differs from the background; `None` where one does. `volume` is the volume, or a sample of it.
pub(super) fn reason(Rendering { image, stats }: &Rendering, scene: &Scene, volume: &Volume) -> Option<String> {
    let [red, green, blue, alpha] = scene.image.background;
    let background = [red * alpha, green * alpha, blue * alpha, alpha].map(|channel| channel as f32);
    let differs =
        |pixel: &[f32; 4]| pixel.iter().zip(background).any(|(channel, behind)| (channel - behind).abs() > UNSEEN);
    if image.pixels.iter().any(differs) {
        return None;
    }
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
    Some(format!("no pixel differs from the background: {reason}"))
}
