//! Labels: the segment that each voxel of a segmented volume belongs to.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use glam::{DVec3, UVec3};

use super::access::{Access, ReadOptions};
use super::error::volume::refused;
use super::format;
use super::label_facts::LabelFacts;
use super::loaded::Loaded;
use super::membership::{KeptMembership, Members};
use super::resample::labels_onto;
use super::voxel::Voxel;
use super::{Grid, Orientation, Volume, VolumeError};

/// Spacings whose relative difference is less than this count as equal.
const SAME_SPACING: f64 = 1e-4;

/// One label per voxel of a grid.
#[derive(Clone, Debug, PartialEq)]
pub struct Labels {
    /// The name in errors: a file.
    pub origin: String,
    /// The number of voxels along x, y and z.
    pub dims: UVec3,
    /// The distance between voxels in world units; `None` matches any volume's.
    pub spacing: Option<DVec3>,
    /// The labels, x fastest, in the file's own order, also where its axes are left-handed.
    pub values: Arc<[u16]>,
    /// The labels' names, where known.
    pub names: BTreeMap<u16, String>,
}

impl Labels {
    /// Reads a label file: a volume file of any format that [`Volume::open`] reads, with whole numbers from 0 to 65535 in any sample type.
    ///
    /// # Errors
    /// If the file cannot be read, is of no known format, does not hold what its header promises, or has a sample that is not a
    /// label (the error names the voxel).
    pub fn open(path: &Path) -> Result<Self, VolumeError> {
        Self::open_with(path, &ReadOptions::default())
    }

    /// Like [`Self::open`], with a folder that files must lie in and a memory limit.
    ///
    /// # Errors
    /// As for [`Self::open`], and if the file, or one that its header names, lies outside the folder.
    pub fn open_with(path: &Path, options: &ReadOptions) -> Result<Self, VolumeError> {
        Self::read(path, &Access::new(options)?)
    }

    #[doc(hidden)]
    pub fn read(path: &Path, access: &Access) -> Result<Self, VolumeError> {
        Self::oriented(path, access).map(|(labels, _)| labels)
    }

    /// The labels of a file, and how they lie in the patient, if it states that.
    fn oriented(path: &Path, access: &Access) -> Result<(Self, Option<Orientation>), VolumeError> {
        let (_, loaded) = format::read::<u16>(path, access)?;
        loaded.check_single(path, "one: a label for every voxel")?;
        let names = loaded.legend(access.selection().channel.unwrap_or(0) as usize, 0).names;
        let Loaded { dims, spacing, values, orientation, .. } = loaded;
        let origin = path.display().to_string();
        Ok((Self { origin, dims, spacing, values: values.into(), names }, orientation))
    }
}

/// The labels among values: of every `step`th voxel along each axis of a file's grid, from voxel `from` on.
///
/// # Errors
/// If a value is no label; the error names the file and the voxel.
pub fn labels_of(
    origin: &str,
    (grid, from, dims, step): (&Grid, UVec3, UVec3, u32),
    values: impl IntoIterator<Item = f32>,
) -> Result<Arc<[u16]>, VolumeError> {
    let label = |(index, value): (u32, f32)| {
        u16::of(value).ok_or_else(|| {
            let voxel = grid.file_voxel(from + step * Grid::new(dims, DVec3::ONE).voxel_at(index));
            VolumeError::invalid(origin, "data", format!("{value} at voxel {voxel}"), u16::ALLOWED.to_owned())
        })
    };
    (0..).zip(values).map(label).collect()
}

/// Labels in the order of a grid, from the file's own.
fn turned(mut labels: Arc<[u16]>, grid: &Grid) -> Arc<[u16]> {
    if grid.is_turned() {
        grid.reorder(Arc::make_mut(&mut labels));
    }
    labels
}

impl Volume {
    /// The same volume with the labels of a file. Where both files state how they lie in the patient, labels on another grid are resampled.
    /// `has_spacing` says that the labels' spacing does not count.
    ///
    /// # Errors
    /// The errors of [`Labels::open_with`] and [`Self::with_labels`], and one if the labels lie nowhere in the volume.
    #[doc(hidden)]
    pub fn with_labels_of(self, path: &Path, has_spacing: bool, access: &Access) -> Result<Self, VolumeError> {
        let (labels, orientation) = Labels::oriented(path, access)?;
        if let (Some(own), Some(of_volume)) = (&orientation, self.orientation()) {
            let grid = Grid::new(labels.dims, labels.spacing.unwrap_or(DVec3::ONE));
            grid.check().map_err(|error| refused(&labels.origin, error))?;
            let (grid, own, values) = match own.is_mirrored() {
                true => (grid.turned(), own.turned(&grid), turned(labels.values, &grid.turned())),
                false => (grid, *own, labels.values),
            };
            let places = ((&grid, Some(&own)), (self.grid(), Some(of_volume)));
            return match labels_onto(&values, places, path, access)? {
                Some(values) => {
                    let (dims, spacing) = (self.dims(), Some(self.spacing()));
                    self.with_labels_in_order(Labels { dims, spacing, values, ..labels })
                }
                None => {
                    let spacing = labels.spacing.filter(|_| !has_spacing);
                    self.with_labels_in_order(Labels { spacing, values, ..labels })
                }
            };
        }
        let spacing = labels.spacing.filter(|_| !has_spacing);
        self.with_labels(Labels { spacing, ..labels })
    }

    /// The same volume with other labels, in the order of its own file.
    ///
    /// # Errors
    /// If the labels' grid is another than the volume's.
    pub fn with_labels(self, labels: Labels) -> Result<Self, VolumeError> {
        let grid = self.grid;
        let mut volume = self.with_labels_in_order(labels)?;
        volume.labels = volume.labels.map(|labels| turned(labels, &grid));
        Ok(volume)
    }

    /// As [`Self::with_labels`], in the order of the volume's values.
    #[doc(hidden)]
    pub fn with_labels_in_order(mut self, labels: Labels) -> Result<Self, VolumeError> {
        let Labels { origin, dims, spacing, values, names } = labels;
        let shown = |spacing: DVec3| format!("{:?}", spacing.to_array());
        if dims != self.dims() {
            return Err(VolumeError::invalid(
                &origin,
                "sizes",
                format!("{dims}"),
                format!("{}, the volume's", self.dims()),
            ));
        }
        let (found, allowed) = (values.len(), self.values().len());
        if found != allowed {
            return Err(VolumeError::invalid(&origin, "data", format!("{found} labels"), format!("{allowed} labels")));
        }
        let differs = |spacing: &DVec3| {
            let largest = spacing.max(self.spacing());
            !(*spacing - self.spacing()).abs().cmple(SAME_SPACING * largest).all()
        };
        if let Some(other) = spacing.filter(differs) {
            return Err(VolumeError::invalid(
                &origin,
                "spacing",
                shown(other),
                format!("{}, the volume's", shown(self.spacing())),
            ));
        }
        self.labels = Some(values);
        self.membership[Members::OfLabels as usize] = KeptMembership::default();
        self.label_names = names;
        Ok(self)
    }

    /// All labels, x fastest, then y, then z; `None` if the volume is not segmented.
    pub fn labels(&self) -> Option<&[u16]> {
        self.labels.as_deref()
    }

    /// The names of labels, where known: of a segmented volume, or of one whose values are labels.
    pub fn label_names(&self) -> &BTreeMap<u16, String> {
        &self.label_names
    }

    /// The same volume with values that are known to be labels.
    #[doc(hidden)]
    pub fn as_label_map(self) -> Self {
        Self { is_label_map: true, ..self }
    }

    /// The facts that are known of its values as labels.
    #[doc(hidden)]
    pub fn label_facts(&self) -> &LabelFacts {
        &self.label_facts
    }

    /// Whether the values are known to be labels, whatever they look like: they were resampled as labels, or their file says so or names them.
    #[doc(hidden)]
    pub fn is_known_label_map(&self) -> bool {
        self.is_label_map || self.labels.is_none() && !self.label_names.is_empty()
    }

    /// The label of the voxel at an index in memory; `None` if the volume is not segmented.
    ///
    /// # Panics
    /// If the volume is segmented and the voxel lies outside it.
    pub fn label(&self, index: u32) -> Option<u16> {
        self.labels.as_ref().map(|labels| labels[index as usize])
    }
}
