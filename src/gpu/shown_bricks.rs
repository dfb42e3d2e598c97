//! The bricks that may be drawn where values are classified after splatting (SPEC §9), in every channel.

use std::sync::Arc;

use crate::after::brick_ranges::{Bearing, BrickRanges};
use crate::after::shown_voxels::shown_voxels;
use crate::geometry::plane_geometry::Reach;
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
    ranges: Vec<BrickRanges>,
}

/// What decides, beside the transfer function, which bricks may be drawn.
#[derive(Clone, Debug)]
pub(crate) struct BrickNeeds {
    /// How far from a voxel others bear on what it shows.
    pub(crate) reach: Reach,
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
        let ranges = |(number, (channel, _)): (usize, (&Volume, &TransferFunction))| {
            BrickRanges::new(channel.grid(), needs.of_channel(number, channel), needs.reach.along)
        };
        let ranges = channels(volume, transfer).enumerate().map(ranges).collect();
        Self { needs: needs.clone(), ranges }
    }

    /// The voxels of each channel that may be drawn under a transfer function.
    pub(super) fn lists(&self, volume: &Volume, transfer: &TransferFunction) -> Vec<BrickList> {
        let Self { needs, ranges } = self;
        let list = |(number, (channel, transfer)): (usize, (&Volume, &TransferFunction))| {
            let coefficients = needs.of_channel(number, channel);
            shown_voxels((&ranges[number], &needs.reach), (channel, coefficients), transfer, needs.bearing)
        };
        channels(volume, transfer).enumerate().map(list).collect()
    }
}

impl BrickNeeds {
    /// The coefficients of a channel.
    fn of_channel<'a>(&'a self, number: usize, channel: &'a Volume) -> ValueSlice<'a> {
        let exact = self.coefficients.as_ref().map(|all| ValueSlice::from(&*all[number].values));
        exact.unwrap_or(channel.values())
    }
}
