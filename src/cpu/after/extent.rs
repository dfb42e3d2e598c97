//! A box of a volume's voxels, and what a tile holds of it.

use std::ops::Range;

use glam::UVec3;

use super::cells::Cells;
use crate::volume::{Grid, Volume};

/// Voxels around those that kernels reach: for the cells of points on borders, rounded, and for differences between neighbours.
pub(super) const RIM: f64 = 2.0;

/// A box of a volume's voxels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    /// The volume's voxels along each axis.
    pub(super) dims: UVec3,
    /// The first voxel of the box.
    pub(super) low: UVec3,
    /// Its voxels along each axis.
    pub(super) held: UVec3,
}

impl Extent {
    /// All voxels.
    pub(super) fn whole(grid: &Grid) -> Self {
        Self { dims: grid.dims, low: UVec3::ZERO, held: grid.dims }
    }

    /// The index of one of the voxels in the box.
    #[inline(always)]
    pub(super) fn index(&self, voxel: UVec3) -> usize {
        let [x, y, z] = (voxel - self.low).to_array().map(|n| n as usize);
        x + self.held.x as usize * (y + self.held.y as usize * z)
    }
}

/// The voxels around the points of some slabs' open pixels.
#[derive(Debug)]
pub(super) struct Held {
    /// The slabs.
    pub(super) slabs: Range<i32>,
    pub(super) extent: Extent,
    pub(super) volume: Volume,
    /// Where values can meet an opacity; `None` where all values count.
    pub(super) cells: Option<Cells>,
    /// Whether no value can meet an opacity.
    pub(super) is_blank: bool,
    /// The chunks that share voxels with the box, and whose voxels nothing needed when it was copied: there are holes in their place.
    pub(super) missing: Vec<u32>,
}
