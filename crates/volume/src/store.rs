//! Volumes that are read by boxes, level by level (SPEC §13).

use std::collections::BTreeMap;
use std::fmt::Debug;
use std::path::Path;

use glam::{DVec3, UVec3};

use super::error::volume::invalid;
use super::{ChannelDisplay, Encoding, Grid, Orientation, Texel, VolumeError};

/// A volume that is read by boxes (SPEC §13): one channel at one time.
///
/// Boxes lie within a level's grid, and may have any place and size there; a box of whole chunks is read best. Several threads may read at once.
pub trait Store: Send + Sync + Debug {
    /// The levels from the finest, at least one.
    fn levels(&self) -> &[StoreLevel];

    /// Reads the values of a box of voxels of a level, x fastest: `values.len()` is the product of `dims`. A value that is not finite makes a hole. Returns
    /// the number of bytes of chunks that were read (compressed).
    ///
    /// # Errors
    /// If the box does not lie in the level, or the store cannot be read or is damaged there. The error names the chunk. `values` may then hold anything.
    fn read(&self, level: usize, from: UVec3, dims: UVec3, values: &mut [f32]) -> Result<u64, VolumeError>;

    /// Whether voxels have colours of their own (SPEC §10); values are then their luminances.
    fn has_colors(&self) -> bool {
        false
    }

    /// As [`Self::read`], with the colours of the box's voxels, as many as values. A store implements it that has any. Voxels of a chunk that it does not hold
    /// are transparent.
    ///
    /// # Errors
    /// As for [`Self::read`]. `colors` may then hold anything, too.
    fn read_colors(
        &self,
        level: usize,
        from: UVec3,
        dims: UVec3,
        values: &mut [f32],
        _colors: &mut [Texel],
    ) -> Result<u64, VolumeError> {
        self.read(level, from, dims, values)
    }

    /// Whether the store holds a chunk; all values of one that it does not hold are [`Self::fill`]. `chunk` counts chunks of [`StoreLevel::chunk`] voxels.
    ///
    /// # Errors
    /// If the level has no such chunk, or the store cannot be read.
    fn contains(&self, level: usize, chunk: UVec3) -> Result<bool, VolumeError>;

    /// The value of every voxel in a chunk that the store does not hold.
    fn fill(&self) -> f32;

    /// Whether reading a part of a chunk takes as long as reading all of it, so that it is better kept than read again.
    fn decodes_whole_chunks(&self) -> bool {
        false
    }

    /// The maximum number of bytes that reading all values of a level into a [`Volume`](super::Volume) takes; a level that the store lacks takes 0. A volume
    /// for which more than the memory limit is needed is streamed.
    fn memory(&self, level: usize) -> u64 {
        values_of(self.levels(), level).saturating_mul(size_of::<f32>() as u64)
    }

    /// The minimum and maximum of a level's values, holes aside, if the store knows them. Images of a volume classified after splatting then have the same bytes as those of
    /// one in memory, whose numbers are scaled by this range; else the same to rounding.
    fn range(&self, _level: usize) -> Option<[f32; 2]> {
        None
    }

    /// The minimum and maximum of a chunk's values, holes aside, if the store knows them: the minimum is the larger one if all are holes. A chunk none of whose
    /// values can matter is not read.
    fn chunk_range(&self, _level: usize, _chunk: UVec3) -> Option<[f32; 2]> {
        None
    }

    /// The facts that the file states beside grids and values.
    fn facts(&self) -> StoreFacts {
        StoreFacts::default()
    }

    /// A hash, as hexadecimal digits, of what identifies the store's values: its metadata, never paths or times.
    fn identity(&self) -> String;
}

/// The number of voxels of one of some levels; 0 for a level that is not among them.
pub(super) fn values_of(levels: &[StoreLevel], level: usize) -> u64 {
    levels.get(level).map_or(0, |level| level.grid.voxels())
}

/// The facts that a file states about a volume beside its grid and values.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct StoreFacts {
    /// How the values are stored.
    pub encoding: Option<Encoding>,
    /// The distance between the finest level's voxels in world units, if the file states it.
    pub spacing: Option<DVec3>,
    /// The name of the world unit.
    pub unit: Option<String>,
    /// The unit of the values.
    pub value_unit: Option<String>,
    /// How the volume lies in the patient.
    pub orientation: Option<Orientation>,
    /// The colours (red, green and blue in [0, 1]) of values, in ascending order.
    pub palette: Option<Vec<(f64, DVec3)>>,
    /// The names of values, if they are labels.
    pub label_names: BTreeMap<u16, String>,
    /// Whether the file says that all values are labels, with or without names.
    pub are_labels: bool,
    /// The order of axes that was assumed, if the file states none.
    pub assumed_axes: Option<&'static str>,
    /// The channel's name.
    pub channel_name: Option<String>,
    /// How the channel is shown.
    pub display: Option<ChannelDisplay>,
    /// The marks that tell the file's times apart, from the first on, where they are more than their numbers.
    pub time_names: Vec<String>,
    /// The series among which a folder's was chosen, in the order of their numbers from 0; empty if there is only one.
    pub series_names: Vec<String>,
}

/// A level of a [`Store`]: the volume at one resolution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StoreLevel {
    /// Its voxels.
    pub grid: Grid,
    /// The number of voxels along x, y and z of a chunk as it is read best: of an inner chunk, where chunks lie in shards.
    pub chunk: UVec3,
}

impl StoreLevel {
    /// The number of chunks along x, y and z.
    pub fn chunks(&self) -> UVec3 {
        UVec3::from_array([0, 1, 2].map(|axis| self.grid.dims[axis].div_ceil(self.chunk[axis])))
    }
}

/// Checks that a box lies in a level, and that there is a value for each of its voxels.
pub(super) fn check_box(
    path: &Path,
    levels: &[StoreLevel],
    level: usize,
    (from, dims): (UVec3, UVec3),
    values: usize,
) -> Result<(), VolumeError> {
    let grid = level_of(path, levels, level)?.grid;
    let is_within = |axis: usize| dims[axis] > 0 && from[axis].checked_add(dims[axis]) <= Some(grid.dims[axis]);
    let is_within = [0, 1, 2].map(|axis| is_within(axis) && from[axis] < grid.dims[axis]) == [true; 3];
    if !is_within {
        let allowed = format!("a box within the {} voxels of level {level}", grid.dims);
        return Err(invalid(path, "box", format!("{dims} voxels from {from}"), allowed));
    }
    let count = dims.as_u64vec3().element_product();
    if count != values as u64 {
        return Err(invalid(path, "values", values, format!("{count}, one for each voxel of the box")));
    }
    Ok(())
}

/// Checks that a level has a chunk.
pub(super) fn check_chunk(path: &Path, levels: &[StoreLevel], level: usize, chunk: UVec3) -> Result<(), VolumeError> {
    let chunks = level_of(path, levels, level)?.chunks();
    if chunk.cmplt(chunks).all() {
        return Ok(());
    }
    Err(invalid(path, "chunk", chunk, format!("a chunk of level {level}, which has {chunks}")))
}

fn level_of<'a>(path: &Path, levels: &'a [StoreLevel], level: usize) -> Result<&'a StoreLevel, VolumeError> {
    levels.get(level).ok_or_else(|| invalid(path, "level", level, format!("0 to {}", levels.len() - 1)))
}
