//! A tile's buffers: the ring of open sheets that voxels are splatted into, the sheet that is composited next, and the compositing buffer.

use super::vector::LANES;

/// Pixels along a row of a tile.
pub(super) const COLUMNS: usize = 32;
/// Rows of a tile.
pub(super) const ROWS: usize = 32;
/// Sheets that are open at a time, a vector of them. Sheet s is in slot s mod 8.
pub(super) const RING: usize = LANES;
/// Sheets that a voxel is drawn into at a time: one less than the ring holds, as the slot of the sheet before them may not be empty yet.
pub(super) const SECTIONS: usize = RING - 1;
/// Red, green, blue, opacity.
pub(super) const CHANNELS: usize = 4;

/// The columns that share a bit of [`Ring::written`].
const BLOCK: usize = COLUMNS / u8::BITS as usize;

/// A pixel's sums for all open sheets, by slot. Aligned, so that none of them lies on two cache lines.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
pub(super) struct Sums(pub(super) [f32; RING]);

/// The open sheets of a tile. A pixel's sums for all of them lie together, a vector for each channel with a number for each slot: a voxel
/// adds to them by a multiplication and an addition for each channel.
#[derive(Debug)]
pub(super) struct Ring {
    /// The sums of pixels, row by row.
    pub(super) pixels: Vec<[Sums; CHANNELS]>,
    /// Which columns of a row are not empty: byte s has a bit for every 4 columns of slot s.
    written: [u64; ROWS],
}

/// One sheet, row by row.
#[derive(Debug)]
pub(super) struct Sheet {
    pub(super) rows: Vec<[[f32; COLUMNS]; CHANNELS]>,
    /// The bits of the rows that are not empty.
    pub(super) written: u64,
}

/// The buffers of one tile from which its image is made.
#[derive(Debug)]
pub(super) struct Buffers {
    /// The sheet that is composited next.
    pub(super) sheet: Sheet,
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
        Self { pixels: vec![[Sums([0.0; RING]); CHANNELS]; ROWS * COLUMNS], written: [0; ROWS] }
    }

    /// Records that pixels within a box were written to in some slots, from one on.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn mark(&mut self, columns: [usize; 2], rows: [usize; 2], slot: usize, count: usize) {
        let [first, last] = columns.map(|column| column / BLOCK);
        let blocks = u64::from(u8::MAX) >> (u8::BITS as usize - 1 - last) & u64::MAX << first;
        // The byte 1 for each of the slots.
        let ones = u64::MAX / u64::from(u8::MAX);
        let slots = (ones & !(u64::MAX << (8 * count))).rotate_left(8 * slot as u32);
        for row in &mut self.written[rows[0]..=rows[1]] {
            *row |= slots * blocks;
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.written == [0; ROWS]
    }

    /// Moves the sheet of a slot into an empty one.
    pub(super) fn take(&mut self, slot: usize, sheet: &mut Sheet) {
        for (row, written) in self.written.iter_mut().enumerate() {
            let mut blocks = (*written >> (8 * slot)) as u8;
            if blocks == 0 {
                continue;
            }
            *written &= !(u64::from(u8::MAX) << (8 * slot));
            sheet.written |= 1 << row;
            let target = &mut sheet.rows[row];
            while blocks != 0 {
                let column = blocks.trailing_zeros() as usize * BLOCK;
                blocks &= blocks - 1;
                let pixels = &mut self.pixels[row * COLUMNS + column..];
                for (column, sums) in (column..column + BLOCK).zip(pixels) {
                    for (target, sums) in target.iter_mut().zip(sums) {
                        target[column] = std::mem::take(&mut sums.0[slot]);
                    }
                }
            }
        }
    }

    /// Makes all sheets empty, for the next tile.
    pub(super) fn clear(&mut self) {
        for (written, pixels) in self.written.iter_mut().zip(self.pixels.chunks_exact_mut(COLUMNS)) {
            if std::mem::take(written) != 0 {
                pixels.fill([Sums([0.0; RING]); CHANNELS]);
            }
        }
    }
}

impl Sheet {
    /// An empty one.
    pub(super) fn new() -> Self {
        Self { rows: vec![[[0.0; COLUMNS]; CHANNELS]; ROWS], written: 0 }
    }
}

impl Buffers {
    /// Buffers of zeros.
    pub(super) fn new() -> Self {
        Self {
            sheet: Sheet::new(),
            kept: 0,
            acc: vec![[[0.0; COLUMNS]; CHANNELS]; ROWS],
            hits: vec![[f32::INFINITY; COLUMNS]; ROWS],
        }
    }

    /// Clears the buffers for the next tile. A composited sheet is already empty.
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
