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

/// The open sheets, or planes, of a tile. A pixel's sums for all of them lie together, a vector for each channel with a number for each slot: a voxel
/// adds to them by a multiplication and an addition for each channel.
#[derive(Debug)]
pub(super) struct Ring {
    channels: usize,
    /// The sums of pixels, row by row, and of their channels.
    sums: Vec<Sums>,
    /// Which columns of a row are not empty: byte s has a bit for every 4 columns of slot s.
    written: [u64; ROWS],
}

/// One sheet or plane, row by row.
#[derive(Debug)]
pub(super) struct Layer<const N: usize> {
    pub(super) rows: Vec<[[f32; COLUMNS]; N]>,
    /// The bits of the rows that are not empty.
    pub(super) written: u64,
}

/// The buffers of one tile from which its image is made.
#[derive(Debug)]
pub(super) struct Buffers {
    /// The sheet that is composited next.
    pub(super) sheet: Layer<CHANNELS>,
    /// The rows whose compositing buffer may hold a surface that is not reached yet.
    pub(super) kept: u64,
    /// The compositing buffer, row by row.
    pub(super) acc: Vec<[[f32; COLUMNS]; CHANNELS]>,
    /// Where the opacity asked for is reached, row by row, in slabs as [`TileRays`](super::cut::TileRays) counts them; infinite where it is not.
    pub(super) hits: Vec<[f32; COLUMNS]>,
}

impl Ring {
    /// Empty sheets with a number of channels.
    pub(super) fn new(channels: usize) -> Self {
        Self { channels, sums: vec![Sums([0.0; RING]); ROWS * COLUMNS * channels], written: [0; ROWS] }
    }

    /// The sums of the pixels, by their index in the tile; N is the number of channels.
    #[inline(always)]
    pub(super) fn pixels<const N: usize>(&mut self) -> &mut [[Sums; N]] {
        debug_assert_eq!(N, self.channels, "sums of another ring");
        self.sums.as_chunks_mut().0
    }

    /// Records that pixels within a box were written to in some slots, from one on.
    #[inline(always)]
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

    /// Moves the sheet of a slot into an empty layer.
    pub(super) fn take<const N: usize>(&mut self, slot: usize, layer: &mut Layer<N>) {
        for (row, written) in self.written.iter_mut().enumerate() {
            let mut blocks = (*written >> (8 * slot)) as u8;
            if blocks == 0 {
                continue;
            }
            *written &= !(u64::from(u8::MAX) << (8 * slot));
            layer.written |= 1 << row;
            let target = &mut layer.rows[row];
            while blocks != 0 {
                let column = blocks.trailing_zeros() as usize * BLOCK;
                blocks &= blocks - 1;
                let pixels = self.sums[(row * COLUMNS + column) * self.channels..].chunks_exact_mut(self.channels);
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
        let length = COLUMNS * self.channels;
        for (written, sums) in self.written.iter_mut().zip(self.sums.chunks_exact_mut(length)) {
            if std::mem::take(written) != 0 {
                sums.fill(Sums([0.0; RING]));
            }
        }
    }
}

impl<const N: usize> Layer<N> {
    /// An empty one.
    pub(super) fn new() -> Self {
        Self { rows: vec![[[0.0; COLUMNS]; N]; ROWS], written: 0 }
    }

    pub(super) fn clear(&mut self) {
        let mut written = std::mem::take(&mut self.written);
        while written != 0 {
            self.rows[written.trailing_zeros() as usize] = [[0.0; COLUMNS]; N];
            written &= written - 1;
        }
    }
}

impl Buffers {
    /// Buffers of zeros.
    pub(super) fn new() -> Self {
        Self {
            sheet: Layer::new(),
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
