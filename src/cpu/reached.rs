//! The open pixels that a footprint reaches (§6, SPEC §6), listed before anything is added to them: what is computed for each of them fills vectors, and
//! the loop that adds has no branch.

use fearless_simd::prelude::*;
use fearless_simd::{f32x8, mask32x8, u32x8};

use super::cull::{OpenMask, Pixels};
use super::sheets::{COLUMNS, ROWS};
use super::vector::{LANES, iota};

/// The pixels from which on a list is full.
const FULL: usize = 512;

/// A footprint more fits in, whatever its size, and a whole vector behind its last pixel.
const CAPACITY: usize = FULL + ROWS * COLUMNS + LANES;

/// A list of pixels, those of one footprint after those of another.
#[derive(Debug)]
pub(super) struct Reached {
    pub(super) count: usize,
    /// Their indices in the tile.
    pub(super) pixels: Box<[u32; CAPACITY]>,
    /// Numbers for each of them; what they mean depends on who lists them.
    pub(super) numbers: Box<[[f32; CAPACITY]; 2]>,
}

impl Reached {
    pub(super) fn new() -> Self {
        Self { count: 0, pixels: Box::new([0; CAPACITY]), numbers: Box::new([[0.0; CAPACITY]; 2]) }
    }

    /// Whether there may be no room for another footprint.
    pub(super) fn is_full(&self) -> bool {
        self.count >= FULL
    }

    /// Lists the open pixels of a box that a footprint reaches. `footprint` tells of eight pixels, given by their offsets from its centre, which are
    /// reached, and numbers for them. It must be inlined, or its vectors would be computed by calls.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn list<S: Simd, const N: usize>(
        &mut self,
        simd: S,
        center: [f32; 2],
        pixels: &Pixels,
        open: &OpenMask,
        footprint: impl Fn(f32x8<S>, f32) -> (mask32x8<S>, [f32x8<S>; N]),
    ) {
        let Pixels { columns: [left, right], rows: [first, last] } = *pixels;
        let (list, lists) = (&mut *self.pixels, &mut *self.numbers);
        let mut count = self.count.min(FULL);
        let mut column = left;
        while column <= right {
            let dx = iota(simd) + (column as f32 - center[0]);
            let columns = u32x8::load_array(simd, [0, 1, 2, 3, 4, 5, 6, 7]) + column as u32;
            for (row, open) in (first..).zip(open.rows_between(first, last)) {
                let (is_reached, numbers) = footprint(dx, row as f32 - center[1]);
                let bits = is_reached.to_bitmask() & u64::from(open >> column & 0xff);
                let listed = mask32x8::from_bitmask(simd, bits);
                (columns + (row * COLUMNS) as u32).compress(listed).store_slice(&mut list[count..count + LANES]);
                for (list, numbers) in lists.iter_mut().zip(&numbers) {
                    numbers.compress(listed).store_slice(&mut list[count..count + LANES]);
                }
                count += bits.count_ones() as usize;
            }
            column += LANES;
        }
        self.count = count;
    }
}
