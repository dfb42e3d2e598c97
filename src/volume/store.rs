//! Volumes that are read by boxes (SPEC §13).

use std::fmt;

use glam::UVec3;

use super::{Grid, VolumeError};

/// A volume that is read by boxes (SPEC §13).
pub trait Store: Send + Sync + fmt::Debug {
    /// The levels from the finest, at least one.
    fn levels(&self) -> &[StoreLevel];

    /// Reads the values of a box of voxels of a level, x fastest: `values.len()` is the product of `dims`. Returns the number of bytes read from
    /// the store.
    ///
    /// # Errors
    /// If the store cannot be read, or does not hold what its metadata promises.
    fn read(&self, level: usize, from: UVec3, dims: UVec3, values: &mut [f32]) -> Result<u64, VolumeError>;

    /// Whether the store holds a chunk; all values of one that it does not hold are [`Self::fill`].
    ///
    /// # Errors
    /// If the store cannot be read.
    fn contains(&self, level: usize, chunk: UVec3) -> Result<bool, VolumeError>;

    /// The value of voxels in chunks that the store does not hold.
    fn fill(&self) -> f32;

    /// A hash of what identifies the store's values: its metadata, never paths or times.
    fn identity(&self) -> String;
}

/// One resolution of a store.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StoreLevel {
    /// The voxels and their spacing in world units.
    pub grid: Grid,
    /// The number of voxels along x, y and z that are best read together.
    pub chunk: UVec3,
}
