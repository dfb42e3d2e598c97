//! The counts of a frame (SPEC §8). Several tiles may draw the same voxel, which counts once.

use std::ops::AddAssign;
use std::sync::atomic::{AtomicU64, Ordering};

use super::queue::BySlot;
use super::sheets::SECTIONS;
use crate::geometry::view_geometry::ViewGeometry;

/// The counts of some tiles. They are integers, so the order in which threads add them does not matter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Tally {
    pub(super) voxels_shaded: u64,
    pub(super) sections: u64,
    pub(super) tiles_composited: u64,
    pub(super) bricks_visited: u64,
}

impl AddAssign for Tally {
    fn add_assign(&mut self, other: Self) {
        self.voxels_shaded += other.voxels_shaded;
        self.sections += other.sections;
        self.tiles_composited += other.tiles_composited;
        self.bricks_visited += other.bricks_visited;
    }
}

/// Records which voxels any tile has shaded and which of their sections any tile has drawn, [`SECTIONS`] at a time.
#[derive(Debug, Default)]
pub(super) struct Drawn {
    /// The bits of every brick's voxels: those shaded, then by part those of which sections were drawn.
    marks: Vec<AtomicU64>,
    /// The number of such masks for a brick.
    pub(super) masks: usize,
}

impl Drawn {
    /// The record before any tile is drawn.
    pub(super) fn new(bricks: usize, view: &ViewGeometry) -> Self {
        Self::default().renewed(bricks, view)
    }

    /// The same, in the memory of another frame's.
    pub(super) fn renewed(self, bricks: usize, view: &ViewGeometry) -> Self {
        let most_sheets = 2.0 * view.reach / view.slabs.width + 2.0;
        let masks = 1 + (most_sheets as usize).div_ceil(SECTIONS);
        let mut marks = self.marks;
        marks.clear();
        marks.resize_with(bricks * masks, || AtomicU64::new(0));
        Self { marks, masks }
    }

    /// Adds what a tile has marked of a brick, given how many sections its voxels have.
    #[inline(always)]
    pub(super) fn add(&self, brick: u32, marks: &[u64], sections: &BySlot<u32>, tally: &mut Tally) {
        let all = &self.marks[brick as usize * self.masks..][..self.masks];
        for (mask, (all, &marks)) in all.iter().zip(marks).enumerate() {
            if marks == 0 {
                continue;
            }
            let new = marks & !all.fetch_or(marks, Ordering::Relaxed);
            if mask == 0 {
                tally.voxels_shaded += u64::from(new.count_ones());
                continue;
            }
            let before = (mask - 1) as u32 * SECTIONS as u32;
            // All slots, without a branch, so that the loop is vectorized.
            let mut sum = 0;
            for (slot, sections) in (0..).zip(sections) {
                let all_ones_if_new = ((new >> slot) as u32 & 1).wrapping_neg();
                sum += sections.saturating_sub(before).min(SECTIONS as u32) & all_ones_if_new;
            }
            tally.sections += u64::from(sum);
        }
    }
}

/// The numbers of the bits that are set.
pub(super) fn bits(mut mask: u64) -> impl Iterator<Item = u32> {
    std::iter::from_fn(move || {
        let bit = mask.trailing_zeros();
        (mask != 0).then(|| {
            mask &= mask - 1;
            bit
        })
    })
}
