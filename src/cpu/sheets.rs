//! A tile's buffers: the ring of open sheets that voxels are splatted into, and the compositing buffer.

use fearless_simd::prelude::*;
use fearless_simd::{f32x4, f32x8};

use super::vector::{LANES, columns};

/// Pixels along a row of a tile.
pub(super) const COLUMNS: usize = 32;
/// Rows of a tile.
pub(super) const ROWS: usize = 64;
/// Sheets that are open at a time: what kernels need where slabs are one voxel wide. Sheet s is in slot s mod 6.
pub(super) const RING: usize = 6;
/// Sheets that a voxel is drawn into at a time: one less than the ring holds, as the slot of the sheet before them may not be empty yet.
pub(super) const SECTIONS: usize = RING - 1;
/// Red, green, blue, opacity.
pub(super) const CHANNELS: usize = 4;

/// The vectors of a row's columns.
pub(super) const VECTORS: usize = COLUMNS / LANES;

/// All vectors of a row, as bits.
const ALL_VECTORS: u32 = u32::MAX >> (u32::BITS as usize - VECTORS);

/// A bit for each of a ring's slots, the first of its bits in [`Ring::written`].
const SLOTS: u32 = {
    let (mut slots, mut slot) = (0, 0);
    while slot < RING {
        slots |= 1 << (VECTORS * slot);
        slot += 1;
    }
    slots
};

/// Vectors of a pixel's sums: each holds all channels of two slots, the second of which is [`HALF_RING`] after the first.
pub(super) const HALF_RING: usize = RING / 2;

/// A pixel's sums for two of the open sheets. Aligned, so that none of them lies on two cache lines.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
pub(super) struct Sums(pub(super) [f32; 2 * CHANNELS]);

/// A pixel's sums for all open sheets.
pub(super) type PixelSums = [Sums; HALF_RING];

const NO_SUMS: PixelSums = [Sums([0.0; 2 * CHANNELS]); HALF_RING];

/// The open sheets of a tile. A pixel's sums for all of them lie together, so that a voxel adds to them by three multiplications and additions of vectors,
/// and the channels of a sheet do, so that it is taken out by few reads.
#[derive(Debug)]
pub(super) struct Ring {
    /// The sums of pixels, row by row.
    pub(super) pixels: Box<[PixelSums; ROWS * COLUMNS]>,
    /// Which vectors of a row's columns are not empty: those of the first slot in the lowest bits, and so on.
    written: [u32; ROWS],
}

/// A sheet, as compositing (eq. 2) reads it.
pub(super) trait Sheet {
    /// The bits of the rows that are not empty.
    fn rows(&self) -> u64;

    /// Removes the sums of a vector of a row's pixels from the sheet and returns them by channel; `None` if nothing was added to them.
    fn take<S: Simd>(&mut self, simd: S, row: usize, vector: usize) -> Option<[f32x8<S>; CHANNELS]>;
}

/// One of the open sheets.
pub(super) struct OpenSheet<'a> {
    ring: &'a mut Ring,
    slot: usize,
}

/// The buffers of one tile from which its image is made.
#[derive(Debug)]
pub(super) struct Buffers {
    /// The rows whose compositing buffer may hold a surface that is not reached yet.
    pub(super) kept: u64,
    /// The compositing buffer, row by row.
    pub(super) acc: Vec<[[f32; COLUMNS]; CHANNELS]>,
    /// Where the opacity asked for is reached, row by row, in slabs as [`TileRays`](super::cut::TileRays) counts them; infinite where it is not.
    pub(super) hits: Vec<[f32; COLUMNS]>,
}

impl Ring {
    /// Empty sheets.
    pub(super) fn new() -> Self {
        Self { pixels: Box::new([NO_SUMS; ROWS * COLUMNS]), written: [0; ROWS] }
    }

    /// Records that pixels within a box were written to in some slots, from one on.
    #[inline(always)]
    pub(super) fn mark(&mut self, columns: [usize; 2], rows: [usize; 2], slot: usize, count: usize) {
        let [first, last] = columns.map(|column| column / LANES);
        let vectors = ALL_VECTORS >> (VECTORS - 1 - last) & u32::MAX << first;
        // Slots wrap around from the last one to the first.
        let slots = SLOTS & !(u32::MAX << (VECTORS * count));
        let slots = (slots << (VECTORS * slot) | slots >> (VECTORS * (RING - slot))) & SLOTS;
        for row in &mut self.written[rows[0]..=rows[1]] {
            *row |= slots * vectors;
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.written == [0; ROWS]
    }

    /// One of the open sheets, given its number.
    pub(super) fn sheet(&mut self, sheet: i32) -> OpenSheet<'_> {
        OpenSheet { slot: slot_of(sheet), ring: self }
    }

    /// Makes all sheets empty, for the next tile.
    pub(super) fn clear(&mut self) {
        for (written, pixels) in self.written.iter_mut().zip(self.pixels.chunks_exact_mut(COLUMNS)) {
            if std::mem::take(written) != 0 {
                pixels.fill(NO_SUMS);
            }
        }
    }
}

impl OpenSheet<'_> {
    /// Makes it empty.
    pub(super) fn clear<S: Simd>(&mut self, simd: S) {
        for (row, vector) in (0..ROWS).flat_map(|row| (0..VECTORS).map(move |vector| (row, vector))) {
            self.take(simd, row, vector);
        }
    }
}

impl Sheet for OpenSheet<'_> {
    fn rows(&self) -> u64 {
        let is_filled = |written: &u32| written >> (VECTORS * self.slot) & ALL_VECTORS != 0;
        self.ring.written.iter().rev().fold(0, |rows, written| rows << 1 | u64::from(is_filled(written)))
    }

    #[inline(always)]
    fn take<S: Simd>(&mut self, simd: S, row: usize, vector: usize) -> Option<[f32x8<S>; CHANNELS]> {
        let bit = 1 << (VECTORS * self.slot + vector);
        if self.ring.written[row] & bit == 0 {
            return None;
        }
        self.ring.written[row] &= !bit;
        let (pair, first) = (self.slot % HALF_RING, self.slot / HALF_RING * CHANNELS);
        let pixels = &mut self.ring.pixels[row * COLUMNS + vector * LANES..][..LANES];
        let mut taken = [[0.0; CHANNELS]; LANES];
        for (taken, pixel) in taken.iter_mut().zip(pixels) {
            let sums = &mut pixel[pair].0[first..first + CHANNELS];
            f32x4::from_slice(simd, sums).store_slice(taken);
            sums.fill(0.0);
        }
        Some(columns(simd, taken.each_ref()))
    }
}

impl Buffers {
    /// Buffers of zeros.
    pub(super) fn new() -> Self {
        Self { kept: 0, acc: vec![[[0.0; COLUMNS]; CHANNELS]; ROWS], hits: vec![[f32::INFINITY; COLUMNS]; ROWS] }
    }

    /// Clears the buffers for the next tile.
    pub(super) fn clear(&mut self) {
        self.kept = 0;
        self.acc.fill([[0.0; COLUMNS]; CHANNELS]);
        self.hits.fill([f32::INFINITY; COLUMNS]);
    }
}

/// The slot of a sheet.
pub(super) fn slot_of(sheet: i32) -> usize {
    sheet.rem_euclid(RING as i32) as usize
}

/// Numbers for slots as vectors hold them: those of the first half, a number that belongs to no slot, those of the second half, and another one.
pub(super) type BySlot = [f32; LANES];
