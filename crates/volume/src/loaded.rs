//! The result of every reader.

use std::collections::BTreeMap;
use std::path::Path;

use glam::{DVec3, UVec3};

use super::display::ChannelDisplay;
use super::error::volume::invalid;
use super::label_ids::label_of;
use super::sample_type::{Sample, SampleType};
use super::series::Series;
use super::voxels::Voxels;
use super::{Encoding, Grid, Orientation, StoreFacts, VolumeError};
use crate::StoreCounts;

/// The order of the axes of an array that does not name them.
#[cfg(any(feature = "npy", feature = "zarr"))]
pub(super) const ASSUMED_AXES: &str = "the array's last ones are z, y and x";

/// The contents of a file of values or labels.
pub(super) struct Loaded {
    pub dims: UVec3,
    /// The type of the samples in the file.
    pub kind: SampleType,
    /// World units between voxels, if the file states them.
    pub(super) spacing: Option<DVec3>,
    /// The unit of the spacing, if the file states it.
    pub(super) unit: Option<String>,
    /// The unit of the values, if the file states it.
    pub(super) value_unit: Option<String>,
    /// The orientation, if the file states it.
    pub(super) orientation: Option<Orientation>,
    /// Whether the axes are left-handed in a space that is not a patient's.
    pub(super) left_handed: bool,
    /// The names and colours of values: one legend for the file, or one for each channel.
    pub(super) legends: Vec<Legend>,
    /// The volumes in the file.
    pub(super) series: Series,
    /// The names of the file's channels, from the first on; there may be fewer than channels.
    pub(super) channel_names: Vec<String>,
    /// The marks that tell the file's times apart, from the first on; there may be fewer than times.
    pub(super) time_names: Vec<String>,
    /// The series among which the folder's was chosen.
    pub(super) series_names: Vec<String>,
    /// How the channels are shown, from the first on; there may be fewer than channels.
    pub(super) displays: Vec<ChannelDisplay>,
    /// The levels in the file, of which the values are one.
    pub(super) levels: Option<Levels>,
    /// The order of axes that was assumed, if the file states none.
    pub(super) assumed_axes: Option<&'static str>,
    /// One value per voxel, x fastest, channel by channel.
    pub values: Voxels,
}

/// The names and colours that a file gives to single values.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Legend {
    /// The names of labels, each behind its id.
    pub(super) names: Vec<(u64, String)>,
    /// Their colours, in ascending order of values.
    pub(super) palette: Option<Vec<(f64, DVec3)>>,
    /// Whether the file says that all values are labels, with or without names.
    pub(super) are_labels: bool,
}

impl Legend {
    /// The names of labels, given what these are, in ascending order, if ids are others.
    pub(super) fn label_names(&self, ids: Option<&[u64]>) -> BTreeMap<u16, String> {
        let mut names = BTreeMap::new();
        // The first one of two names stays, as with colours.
        for (id, name) in self.names.iter().rev() {
            if let Some(label) = label_of(*id, ids) {
                names.insert(label, name.clone());
            }
        }
        names
    }

    /// Whether values are labels.
    pub(super) fn is_of_labels(&self) -> bool {
        self.are_labels || !self.names.is_empty()
    }

    /// The colours of labels, in ascending order.
    pub(super) fn label_colors(&self, ids: Option<&[u64]>) -> Vec<(f64, DVec3)> {
        let palette = self.palette.iter().flatten();
        palette.filter_map(|&(id, color)| Some((label_of(id.to_id()?, ids)?.into(), color))).collect()
    }

    /// Colours in ascending order of values, the first one of each; `None` without any.
    pub(super) fn ascending(mut colors: Vec<(f64, DVec3)>) -> Option<Vec<(f64, DVec3)>> {
        colors.sort_by(|a, b| a.0.total_cmp(&b.0));
        colors.dedup_by_key(|color| color.0);
        Some(colors).filter(|colors| !colors.is_empty())
    }

    /// Colours of values without names.
    #[cfg(any(feature = "dicom", feature = "tiff"))]
    pub(super) fn of_palette(palette: Option<Vec<(f64, DVec3)>>) -> Self {
        Self { palette, ..Self::default() }
    }
}

/// The levels of a volume, and the one that is read (SPEC §13).
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Levels {
    /// The number of voxels of each level along x, y and z, from the finest.
    pub(super) dims: Vec<UVec3>,
    /// The number of the level that is read, and its grid.
    pub(super) level: u32,
    pub(super) grid: Grid,
    /// What was read for it.
    pub(super) reads: StoreCounts,
}

impl Loaded {
    /// Values about which the file states nothing else.
    pub(super) fn new(dims: UVec3, kind: SampleType, values: Voxels) -> Self {
        let (legends, series, channel_names) = (Vec::new(), Series::default(), Vec::new());
        let (spacing, unit, orientation) = (None, None, None);
        let (time_names, series_names) = (Vec::new(), Vec::new());
        let (displays, levels, value_unit) = (Vec::new(), None, None);
        Self {
            dims,
            kind,
            spacing,
            unit,
            value_unit,
            orientation,
            left_handed: false,
            legends,
            series,
            channel_names,
            time_names,
            series_names,
            displays,
            levels,
            assumed_axes: None,
            values,
        }
    }

    /// The facts that the file, of some format, states about one of its channels, `number` among those that are read. The first channel has the facts that concern all.
    pub(super) fn facts(&self, format: &'static str, channel: usize, number: usize) -> StoreFacts {
        let Self { series, spacing, unit, .. } = self;
        let legend = self.legend(channel, number);
        let label_names = legend.label_names(None);
        let Legend { palette, are_labels, .. } = legend;
        let orientation = self.orientation.filter(|_| number == 0);
        let channels = if series.is_color { 1 } else { series.channels };
        let display = self.displays.get(channel).filter(|display| **display != ChannelDisplay::default());
        StoreFacts {
            encoding: Some(Encoding { format, sample_type: self.kind, channels, times: series.times }),
            spacing: *spacing,
            unit: unit.clone(),
            value_unit: self.value_unit.clone(),
            orientation,
            palette,
            label_names,
            are_labels,
            assumed_axes: self.assumed_axes,
            channel_name: self.channel_names.get(channel).cloned(),
            display: display.cloned(),
            time_names: self.time_names.clone(),
            series_names: self.series_names.clone(),
        }
    }

    /// Whether the axes are left-handed, in whatever space.
    pub(super) fn is_left_handed(&self) -> bool {
        self.left_handed || self.orientation.is_some_and(|orientation| orientation.is_mirrored())
    }

    /// The legend of one of the file's channels, `number` among those that are read.
    pub(super) fn legend(&self, channel: usize, number: usize) -> Legend {
        let legend = match self.legends.as_slice() {
            [of_all] => Some(of_all).filter(|_| number == 0),
            of_channels => of_channels.get(channel),
        };
        legend.cloned().unwrap_or_default()
    }

    /// Checks that the values are those of one channel.
    ///
    /// # Errors
    /// If they are not; `allowed` says why they must be.
    pub(super) fn check_single(&self, path: &Path, allowed: &str) -> Result<(), VolumeError> {
        match self.values.count() / self.dims.element_product() as usize {
            1 => Ok(()),
            count => Err(invalid(path, "channels", count, allowed)),
        }
    }
}
