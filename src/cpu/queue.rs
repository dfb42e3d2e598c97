//! The voxels of a tile that wait for their first sheet, or plane: by brick, as bits.

use std::collections::VecDeque;

use fearless_simd::i32x8;
use fearless_simd::prelude::*;

use super::vector::LANES;
use crate::lists::brick::BRICK_VOXELS;

/// The first sheet of a voxel that has none.
pub(super) const NO_SHEET: i32 = i32::MAX;

/// Numbers for the voxels of a brick, by slot.
pub(super) type BySlot<T> = [T; BRICK_VOXELS as usize];

/// Voxels of a brick that wait for their first sheet.
#[derive(Clone, Copy, Debug)]
pub(super) struct Waiting {
    /// The index of their brick among those that have arrived.
    pub(super) brick: u32,
    /// The bits of their slots.
    pub(super) voxels: u64,
}

/// The waiting voxels by sheet, from the current one.
#[derive(Debug, Default)]
pub(super) struct Queue {
    lists: VecDeque<Vec<Waiting>>,
    /// Empty lists to be used again.
    spare: Vec<Vec<Waiting>>,
    /// The number of entries of all lists.
    count: usize,
}

impl Queue {
    pub(super) fn is_empty(&self) -> bool {
        self.count == 0
    }

    pub(super) fn clear(&mut self) {
        self.spare.extend(self.lists.drain(..));
        self.count = 0;
    }

    /// Lets voxels of a brick wait for their first sheets, given for all slots; those before the current sheet count as it.
    #[inline(always)]
    pub(super) fn add<S: Simd>(&mut self, simd: S, waiting: Waiting, first_sheets: &BySlot<i32>, current: i32) {
        let Waiting { brick, voxels: mut left } = waiting;
        while left != 0 {
            let first = first_sheets[left.trailing_zeros() as usize % first_sheets.len()];
            let voxels = left & equal(simd, first_sheets, first);
            left &= !voxels;
            if first == NO_SHEET {
                continue;
            }
            let ahead = (first - current).max(0) as usize;
            while self.lists.len() <= ahead {
                self.lists.push_back(self.spare.pop().map_or_else(Vec::new, cleared));
            }
            self.lists[ahead].push(Waiting { brick, voxels });
            self.count += 1;
        }
    }

    /// The voxels that wait for the current sheet, if any do; the next sheet is the current one from now on.
    pub(super) fn advance(&mut self) -> Option<Vec<Waiting>> {
        let list = self.lists.pop_front()?;
        self.count -= list.len();
        Some(list)
    }

    /// Takes a list back, for its memory.
    pub(super) fn reuse(&mut self, list: Vec<Waiting>) {
        self.spare.push(list);
    }
}

/// The bits of the numbers that equal one.
#[inline(always)]
fn equal<S: Simd>(simd: S, numbers: &BySlot<i32>, to: i32) -> u64 {
    let to = i32x8::splat(simd, to);
    let mut bits = 0;
    for at in (0..numbers.len()).step_by(LANES) {
        bits |= i32x8::from_slice(simd, &numbers[at..at + LANES]).simd_eq(to).to_bitmask() << at;
    }
    bits
}

fn cleared(mut list: Vec<Waiting>) -> Vec<Waiting> {
    list.clear();
    list
}
