//! Volumes that are read by boxes, level by level (SPEC §13).

use std::fmt::Debug;

use glam::UVec3;

use super::{Grid, VolumeError};

/// A volume that is read by boxes (SPEC §13): one channel at one time.
///
/// Boxes lie within a level's grid, and may have any place and size there; a box of whole chunks is read best. Several threads may read at once.
pub trait Store: Send + Sync + Debug {
    /// The levels from the finest, at least one.
    fn levels(&self) -> &[StoreLevel];

    /// Reads the values of a box of voxels of a level, x fastest: `values.len()` is the product of `dims`. A value that is not finite makes a hole. Returns
    /// the number of bytes read from the store (compressed); where threads read at once, one may return what another has read, but their sum is exact.
    ///
    /// # Errors
    /// If the box does not lie in the level, or the store cannot be read or is damaged there. The error names the chunk. `values` may then hold anything.
    fn read(&self, level: usize, from: UVec3, dims: UVec3, values: &mut [f32]) -> Result<u64, VolumeError>;

    /// Whether the store holds a chunk; all values of one that it does not hold are [`Self::fill`]. `chunk` counts chunks of [`StoreLevel::chunk`] voxels.
    ///
    /// # Errors
    /// If the level has no such chunk, or the store cannot be read.
    fn contains(&self, level: usize, chunk: UVec3) -> Result<bool, VolumeError>;

    /// The value of every voxel in a chunk that the store does not hold.
    fn fill(&self) -> f32;

    /// A hash, as hexadecimal digits, of what identifies the store's values: its metadata, never paths or times.
    fn identity(&self) -> String;
}

/// A level of a [`Store`]: the volume at one resolution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StoreLevel {
    /// Its voxels.
    pub grid: Grid,
    /// The number of voxels along x, y and z of a chunk as it is read best: of an inner chunk, where chunks lie in shards.
    pub chunk: UVec3,
}
