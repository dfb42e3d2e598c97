//! `average` after splatting (SPEC §9): what pixels' means show. The mean of all values along a ray is classified, so that parts have means, and the
//! whole image their colours.

use glam::DVec3;

use super::content::Extreme;
use crate::scene::Scene;
use crate::settings::splatting::{Classification, Compositing};
use crate::settings::transfer_function::{Ramp, Tables, TransferFunction};
use crate::volume::Volume;

/// The tables that classify the means.
#[derive(Clone, Debug, PartialEq)]
pub struct MeanTables {
    /// Red, green and blue in [0, 1] over values.
    pub color: Ramp<DVec3>,
    /// Opacity in [0, 1] over values.
    pub opacity: Ramp<f64>,
    /// Closed intervals of the values that take part; `None` means all values.
    pub iso_ranges: Option<Vec<[f64; 2]>>,
    /// Whether voxels have colours of their own (SPEC §10), which pixels then carry in place of the colour's.
    pub has_colors: bool,
}

impl MeanTables {
    /// Those of a scene of a volume, for every channel; none unless it shows means.
    pub(super) fn of(volume: &Volume, scene: &Scene) -> Vec<Self> {
        if !shows_means(scene.splatting.compositing, scene.classification(volume)) {
            return Vec::new();
        }
        let transfer = scene.resolve(volume);
        let of_channel = |(channel, transfer): (&Volume, &TransferFunction)| Self {
            color: transfer.color.clone(),
            opacity: transfer.opacity.clone(),
            iso_ranges: transfer.iso_ranges.clone(),
            has_colors: channel.colors().is_some(),
        };
        volume.channels().zip(transfer.channels()).map(of_channel).collect()
    }

    /// A pixel's colour, premultiplied, given what it carries.
    pub(super) fn pixel(&self, carried: [f32; 4], mean: Extreme) -> [f32; 4] {
        // The middle of a stretch is classified where it is drawn.
        if mean.counted <= Extreme::MIDDLE {
            return carried;
        }
        let value = f64::from(mean.value);
        let (color, opacity, iso_ranges) = (&self.color, &self.opacity, self.iso_ranges.as_deref());
        let tables = Tables { visible: true, color, opacity, gradient_opacity: None, iso_ranges };
        let alpha = tables.alpha(value, 0.0);
        if self.has_colors {
            let [red, green, blue, own] = carried.map(f64::from);
            return [red, green, blue, 1.0].map(|channel| (channel * own * alpha) as f32);
        }
        tables.color.at(value).extend(1.0).to_array().map(|channel| (channel * alpha) as f32)
    }
}

/// Whether pixels show the mean of the values along their rays.
pub(super) fn shows_means(compositing: Compositing, classification: Classification) -> bool {
    (compositing, classification) == (Compositing::Average, Classification::After)
}
