//! Where the tile rasterizer's results lie in their one buffer: computed once per view, and used by the stage's uniform, the estimate of memory and
//! the frame.

use std::mem::{offset_of, size_of};

use crate::geometry::view_geometry::ViewGeometry;
use crate::gpu::layout::{Gathered, Tally};
use crate::lists::patch_bins::{self, PatchBins};
use crate::lists::quad_plan::tile_grid;

/// The parts of [`Gathered::words`], each by the index of its first word, in their order in memory. Counts of composited tiles, one word per sheet group,
/// come first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GatheredLayout {
    /// Sheet groups.
    pub groups: u32,
    /// Bricks of the volume.
    pub bricks: u32,
    /// Bits of the voxels that have been drawn: for every group of those that one kernel reaches into, 64 bits per brick.
    pub drawn: u32,
    /// Bits of the tiles that have been composited: for every group one bit per 32×32 tile.
    pub composited: u32,
    /// For every block of every patch, the group at which its subgroup goes on in the next dispatch.
    pub reached: u32,
    /// First hits, for every pixel. This part is also bound by itself, so it starts at an aligned byte.
    pub hits: u32,
}

/// Words of [`Gathered`] before its `words`.
const WORDS_BEFORE: u32 = (offset_of!(Gathered, words) / 4) as u32;

/// Storage bindings start at multiples of 256 bytes on any device: 64 words.
const BINDING_WORDS: u32 = 64;

impl GatheredLayout {
    /// The layout for a view of a volume of `bricks` bricks.
    pub fn new(view: &ViewGeometry, bins: &PatchBins, bricks: u32) -> Self {
        let drawn = bins.groups;
        let composited = drawn + 2 * bricks * groups_per_kernel(view);
        let [columns, rows] = tile_grid(view.size);
        let reached = composited + (columns * rows * bins.groups).div_ceil(32);
        let end = reached + bins.patches * patch_bins::BLOCKS;
        let hits = (end + WORDS_BEFORE).next_multiple_of(BINDING_WORDS) - WORDS_BEFORE;
        Self { groups: bins.groups, bricks, drawn, composited, reached, hits }
    }

    /// Bytes of what a frame's statistics read: the tally, and the counts of composited tiles.
    pub fn count_bytes(&self) -> u64 {
        size_of::<Tally>() as u64 + u64::from(self.groups) * 4
    }

    /// The byte at which first hits start.
    pub fn hits_byte(&self) -> u64 {
        offset_of!(Gathered, words) as u64 + u64::from(self.hits) * 4
    }
}

/// The largest number of the tile rasterizer's groups that a kernel reaches into.
fn groups_per_kernel(view: &ViewGeometry) -> u32 {
    (2.0 * view.reach / (f64::from(patch_bins::SHEETS) * view.slabs.width)).ceil() as u32 + 1
}
