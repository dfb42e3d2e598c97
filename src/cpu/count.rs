//! The counts of a frame (SPEC §8). Several tiles may draw the same voxel, which counts once.

use std::ops::AddAssign;
use std::sync::atomic::{AtomicU64, Ordering};

use super::sheets::SECTIONS;
use crate::geometry::view_geometry::ViewGeometry;

/// The counts of some tiles. They are integers, so the order in which threads add them does not matter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Tally {
    pub(super) voxels_shaded: u64,
    pub(super) sections: u64,
    pub(super) sheets_composited: u64,
    pub(super) bricks_visited: u64,
}

impl AddAssign for Tally {
    fn add_assign(&mut self, other: Self) {
        self.voxels_shaded += other.voxels_shaded;
        self.sections += other.sections;
        self.sheets_composited += other.sheets_composited;
        self.bricks_visited += other.bricks_visited;
    }
}

/// Records which voxels any tile has shaded and which of their sections any tile has drawn, [`SECTIONS`] at a time.
#[derive(Debug)]
pub(super) struct Drawn {
    shaded: Vec<AtomicU64>,
    sections: Vec<AtomicU64>,
    /// The number of bits for each voxel.
    parts: usize,
}

impl Drawn {
    /// The record before any tile is drawn.
    pub(super) fn new(bricks: usize, view: &ViewGeometry) -> Self {
        let most_sheets = 2.0 * view.reach / view.slabs.width + 2.0;
        let parts = (most_sheets as usize).div_ceil(SECTIONS);
        let zeros = |count: usize| (0..count).map(|_| AtomicU64::new(0)).collect();
        Self { shaded: zeros(bricks), sections: zeros(bricks * parts), parts }
    }

    /// Counts a shaded voxel, given by brick and slot.
    pub(super) fn shade(&self, [brick, slot]: [u32; 2], tally: &mut Tally) {
        tally.voxels_shaded += is_first(&self.shaded[brick as usize], slot);
    }

    /// Counts some sections of a voxel.
    pub(super) fn splat(&self, [brick, slot]: [u32; 2], part: u32, sections: u64, tally: &mut Tally) {
        let part = (part as usize).min(self.parts - 1);
        tally.sections += sections * is_first(&self.sections[brick as usize * self.parts + part], slot);
    }
}

/// Sets a bit. Returns 1 if it was not set before, else 0.
fn is_first(bits: &AtomicU64, slot: u32) -> u64 {
    // Most voxels are drawn by one tile only, so testing the bit first would not pay.
    u64::from(bits.fetch_or(1 << slot, Ordering::Relaxed) >> slot & 1 == 0)
}
