//! The open pixels that a footprint reaches (§6, SPEC §6), listed before anything is added to them: what is computed for each of them fills vectors, and
//! the loop that adds has no branch.

use fearless_simd::prelude::*;

use super::cull::{OpenMask, Pixels};
use super::sheets::{COLUMNS, ROWS};
use super::vector::LANES;

/// The pixels of the largest vector.
pub(super) const WIDEST: usize = 2 * LANES;

/// The pixels from which on a list is full.
const FULL: usize = 512;

/// A footprint more fits in, whatever its size, and a whole vector behind its last pixel.
const CAPACITY: usize = FULL + ROWS * COLUMNS + WIDEST;

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

    /// Lists the open pixels of a box that a footprint reaches. `footprint` tells of a vector of pixels, given by their offsets from its centre, which are
    /// reached, and numbers for them. It must be inlined, or its vectors would be computed by calls.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn list<S: Simd, V: SimdFloat<S, Element = f32>, const N: usize>(
        &mut self,
        simd: S,
        center: [f32; 2],
        pixels: &Pixels,
        open: &OpenMask,
        footprint: impl Fn([V; 2]) -> (V::Mask, [V; N]),
    ) {
        let (across, down) = if V::LEN > LANES { (LANES, V::LEN / LANES) } else { (V::LEN, 1) };
        let Pixels { columns: [left, right], rows: [first, last] } = *pixels;
        let (list, lists) = (&mut *self.pixels, &mut *self.numbers);
        let mut count = self.count.min(FULL);
        let mut column = left;
        while column <= right {
            // A difference of whole numbers and the centre is rounded once, wherever a vector begins.
            let dx = V::from_slice(simd, &COLUMN[..V::LEN]) + column as f32 - center[0];
            let mut rows = V::from_slice(simd, &ROW[..V::LEN]) + first as f32;
            let mut indices = V::Bits::from_slice(simd, &INDEX[..V::LEN]) + (first * COLUMNS + column) as u32;
            let mut row = first;
            while row <= last {
                let (is_reached, numbers) = footprint([dx, rows - center[1]]);
                let is_open = (0..down).fold(0, |bits, next| bits | open.bits(row + next, column, across) << (next * across));
                let bits = is_reached.to_bitmask() & is_open;
                let listed = V::Mask::from_bitmask(simd, bits);
                indices.compress(<V::Bits as SimdBase<S>>::Mask::from_bitmask(simd, bits)).store_slice(&mut list[count..count + V::LEN]);
                for (list, numbers) in lists.iter_mut().zip(&numbers) {
                    numbers.compress(listed).store_slice(&mut list[count..count + V::LEN]);
                }
                count += bits.count_ones() as usize;
                rows += down as f32;
                indices += (down * COLUMNS) as u32;
                row += down;
            }
            column += across;
        }
        self.count = count;
    }
}

/// For each pixel of the largest vector its column and row, counted from the first one, and its index in a tile.
const COLUMN: [f32; WIDEST] = {
    let mut all = [0.0; WIDEST];
    let mut at = 0;
    while at < WIDEST {
        all[at] = (at % LANES) as f32;
        at += 1;
    }
    all
};
const ROW: [f32; WIDEST] = {
    let mut all = [0.0; WIDEST];
    let mut at = 0;
    while at < WIDEST {
        all[at] = (at / LANES) as f32;
        at += 1;
    }
    all
};
const INDEX: [u32; WIDEST] = {
    let mut all = [0; WIDEST];
    let mut at = 0;
    while at < WIDEST {
        all[at] = (at / LANES * COLUMNS + at % LANES) as u32;
        at += 1;
    }
    all
};
