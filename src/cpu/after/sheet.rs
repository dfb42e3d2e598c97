//! The sheet of one slab where classification comes after splatting (SPEC §9): what every channel adds to the pixels of a tile, until it is composited.

use fearless_simd::f32x8;
use fearless_simd::prelude::*;

use crate::cpu::sheets::{CHANNELS, ROWS, Sheet, VECTORS};
use crate::cpu::vector::LANES;

/// Eight pixels of a slab, by channel.
type Sums = [[f32; LANES]; CHANNELS];

/// The sheet of a slab.
#[derive(Debug)]
pub(super) struct SlabSheet {
    rows: Vec<[Sums; VECTORS]>,
    /// For every row the bits of its vectors that are not empty.
    written: [u8; ROWS],
}

impl SlabSheet {
    /// An empty one.
    pub(super) fn new() -> Self {
        Self { rows: vec![[[[0.0; LANES]; CHANNELS]; VECTORS]; ROWS], written: [0; ROWS] }
    }

    /// Adds a channel's amounts to eight pixels, from a column on.
    #[inline(always)]
    pub(super) fn add<S: Simd>(&mut self, simd: S, [column, row]: [usize; 2], amounts: [f32x8<S>; CHANNELS]) {
        let vector = column / LANES;
        let is_first = self.written[row] >> vector & 1 == 0;
        self.written[row] |= 1 << vector;
        for (sums, amounts) in self.rows[row][vector].iter_mut().zip(amounts) {
            let sum = if is_first { amounts } else { f32x8::load_array_ref(simd, sums) + amounts };
            *sums = sum.to_array();
        }
    }
}

impl Sheet for SlabSheet {
    fn rows(&self) -> u64 {
        self.written.iter().rev().fold(0, |rows, &written| rows << 1 | u64::from(written != 0))
    }

    #[inline(always)]
    fn take<S: Simd>(&mut self, simd: S, row: usize, vector: usize) -> Option<[f32x8<S>; CHANNELS]> {
        let bit = 1 << vector;
        let is_written = self.written[row] & bit != 0;
        self.written[row] &= !bit;
        is_written.then(|| self.rows[row][vector].each_ref().map(|sums| f32x8::load_array_ref(simd, sums)))
    }
}
