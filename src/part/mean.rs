//! `average` after splatting (SPEC §9): what pixels' means show. The mean of all values along a ray is classified, so that parts have means, and the
//! whole image their colours. Where labels have tables, the voxel in the middle of a ray's stretch decides, wherever that is: every part notes its label.

use std::collections::BTreeMap;

use glam::UVec3;

use super::content::{Content, Extreme};
use crate::geometry::pixel_ray::{PixelRay, counted};
use crate::geometry::view_geometry::ViewGeometry;
use crate::scene::Scene;
use crate::settings::transfer_function::TransferFunction;
use crate::settings::window::Region;
use crate::volume::{Grid, Volume};

/// The tables that classify the means.
#[derive(Clone, Debug, PartialEq)]
pub struct MeanTables {
    /// The transfer function. Gradient opacity does not count; tables of labels do, of a segmented volume.
    pub transfer: TransferFunction,
    /// Whether voxels have colours of their own (SPEC §10), which pixels then carry in place of the colour's.
    pub has_colors: bool,
}

impl MeanTables {
    /// Those of a scene of a volume, for every channel; none unless it shows means.
    pub(super) fn of(volume: &Volume, scene: &Scene) -> Vec<Self> {
        if !scene.splatting.compositing.shows_means(scene.classification(volume)) {
            return Vec::new();
        }
        let transfer = scene.resolve(volume);
        let of_channel = |(channel, transfer): (&Volume, &TransferFunction)| {
            let mut transfer = TransferFunction { gradient_opacity: None, ..transfer.clone() };
            transfer.labels.values_mut().for_each(|tables| tables.gradient_opacity = None);
            if channel.labels().is_none() {
                transfer.labels = BTreeMap::new();
            }
            Self { transfer, has_colors: channel.colors().is_some() }
        };
        volume.channels().zip(&transfer).map(of_channel).collect()
    }

    /// Whether labels have tables of their own.
    pub(crate) fn has_labels(&self) -> bool {
        !self.transfer.labels.is_empty()
    }

    /// A pixel's colour, premultiplied, given what it carries.
    pub(super) fn pixel(&self, carried: [f32; 4], mean: Extreme) -> [f32; 4] {
        // The middle of a stretch is classified where it is drawn.
        if !mean.has_points() {
            return carried;
        }
        let value = f64::from(mean.value);
        let tables = self.transfer.tables(Some(mean.label as u16));
        let alpha = tables.alpha(value, 0.0);
        if self.has_colors {
            let [red, green, blue, own] = carried.map(f64::from);
            return [red, green, blue, 1.0].map(|channel| (channel * own * alpha) as f32);
        }
        tables.color.at(value).extend(1.0).to_array().map(|channel| (channel * alpha) as f32)
    }
}

/// Notes the labels of a region's pixels whose means are of points on planes, given a view of a scene on the volume's whole grid. `labels_at` finds those of
/// voxels.
///
/// # Errors
/// Those of `labels_at`.
pub(crate) fn note_labels<E>(
    (view, scene, grid): (&ViewGeometry, &Scene, &Grid),
    region: &Region,
    content: &mut Content,
    labels_at: impl FnOnce(&[UVec3]) -> Result<Vec<u16>, E>,
) -> Result<(), E> {
    let (rays, counted) = (view.rays(), counted(view, &scene.clip, grid));
    let middle = glam::DVec2::from(view.size.map(f64::from)) / 2.0;
    let mut voxels = Vec::new();
    for (mean, at) in content.extremes.iter().zip(0..).filter(|(mean, _)| mean.has_points()) {
        debug_assert!(mean.value.is_finite());
        let pixel = [region.x + at % region.width, region.y + at / region.width].map(|place| place as usize);
        let ray = PixelRay::of(&rays, pixel, middle);
        voxels.push(ray.middle_voxel(&ray.inside(&counted), grid));
    }
    let labels = labels_at(&voxels)?;
    let means = content.extremes.iter_mut().filter(|mean| mean.has_points());
    means.zip(labels).for_each(|(mean, label)| mean.label = f32::from(label));
    Ok(())
}
