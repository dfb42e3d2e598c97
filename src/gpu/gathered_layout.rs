//! The layout of the tile rasterizer's results in their single buffer. It is computed once per view, and used by the stage's uniform, the
//! estimate of memory and the frame.

use std::mem::{offset_of, size_of};

use crate::geometry::view_geometry::ViewGeometry;
use crate::gpu::layout::{Gathered, Tally};
use crate::lists::patch_bins::{self, PatchBins};
use crate::lists::quad_plan::tile_grid;

/// The parts of [`Gathered::words`] in their order in memory, each by the index of its first word. The counts of composited tiles, one word per
/// sheet group, come first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GatheredLayout {
    /// The number of sheet groups.
    pub groups: u32,
    /// The number of bricks in the volume.
    pub bricks: u32,
    /// Bits of the voxels that have been drawn: 64 bits per brick for each of the groups that one kernel can reach, and in each of these for every layer.
    pub drawn: u32,
    /// Bits of the tiles that have been composited: one bit per 32×32 tile for every group.
    pub composited: u32,
    /// For every half of a block of every patch, the group at which its subgroup continues in the next dispatch.
    pub reached: u32,
    /// First hits, one per pixel. This part is also bound separately, so it starts at an aligned byte.
    pub hits: u32,
}

/// The number of words of [`Gathered`] before its `words`.
const WORDS_BEFORE: u32 = (offset_of!(Gathered, words) / 4) as u32;

/// The alignment of storage bindings in words: 256 bytes on any device.
const BINDING_WORDS: u32 = 64;

impl GatheredLayout {
    /// The layout for a view of a volume of `bricks` bricks, whose values are gathered in `layers` layers.
    pub fn new(view: &ViewGeometry, bins: &PatchBins, bricks: u32, layers: u32) -> Self {
        let drawn = bins.groups;
        let composited = drawn + 2 * bricks * layers * groups_per_kernel(view);
        let [columns, rows] = tile_grid(view.size);
        let reached = composited + (columns * rows * bins.groups).div_ceil(32);
        let end = reached + bins.patches * patch_bins::HALVES;
        let hits = (end + WORDS_BEFORE).next_multiple_of(BINDING_WORDS) - WORDS_BEFORE;
        Self { groups: bins.groups, bricks, drawn, composited, reached, hits }
    }

    /// The size in bytes of what a frame's statistics read: the tally and the counts of composited tiles.
    pub fn count_bytes(&self) -> u64 {
        size_of::<Tally>() as u64 + u64::from(self.groups) * 4
    }

    /// The byte offset of first hits.
    pub fn hits_byte(&self) -> u64 {
        offset_of!(Gathered, words) as u64 + u64::from(self.hits) * 4
    }
}

/// The maximum number of the tile rasterizer's groups that a kernel reaches.
fn groups_per_kernel(view: &ViewGeometry) -> u32 {
    (2.0 * view.reach / (f64::from(patch_bins::SHEETS) * view.slabs.width)).ceil() as u32 + 1
}
