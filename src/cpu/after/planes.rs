//! A tile's plane buffers: a ring of planes onto which values, weights and gradients are splatted (SPEC §9).

use crate::cpu::sheets::{COLUMNS, RING, ROWS};
use crate::cpu::vector::LANES;

/// Numbers along a row of a plane, with room for a vector that starts within the tile and ends outside.
pub(super) const STRIDE: usize = COLUMNS + LANES;

/// Sums that a plane holds for every pixel: N and Σc·g, and then Σd·g, or for the kernel's gradient Σa·g, Σb·g, Σt·g and
/// Σc·a·g, Σc·b·g, Σc·t·g, with (a, b, t) the offset along two axes in the plane and along its normal.
pub(super) const CHANNELS: usize = 8;

/// A row of all open planes.
pub(super) type PlaneRow = [[[f32; STRIDE]; CHANNELS]; RING];

/// The ring of one tile: plane k is in slot k mod 8.
#[derive(Debug)]
pub(super) struct Planes {
    /// Row by row.
    pub(super) rows: Vec<PlaneRow>,
    /// For every slot the rows that hold anything.
    pub(super) written: [u64; RING],
}

impl Planes {
    pub(super) fn new() -> Self {
        Self { rows: vec![[[[0.0; STRIDE]; CHANNELS]; RING]; ROWS], written: [0; RING] }
    }

    /// Makes a slot's plane empty.
    pub(super) fn clear(&mut self, slot: usize) {
        let mut written = std::mem::take(&mut self.written[slot]);
        while written != 0 {
            let row = written.trailing_zeros() as usize;
            written &= written - 1;
            self.rows[row][slot] = [[0.0; STRIDE]; CHANNELS];
        }
    }
}
