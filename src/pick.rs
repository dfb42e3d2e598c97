//! Picking: the first point that is visible at a pixel.

use glam::{DVec2, DVec3, UVec3};

use crate::error::setting::SettingError;
use crate::geometry::view_geometry::ViewGeometry;
use crate::scene::ImageSettings;
use crate::settings::transfer_function::TransferFunction;
use crate::settings::window::Region;
use crate::volume::Volume;

/// A point of a volume.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Pick {
    /// The position in world units from the volume's centre.
    pub position: DVec3,
    /// The depth along the camera's direction in world units, from the eye or, orthographic, from the camera's centre.
    pub depth: f64,
    /// The nearest voxel, in its file's own order ([`Grid::file_voxel`](crate::volume::Grid::file_voxel)).
    pub voxel: UVec3,
    /// The number of the channel (SPEC §10) with the greatest opacity in that voxel, the first of equal ones. The scene knows its name:
    /// [`Scene::channel_name`](crate::Scene::channel_name).
    pub channel: usize,
    /// That voxel's value in the channel, NaN in a hole.
    pub value: f32,
    /// That voxel's label, if the channel is segmented.
    pub label: Option<u16>,
    /// The number in the file ([`Volume::label_ids`]) of that label, or of the value where values are labels beyond 16 bits.
    pub label_id: Option<u64>,
}

impl Pick {
    /// The point at a depth of a pixel's ray.
    pub(crate) fn at(
        view: &ViewGeometry,
        (volume, transfer): (&Volume, &[TransferFunction]),
        pixel: [u32; 2],
        depth: f64,
    ) -> Self {
        let grid = volume.grid();
        let place = DVec2::from(pixel.map(f64::from)) + 0.5 - DVec2::from(view.size.map(f64::from)) / 2.0;
        let from_center = view.rays().at(place, depth / grid.unit()) * grid.unit();
        let position = from_center + grid.place();
        let last = grid.dims.as_dvec3() - 1.0;
        let voxel = (from_center / grid.spacing + grid.center()).round().clamp(DVec3::ZERO, last).as_uvec3();
        let index = grid.index_of(voxel);
        let opacity = |(volume, transfer): (&Volume, &TransferFunction)| {
            let value = f64::from(volume.values().at(index as usize));
            let tables = transfer.tables(volume.label(index));
            if value.is_nan() {
                0.0
            } else {
                tables.alpha(value, tables.gradient(volume, voxel).length()) * volume.alpha_of(index)
            }
        };
        let opacities = volume.channels().zip(transfer).map(opacity).enumerate();
        let (channel, _) = opacities.fold((0, 0.0), |best, of| if of.1 > best.1 { of } else { best });
        let of_channel = volume.channel(channel).unwrap_or(volume);
        let (value, label) = (of_channel.values().at(index as usize), of_channel.label(index));
        // Values of such files are labels.
        let of_value = || of_channel.label_ids().map(|_| value as u16);
        let label_id = label.or_else(of_value).map(|label| of_channel.label_id(label));
        Self { position, depth, voxel: grid.file_voxel(voxel), channel, value, label, label_id }
    }

    /// The error of a pick without a first hit: none were requested, or the pixel lies outside the image.
    pub(crate) fn missing(pixel: [u32; 2], image: &ImageSettings) -> SettingError {
        let ImageSettings { width, height, .. } = image;
        SettingError::new(
            "pick",
            format!("{pixel:?}"),
            format!("a pixel of {width}×{height}, in a frame with first hits"),
        )
    }
}

/// The first hits of a frame that was drawn without a GPU.
#[derive(Clone, Debug)]
pub(crate) struct FirstHits {
    /// The frame's view.
    pub(crate) view: ViewGeometry,
    /// The pixels that were drawn.
    pub(crate) region: Region,
    /// For every pixel of the region, row by row, the depth in world units; infinite where the opacity is not reached.
    pub(crate) depths: Vec<f32>,
}

impl FirstHits {
    /// The first hit of a frame at a pixel.
    ///
    /// # Errors
    /// If the frame has no first hits, or the pixel lies outside the image.
    pub(crate) fn pick(
        hits: Option<&Self>,
        of: (&Volume, &[TransferFunction]),
        pixel: [u32; 2],
        image: &ImageSettings,
    ) -> Result<Option<Pick>, SettingError> {
        let depth_at = |hits: &Self| {
            let [x, y] = pixel.map(|at| at as usize);
            let (columns, rows) = (hits.region.columns(), hits.region.rows());
            let is_inside = columns.contains(&x) && rows.contains(&y);
            is_inside.then(|| (hits.view, hits.depths[(y - rows.start) * columns.len() + x - columns.start]))
        };
        let Some((view, depth)) = hits.and_then(depth_at) else { return Err(Pick::missing(pixel, image)) };
        Ok(depth.is_finite().then(|| Pick::at(&view, of, pixel, depth.into())))
    }
}
