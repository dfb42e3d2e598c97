//! The bricks that may be drawn where values are classified after splatting (SPEC §9), in every channel.

use std::sync::Arc;

use crate::after::brick_ranges::{Bearing, BrickRanges, values_of};
use crate::after::shown_voxels::shown_voxels;
use crate::geometry::plane_geometry::Reach;
use crate::gpu::coefficients::Coefficients;
use crate::lists::brick::BrickList;
use crate::lists::classify::channels;
use crate::lists::iso_range::ValueSet;
use crate::settings::transfer_function::TransferFunction;
use crate::volume::{ValueSlice, Volume};

/// The bricks that may be drawn where values are classified after splatting (SPEC §9).
#[derive(Debug)]
pub(super) struct ShownBricks {
    /// What they were found for.
    pub(super) needs: BrickNeeds,
    /// For every channel that is drawn, and the values that have an opacity in it.
    ranges: Vec<BrickRanges>,
    pub(super) values: Vec<ValueSet>,
}

/// What decides, beside the transfer function, which bricks may be drawn.
#[derive(Clone, Debug)]
pub(crate) struct BrickNeeds {
    /// How far from a voxel others bear on what it shows.
    pub(crate) reach: Reach,
    /// What is splatted, where it is not the values.
    pub(crate) coefficients: Option<Arc<Coefficients>>,
    /// Which values bear on the image.
    pub(crate) bearing: Bearing,
}

impl PartialEq for BrickNeeds {
    fn eq(&self, other: &Self) -> bool {
        let same = match (&self.coefficients, &other.coefficients) {
            (Some(own), Some(other)) => Arc::ptr_eq(own, other),
            (own, others) => own.is_none() && others.is_none(),
        };
        (self.reach, self.bearing) == (other.reach, other.bearing) && same
    }
}

/// The voxels of each channel of a volume that a frame may draw.
#[cfg(not(target_arch = "wasm32"))]
pub(crate) fn shown_lists(volume: &Volume, transfer: &[TransferFunction], needs: &BrickNeeds) -> Vec<BrickList> {
    ShownBricks::new(volume, transfer, needs).lists(volume)
}

impl ShownBricks {
    pub(super) fn new(volume: &Volume, transfer: &[TransferFunction], needs: &BrickNeeds) -> Self {
        let mut shown = Self { needs: needs.clone(), ranges: Vec::new(), values: opaque_values(volume, transfer) };
        for (number, channel) in volume.channels().enumerate().take(shown.values.len()) {
            let coefficients = needs.of_channel(number, channel);
            shown.ranges.push(BrickRanges::new(channel.grid(), coefficients, needs.reach.along));
        }
        shown
    }

    /// The voxels of each channel that may be drawn.
    pub(super) fn lists(&self, volume: &Volume) -> Vec<BrickList> {
        let Self { needs, ranges, values } = self;
        let mut lists = Vec::new();
        for (number, channel) in volume.channels().enumerate().take(values.len()) {
            let of = (channel, needs.of_channel(number, channel));
            lists.push(shown_voxels((&ranges[number], &needs.reach), of, &values[number], needs.bearing));
        }
        lists
    }
}

/// The values that have an opacity in each channel that is drawn. While they stay the same, so do the voxels that may be drawn.
pub(super) fn opaque_values(volume: &Volume, transfer: &[TransferFunction]) -> Vec<ValueSet> {
    channels(volume, transfer).map(|(channel, transfer)| values_of(channel, transfer)).collect()
}

impl BrickNeeds {
    /// The coefficients of a channel.
    fn of_channel<'a>(&'a self, number: usize, channel: &'a Volume) -> ValueSlice<'a> {
        let exact = self.coefficients.as_ref().map(|all| ValueSlice::from(&*all.values[number]));
        exact.unwrap_or(channel.values())
    }
}
