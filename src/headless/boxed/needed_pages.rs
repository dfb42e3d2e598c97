//! Which pages of a volume are needed, and how their values are stored and splatted.

use std::collections::HashSet;

use glam::UVec3;

use super::page_pool::ChannelPage;
use crate::after::normalization::Normalization;
use crate::gpu::volume_texture::ValueFormat;
use crate::lists::brick::{self, Brick};
use crate::volume::range::range_of;
use crate::volume::{SampleType, StreamedVolume};

/// Some pages, and the box around them.
#[derive(Debug, Default)]
pub(super) struct Needed {
    pub(super) pages: HashSet<ChannelPage>,
    ends: Option<(UVec3, UVec3)>,
}

impl Needed {
    /// Adds pages, if all together are then at most so many, in a box of at most so many voxels; tells whether it did.
    pub(super) fn add(&mut self, pages: &[ChannelPage], (most_pages, most_voxels): (usize, u64), bits: u32) -> bool {
        let new = pages.iter().filter(|page| !self.pages.contains(page)).count();
        let ends = pages.iter().fold(self.ends, |ends, &(_, page)| {
            let (low, high) = ends.unwrap_or((page, page));
            Some((low.min(page), high.max(page)))
        });
        let voxels = |(low, high): (UVec3, UVec3)| (high - low + 1).as_u64vec3().element_product() << (3 * bits);
        if self.pages.len() + new > most_pages || ends.map_or(0, voxels) > most_voxels {
            return false;
        }
        self.ends = ends;
        self.pages.extend(pages);
        true
    }

    /// Sorts pages, because their order decides which of them get slots, and a set has an order of its own in every run.
    pub(super) fn sorted(pages: HashSet<ChannelPage>) -> Vec<ChannelPage> {
        let mut pages: Vec<ChannelPage> = pages.into_iter().collect();
        pages.sort_unstable_by_key(|&(channel, at)| (channel, at.to_array()));
        pages
    }

    /// The first page along each axis, and the number from there to the last one.
    pub(super) fn within(&self) -> Option<(UVec3, UVec3)> {
        self.ends.map(|(low, high)| (low, high - low + 1))
    }
}

/// What the values of a channel are splatted as: scaled by the range that the store knows, or else that of its sample.
pub(super) fn numbers_of(volume: &StreamedVolume, number: usize) -> Normalization {
    let known = volume.channels.get(number).and_then(|channel| channel.values.range());
    let sample = || volume.sample.channel(number).and_then(|sample| range_of(sample.values().iter()));
    Normalization::new(known.or_else(sample).unwrap_or([0.0; 2]).map(f64::from))
}

/// How values are stored at first: in as many bits as samples have in the file. Where they are not the samples, that may turn out to be too few. Where a channel's
/// page is not needed for which another's is, it has holes, which only the bits of an `f32` can tell.
pub(super) fn format_of(volume: &StreamedVolume) -> ValueFormat {
    let encoding = volume.channels.first().values.store.facts().encoding.filter(|_| volume.channels.len() == 1);
    match encoding.map(|encoding| encoding.sample_type) {
        Some(SampleType::U8) => ValueFormat::Offset8(0.0),
        Some(SampleType::I8) => ValueFormat::Offset8(i8::MIN.into()),
        Some(SampleType::U16) => ValueFormat::Offset16(0.0),
        Some(SampleType::I16) => ValueFormat::Offset16(i16::MIN.into()),
        _ => ValueFormat::Bits,
    }
}

/// The page of a brick's voxels, and those of their neighbours along the axes.
pub(super) fn pages_around(brick: &Brick, dims: UVec3, bits: u32) -> impl Iterator<Item = UVec3> + use<> {
    let (middle, half) = brick::bounds(brick);
    let (low, high) = ((middle - half).as_uvec3(), (middle + half).as_uvec3());
    let page = low >> bits;
    let neighbours = [UVec3::X, UVec3::Y, UVec3::Z].into_iter().flat_map(move |axis| {
        let (before, after) = (low.saturating_sub(axis), (high + axis).min(dims - 1));
        [before, after].map(|at| page * (UVec3::ONE - axis) + (at >> bits) * axis)
    });
    std::iter::once(page).chain(neighbours)
}
