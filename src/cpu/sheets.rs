//! A tile's buffers: the ring of sheet buffers that voxels are splatted into, and the compositing buffer.

use super::vector::LANES;

/// Pixels along a row of a tile.
pub(super) const COLUMNS: usize = 32;
/// Rows of a tile.
pub(super) const ROWS: usize = 32;
/// Numbers along a row of a sheet, with room for a vector that starts within the tile and ends outside.
pub(super) const STRIDE: usize = COLUMNS + LANES;
/// Sheets that are open at a time. Sheet s is in slot s mod 8.
pub(super) const RING: usize = 8;
/// Sheets that a voxel is drawn into at a time, such that their planes fill a vector.
pub(super) const SECTIONS: usize = LANES - 1;
/// Red, green, blue, opacity.
pub(super) const CHANNELS: usize = 4;

/// A row of all open sheets.
pub(super) type SheetRow = [[[f32; STRIDE]; CHANNELS]; RING];

/// The buffers of one tile.
#[derive(Debug)]
pub(super) struct Buffers {
    /// Sheet buffers, row by row.
    pub(super) sheets: Vec<SheetRow>,
    /// For every slot, the bits of the rows that are not empty.
    pub(super) written: [u64; RING],
    /// The rows whose compositing buffer may hold a surface that is not reached yet.
    pub(super) kept: u64,
    /// The compositing buffer, row by row.
    pub(super) acc: Vec<[[f32; COLUMNS]; CHANNELS]>,
    /// Where the opacity asked for is reached, row by row, in slabs as [`TileRays`](super::cut::TileRays) counts them; infinite where it is not.
    pub(super) hits: Vec<[f32; COLUMNS]>,
}

impl Buffers {
    /// Buffers of zeros.
    pub(super) fn new() -> Self {
        Self {
            sheets: vec![[[[0.0; STRIDE]; CHANNELS]; RING]; ROWS],
            written: [0; RING],
            kept: 0,
            acc: vec![[[0.0; COLUMNS]; CHANNELS]; ROWS],
            hits: vec![[f32::INFINITY; COLUMNS]; ROWS],
        }
    }

    /// Clears the buffers for the next tile. Composited sheets are already zero; after an early end some are not.
    pub(super) fn clear(&mut self) {
        for slot in 0..RING {
            while self.written[slot] != 0 {
                let row = self.written[slot].trailing_zeros() as usize;
                self.written[slot] &= self.written[slot] - 1;
                self.sheets[row][slot] = [[0.0; STRIDE]; CHANNELS];
            }
        }
        self.kept = 0;
        self.acc.fill([[0.0; COLUMNS]; CHANNELS]);
        self.hits.fill([f32::INFINITY; COLUMNS]);
    }
}

/// The slot of a sheet.
pub(super) fn slot_of(sheet: i32) -> usize {
    sheet.rem_euclid(RING as i32) as usize
}
