//! A scene's settings.

use super::{Channel, Fitting, ImageSettings, TransferSettings, VolumeSource};
use crate::settings::camera::Camera;
use crate::settings::clip::Clip;
use crate::settings::shading::Shading;
use crate::settings::splatting::{Classification, Splatting};
use crate::volume::Channels;

/// Everything that determines an image, except the device that computes it.
///
/// The readers below accept `--set` overrides, each `table.key=value` (or `table={…}` for a whole table), applied in order over the
/// file's values. The value is TOML, or a string if it does not parse as TOML. An override of `volume.path` also removes
/// `volume.builtin`; one of `volume.builtin` removes `volume.path` and the layout of a raw file. Where a scene file has tables `[[channel]]`, keys of `volume`
/// are those of the first channel, and `volume.time`, `level`, `series` and `spacing` also those of all channels that name its file. `volume.index` leaves one
/// of these tables if the others name no volume: that of the channel with this number.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// The channels (SPEC §10), all on the first one's grid: where the volume comes from, and the transfer functions. A scene with one shows all channels of
    /// its volume by it.
    pub channels: Channels<Channel>,
    /// The camera.
    pub camera: Camera,
    /// The image's size and background.
    pub image: ImageSettings,
    /// What is cut away.
    pub clip: Clip,
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
            channels: Channel::new(volume).into(),
            camera: Camera::of_object(),
            image: ImageSettings::default(),
            clip: Clip::default(),
            shading: Shading::default(),
            splatting: Splatting { classification: Classification::Auto, ..Splatting::default() },
            fitting: Fitting::ALL,
        }
    }

    /// The scene with another source of its first channel's volume.
    pub fn with_volume(mut self, volume: VolumeSource) -> Self {
        self.channels.first_mut().volume = volume;
        self
    }

    /// The scene with another transfer function of its first channel.
    pub fn with_transfer(mut self, transfer: impl Into<TransferSettings>) -> Self {
        self.channels.first_mut().transfer = transfer.into();
        self
    }
}
