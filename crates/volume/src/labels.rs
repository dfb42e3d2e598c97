//! Labels: the segment that each voxel of a segmented volume belongs to.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use glam::{DVec3, UVec3};

use super::access::{Access, ReadOptions};
use super::error::volume::{invalid, refused};
use super::format;
use super::label_facts::LabelFacts;
use super::label_ids::{Numbered, label_of};
use super::loaded::Loaded;
use super::membership::{KeptMembership, Members};
use super::resample::labels_onto;
use super::sample_type::Sample;
use super::voxels::Wanted;
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
    /// Reads a label file: a volume file of any format that [`Volume::open`] reads, with whole numbers from 0 to 65535 in any sample type. Larger ones are
    /// read as the labels of a scene's volume, which keeps what they stand for ([`Volume::label_ids`]).
    ///
    /// # Errors
    /// If the file cannot be read, is of no known format, does not hold what its header promises, or has a sample that is not a
    /// label (the error names the voxel, or the largest label).
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
        let Stated { labels, ids, .. } = Stated::read(path, access)?;
        match ids.and_then(|ids| ids.last().copied()) {
            Some(largest) => Err(invalid(path, "data", format!("labels up to {largest}"), ALLOWED)),
            None => Ok(labels),
        }
    }
}

/// The labels that 16 bits hold.
const ALLOWED: &str = "labels, whole numbers from 0 to 65535";

/// The labels of a file, and what it states about them.
struct Stated {
    labels: Labels,
    /// The numbers of the labels in the file, if these are others.
    ids: Option<Arc<[u64]>>,
    colors: Vec<(f64, DVec3)>,
    /// How they lie in the patient.
    orientation: Option<Orientation>,
}

impl Stated {
    fn read(path: &Path, access: &Access) -> Result<Self, VolumeError> {
        let (_, loaded) = format::read(path, &access.wanting(Wanted::Ids))?;
        loaded.check_single(path, "one: a label for every voxel")?;
        let legend = loaded.legend(access.selection().channel.unwrap_or(0) as usize, 0);
        let Loaded { dims, spacing, values, orientation, .. } = loaded;
        let Numbered { labels: values, ids } = values.into_ids().numbered(path)?;
        let (names, colors) = (legend.label_names(ids.as_deref()), legend.label_colors(ids.as_deref()));
        let origin = path.display().to_string();
        let labels = Labels { origin, dims, spacing, values: values.into(), names };
        Ok(Self { labels, ids, colors, orientation })
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
        label_of(value.to_id().unwrap_or(u64::MAX), None).ok_or_else(|| {
            let voxel = grid.file_voxel(from + step * Grid::new(dims, DVec3::ONE).voxel_at(index));
            VolumeError::invalid(origin, "data", format!("{value} at voxel {voxel}"), ALLOWED.to_owned())
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
        let Stated { labels, ids, colors, orientation } = Stated::read(path, access)?;
        let volume = self.with_placed_labels((labels, orientation), path, has_spacing, access)?;
        Ok(Self { label_ids: ids, label_colors: colors, ..volume })
    }

    /// The same volume with labels, and how these lie in the patient.
    fn with_placed_labels(
        self,
        (labels, orientation): (Labels, Option<Orientation>),
        path: &Path,
        has_spacing: bool,
        access: &Access,
    ) -> Result<Self, VolumeError> {
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
        self.label_ids = None;
        self.label_colors = Vec::new();
        Ok(self)
    }

    /// The same volume with the numbers that its labels stand for, ascending from that of label 0, which is 0 ([`Self::label_ids`]).
    #[doc(hidden)]
    pub fn with_label_ids(self, ids: Arc<[u64]>) -> Self {
        Self { label_ids: Some(ids), ..self }
    }

    /// All labels, x fastest, then y, then z; `None` if the volume is not segmented.
    pub fn labels(&self) -> Option<&[u16]> {
        self.labels.as_deref()
    }

    /// The names of labels, where known: of a segmented volume, or of one whose values are labels.
    pub fn label_names(&self) -> &BTreeMap<u16, String> {
        &self.label_names
    }

    /// The numbers of labels in the file, by label from 0 on, ascending: of a segmented volume, or of one whose values are labels. `None` if these are the
    /// labels themselves. A file with numbers beyond 65535 is read as labels that take their places: label 0 is 0, and the others follow in order.
    pub fn label_ids(&self) -> Option<&[u64]> {
        self.label_ids.as_deref()
    }

    /// The number of a label in the file.
    pub fn label_id(&self, label: u16) -> u64 {
        self.label_ids().and_then(|ids| ids.get(usize::from(label))).map_or(u64::from(label), |&id| id)
    }

    /// The label that stands for a number in the file; `None` if none does.
    pub fn label_of_id(&self, id: u64) -> Option<u16> {
        label_of(id, self.label_ids())
    }

    /// The colours (red, green and blue in [0, 1]) that the file of a segmented volume's labels states for them, in ascending order of labels.
    pub fn label_colors(&self) -> &[(f64, DVec3)] {
        &self.label_colors
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
