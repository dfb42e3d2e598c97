//! A tile's buffers: the ring of open sheets that voxels are splatted into, the sheet that is composited next, and the compositing buffer.

use super::vector::LANES;

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

/// The columns that share a bit of [`Ring::written`].
const BLOCK: usize = COLUMNS / u8::BITS as usize;

/// The bytes of a ring's slots.
const RING_BYTES: u64 = u64::MAX >> (u64::BITS as usize - 8 * RING);

/// All vectors of a row.
pub(super) const ALL_VECTORS: u8 = u8::MAX >> (u8::BITS as usize - COLUMNS / LANES);

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
    pub(super) pixels: Vec<PixelSums>,
    /// Which columns of a row are not empty: byte s has a bit for every 4 columns of slot s.
    written: [u64; ROWS],
}

/// One sheet, row by row.
#[derive(Debug)]
pub(super) struct Sheet {
    pub(super) rows: Vec<[[f32; COLUMNS]; CHANNELS]>,
    /// The bits of the rows that are not empty.
    pub(super) written: u64,
    /// For every row the bits of its vectors of columns that are not empty.
    pub(super) vectors: [u8; ROWS],
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
        Self { pixels: vec![NO_SUMS; ROWS * COLUMNS], written: [0; ROWS] }
    }

    /// Records that pixels within a box were written to in some slots, from one on.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn mark(&mut self, columns: [usize; 2], rows: [usize; 2], slot: usize, count: usize) {
        let [first, last] = columns.map(|column| column / BLOCK);
        let blocks = u64::from(u8::MAX) >> (u8::BITS as usize - 1 - last) & u64::MAX << first;
        // The byte 1 for each of the slots, those beyond the last one round to the first.
        let ones = u64::MAX / u64::from(u8::MAX);
        let slots = ones & !(u64::MAX << (8 * count));
        let slots = slots << (8 * slot) & RING_BYTES | slots >> (8 * (RING - slot));
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
            // A bit of `blocks` is half a vector.
            for vector in 0..COLUMNS / LANES {
                if blocks >> (2 * vector) & 0b11 != 0 {
                    sheet.mark(row, vector * LANES);
                }
            }
            let target = &mut sheet.rows[row];
            while blocks != 0 {
                let column = blocks.trailing_zeros() as usize * BLOCK;
                blocks &= blocks - 1;
                let pixels = &mut self.pixels[row * COLUMNS + column..];
                for (column, sums) in (column..column + BLOCK).zip(pixels) {
                    let Sums(sums) = &mut sums[slot % HALF_RING];
                    let sums = &mut sums[slot / HALF_RING * CHANNELS..][..CHANNELS];
                    for (target, sum) in target.iter_mut().zip(&*sums) {
                        target[column] = *sum;
                    }
                    sums.fill(0.0);
                }
            }
        }
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

impl Sheet {
    /// An empty one.
    pub(super) fn new() -> Self {
        Self { rows: vec![[[0.0; COLUMNS]; CHANNELS]; ROWS], written: 0, vectors: [0; ROWS] }
    }

    /// Makes it empty.
    pub(super) fn clear(&mut self) {
        for row in (0..ROWS).filter(|row| self.written >> row & 1 == 1) {
            self.rows[row] = [[0.0; COLUMNS]; CHANNELS];
        }
        (self.written, self.vectors) = (0, [0; ROWS]);
    }

    /// Records that pixels from a column on, a vector of them, were written to.
    pub(super) fn mark(&mut self, row: usize, column: usize) {
        self.written |= 1 << row;
        self.vectors[row] |= 1 << (column / LANES);
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

/// Numbers for slots as vectors hold them: those of the first half, a number that belongs to no slot, those of the second half, and another one.
pub(super) type BySlot = [f32; LANES];
