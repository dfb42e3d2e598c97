//! The bricks that may be drawn where values are classified after splatting (SPEC §9), in every channel.

use std::sync::Arc;

use glam::UVec3;

use crate::after::brick_ranges::{Bearing, BrickRanges};
use crate::gpu::coefficients::Coefficients;
use crate::lists::brick::BrickList;
use crate::lists::classify::channels;
use crate::settings::transfer_function::TransferFunction;
use crate::volume::{ValueSlice, Volume};

/// The bricks that may be drawn where values are classified after splatting (SPEC §9).
#[derive(Debug)]
pub(super) struct ShownBricks {
    /// What they were found for.
    pub(super) needs: BrickNeeds,
    /// For every channel that is drawn.
    pub(super) channels: Vec<ShownInChannel>,
}

/// The bricks that may be drawn in one channel.
#[derive(Debug)]
pub(super) struct ShownInChannel {
    pub(super) ranges: BrickRanges,
    /// Whether each brick of the grid is drawn.
    pub(super) are_shown: Vec<bool>,
}

/// What decides, beside the transfer function, which bricks may be drawn.
#[derive(Clone, Debug)]
pub(crate) struct BrickNeeds {
    /// How far from a brick voxels bear on what it shows.
    pub(crate) reach: UVec3,
    /// Those of each channel, where they are not the values.
    pub(crate) coefficients: Option<Vec<Arc<Coefficients>>>,
    /// Which values bear on the image.
    pub(crate) bearing: Bearing,
}

impl PartialEq for BrickNeeds {
    fn eq(&self, other: &Self) -> bool {
        let same = match (&self.coefficients, &other.coefficients) {
            (Some(own), Some(others)) => own.iter().zip(others).all(|(own, other)| Arc::ptr_eq(own, other)),
            (own, others) => own.is_none() && others.is_none(),
        };
        (self.reach, self.bearing) == (other.reach, other.bearing) && same
    }
}

impl ShownBricks {
    pub(super) fn new(volume: &Volume, transfer: &TransferFunction, needs: &BrickNeeds) -> Self {
        let of_channel = |(number, (channel, transfer)): (usize, (&Volume, &TransferFunction))| {
            let exact = needs.coefficients.as_ref().map(|all| ValueSlice::from(&*all[number].values));
            let ranges = BrickRanges::new(channel.grid(), exact.unwrap_or(channel.values()), needs.reach);
            ShownInChannel { are_shown: ranges.shown(channel, transfer, needs.bearing), ranges }
        };
        Self { needs: needs.clone(), channels: channels(volume, transfer).enumerate().map(of_channel).collect() }
    }
}

impl ShownInChannel {
    /// These bricks, without holes.
    pub(super) fn brick_list(&self, channel: &Volume) -> BrickList {
        let are_shown = &self.are_shown;
        self.ranges.brick_list(channel, |brick| are_shown[brick])
    }
}
