//! Where a frame's voxels are: a volume in memory, or a store whose chunks are read while it is drawn.

use std::sync::Arc;

use glam::UVec3;

use super::cells::Cells;
use super::coefficients::Coefficients;
use super::colors::ColorsOf;
use super::differences::Differences;
use super::extent::Extent;
use crate::after::brick_ranges::BrickRanges;
use crate::after::normalization::Normalization;
use crate::cpu::stream::Stream;
use crate::lists::brick::{self, Brick};
use crate::volume::{Grid, ValueSlice, Volume};

/// The range, in numbers, of a transfer function's table for values that are not known.
const WIDE: f32 = 1e9;

/// Where voxels come from.
#[derive(Clone, Copy, Debug)]
pub(in crate::cpu) enum Matter<'a> {
    /// A volume in memory.
    Whole { volume: &'a Volume, coefficients: &'a Coefficients },
    /// A store.
    Streamed {
        stream: &'a Arc<Stream>,
        /// No voxels of the store's grid, which is all that is at hand before a tile asks for more.
        nothing: &'a Volume,
        numbers: Normalization,
        /// Whether the range of numbers is that of all values, not only of a sample.
        is_range_known: bool,
    },
}

impl<'a> Matter<'a> {
    /// All voxels.
    pub(super) fn grid(&self) -> Grid {
        match self {
            Self::Whole { volume, .. } => *volume.grid(),
            Self::Streamed { stream, .. } => *stream.grid(),
        }
    }

    /// The map from values to numbers, with the range of the values that are known.
    pub(super) fn numbers(&self) -> Normalization {
        match self {
            Self::Whole { coefficients, .. } => coefficients.numbers,
            Self::Streamed { numbers, .. } => *numbers,
        }
    }

    /// The map from values to numbers, with a range that holds all values.
    pub(super) fn all_numbers(&self) -> Normalization {
        match self {
            Self::Whole { coefficients, .. } => coefficients.numbers,
            Self::Streamed { numbers, is_range_known: true, .. } => *numbers,
            Self::Streamed { numbers, .. } => Normalization { range: [-WIDE, WIDE], ..*numbers },
        }
    }

    /// The voxels at hand for all tiles: some box of the volume, and their coefficients and colours.
    pub(super) fn at_hand(&self) -> (&'a Volume, Extent, ValueSlice<'a>, Option<ColorsOf<'a>>) {
        match *self {
            Self::Whole { volume, coefficients } => {
                (volume, Extent::whole(volume.grid()), coefficients.all(volume), coefficients.colors(volume))
            }
            Self::Streamed { stream, nothing, .. } => {
                let extent = Extent { dims: stream.grid().dims, low: UVec3::ZERO, held: nothing.dims() };
                (nothing, extent, nothing.values(), None)
            }
        }
    }

    /// The differences of the values at hand for all tiles, if they are kept.
    pub(super) fn differences(&self) -> Option<&'a Differences> {
        match self {
            Self::Whole { coefficients, .. } => coefficients.differences(),
            Self::Streamed { .. } => None,
        }
    }

    /// Where the values at hand for all tiles can meet an opacity; `None` where all values count.
    pub(super) fn cells(&self) -> Option<&'a Cells> {
        match self {
            Self::Whole { coefficients, .. } => coefficients.cells(),
            Self::Streamed { .. } => None,
        }
    }

    /// The extremes of the coefficients that the values at points of bricks are means of, where the greatest or the least value is chosen.
    pub(super) fn extremes(&self) -> Option<&'a BrickRanges> {
        match self {
            Self::Whole { coefficients, .. } => coefficients.extremes(),
            Self::Streamed { .. } => None,
        }
    }

    /// The volume, if it has labels.
    pub(super) fn labelled(&self) -> Option<&'a Volume> {
        match self {
            Self::Whole { volume, .. } => Some(*volume).filter(|volume| volume.labels().is_some()),
            Self::Streamed { .. } => None,
        }
    }

    /// The label of a voxel, given by its index in memory.
    pub(super) fn label(&self, index: u32) -> Option<u16> {
        self.labelled().and_then(|volume| volume.label(index))
    }

    /// The bricks whose voxels may affect a slab with an opacity, as far as they are known.
    pub(super) fn shown(&self) -> &'a [Brick] {
        match self {
            Self::Whole { coefficients, .. } => coefficients.bricks(),
            Self::Streamed { .. } => &[],
        }
    }

    /// The boxes, by number, in whose cells rays may enter a slab with an opacity: bricks of a volume in memory, chunks of a store.
    pub(super) fn wanted(&self) -> Vec<u32> {
        match self {
            Self::Whole { coefficients, .. } => coefficients.wanted().to_vec(),
            Self::Streamed { stream, .. } => (0..stream.chunks()).collect(),
        }
    }

    /// The first voxel of such a box, and the one after the last.
    pub(super) fn bounds(&self, number: u32) -> (UVec3, UVec3) {
        match self {
            Self::Whole { volume, .. } => {
                let across = brick::bricks_per_axis(volume.grid());
                let at = UVec3::new(number % across.x, number / across.x % across.y, number / (across.x * across.y));
                (at * brick::SIDE, ((at + 1) * brick::SIDE).min(volume.dims()))
            }
            Self::Streamed { stream, .. } => {
                let (from, dims) = stream.bounds(number);
                (from, from + dims)
            }
        }
    }
}
