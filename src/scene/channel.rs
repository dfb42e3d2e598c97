//! A channel of a scene (SPEC §10): where its volume comes from, and its transfer function.

use std::path::PathBuf;

use glam::DVec3;

use super::{TransferSettings, VolumeSource};
use crate::volume::builtin;

/// A channel of a scene: a volume and its transfer function.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Channel {
    /// The name in legends and picks; `None` uses the file's.
    pub name: Option<String>,
    /// Whether the channel is drawn.
    pub visible: bool,
    /// The source of the volume. For a channel after the first, [`VolumeSource::Memory`] stands for the channel of the same number in the first
    /// channel's volume.
    pub volume: VolumeSource,
    /// World units between neighbouring voxels, each above 0, in place of the volume's own spacing.
    pub spacing: Option<DVec3>,
    /// A file with one label per voxel, in place of the volume's own labels.
    pub labels: Option<PathBuf>,
    /// A table of the labels' names and colours ([`LabelTable`](crate::volume::LabelTable)), which precede those of files: a file, or
    /// `builtin:freesurfer`.
    pub label_table: Option<PathBuf>,
    /// The number, from 0, of the only channel that is read of a file with several; `None` reads all of a scene's only file.
    pub index: Option<u32>,
    /// The number, from 0, of the time that is read of a file with several; `None` reads the first.
    pub time: Option<u32>,
    /// The level, from 0 for the finest, that is read of a store with several; `None` chooses one ([`Scene::choose_levels`](super::Scene::choose_levels)).
    pub level: Option<u32>,
    /// The series that is read of a folder with several: its number, from 0, or its `SeriesInstanceUID`; `None` reads the largest.
    pub series: Option<String>,
    /// Colour and opacity.
    pub transfer: TransferSettings,
}

impl Default for Channel {
    /// A channel of a volume in memory.
    fn default() -> Self {
        Self::new(VolumeSource::Memory)
    }
}

impl Channel {
    /// A channel of a volume with every setting at its default.
    pub fn new(volume: VolumeSource) -> Self {
        let transfer = TransferSettings::default();
        Self {
            name: None,
            visible: true,
            volume,
            spacing: None,
            labels: None,
            label_table: None,
            index: None,
            time: None,
            level: None,
            series: None,
            transfer,
        }
    }

    /// Whether the volume can have labels; an unknown builtin volume might.
    pub(super) fn may_have_labels(&self) -> bool {
        let has_none = match &self.volume {
            VolumeSource::File(_) | VolumeSource::Raw(..) => true,
            VolumeSource::Builtin(name) => builtin::labels(name).is_some_and(<[_]>::is_empty),
            VolumeSource::Memory => false,
        };
        self.labels.is_some() || !has_none
    }
}
