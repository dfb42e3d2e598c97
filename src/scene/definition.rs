//! A scene's settings.

use std::path::PathBuf;

use glam::DVec3;

use super::{Channel, Fitting, ImageSettings, TransferSettings, VolumeSource};
use crate::settings::camera::Camera;
use crate::settings::clip::Clip;
use crate::settings::shading::Shading;
use crate::settings::splatting::{Classification, Splatting};

/// Everything that determines an image, except the device that computes it.
///
/// The readers below accept `--set` overrides, each `table.key=value` (or `table={…}` for a whole table), applied in order over the
/// file's values. The value is TOML, or a string if it does not parse as TOML. An override of `volume.path` also removes
/// `volume.builtin`; one of `volume.builtin` removes `volume.path` and the layout of a raw file. Where a scene file has tables `[[channel]]`, keys of `volume`
/// are those of the first channel, and `volume.time`, `level`, `series` and `spacing` also those of all channels that name its file. `volume.index` leaves one
/// of these tables if the others name no volume: that of the channel with this number.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// The source of the volume. This, and all up to `transfer`, are those of the first channel.
    pub volume: VolumeSource,
    /// World units between neighbouring voxels, each above 0, in place of the volume's own spacing.
    pub spacing: Option<DVec3>,
    /// A file with one label per voxel, in place of the volume's own labels.
    pub labels: Option<PathBuf>,
    /// The number, from 0, of the only channel that is read of a file with several; `None` reads all.
    pub index: Option<u32>,
    /// The number, from 0, of the time that is read of a file with several; `None` reads the first.
    pub time: Option<u32>,
    /// The level, from 0 for the finest, that is read of a store with several; `None` chooses one ([`Self::choose_levels`]).
    pub level: Option<u32>,
    /// The series that is read of a folder with several: its number, from 0, or its `SeriesInstanceUID`; `None` reads the largest.
    pub series: Option<String>,
    /// The name of the channel in legends and picks; `None` uses the file's.
    pub name: Option<String>,
    /// Whether the channel is drawn.
    pub visible: bool,
    /// The camera.
    pub camera: Camera,
    /// The image's size and background.
    pub image: ImageSettings,
    /// What is cut away.
    pub clip: Clip,
    /// Colour and opacity.
    pub transfer: TransferSettings,
    /// The channels after the first (SPEC §10), all on its grid.
    pub further: Vec<Channel>,
    /// Light and material.
    pub shading: Shading,
    /// Kernel, slabs, compositing, culling.
    pub splatting: Splatting,
    /// The settings that the preset that fits the volume chooses.
    pub fitting: Fitting,
}

impl Scene {
    /// A scene of a volume with every setting at its default.
    pub fn new(volume: VolumeSource) -> Self {
        Self {
            volume,
            spacing: None,
            labels: None,
            index: None,
            time: None,
            level: None,
            series: None,
            name: None,
            visible: true,
            camera: Camera::of_object(),
            image: ImageSettings::default(),
            clip: Clip::default(),
            transfer: TransferSettings::default(),
            further: Vec::new(),
            shading: Shading::default(),
            splatting: Splatting { classification: Classification::Auto, ..Splatting::default() },
            fitting: Fitting::ALL,
        }
    }
}
