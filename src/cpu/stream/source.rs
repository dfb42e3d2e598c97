//! What a view draws of a store: its chunks, and how their voxels are classified and seen where they are splatted.

use std::sync::Arc;

use glam::UVec3;

use super::ranges::Ranges;
use crate::cpu::bin::{Placed, place_box};
use crate::cpu::project::Projection;
use crate::error::setting::SettingError;
use crate::lists::brick::SIDE;
use crate::lists::iso_range::ValueSet;
use crate::settings::clip::ClippedVoxels;
use crate::settings::transfer_function::TransferFunction;
use crate::volume::range::{EMPTY, finite_range, union};
use crate::volume::{Grid, MEMBERSHIP_REACH, Store, StoreLevel, Volume, VolumeError};

/// The minimum number of voxels along each axis of a chunk that is drawn. Smaller chunks of the store are read together.
const LEAST_SIDE: u32 = 16;

/// The maximum number of chunks that are drawn, and of voxels in each.
const MOST_CHUNKS: u128 = 1 << 24;
const MOST_VOXELS: u128 = 1 << 30;

/// What boxes of voxels are wider than their bricks, in voxels, so that no brick comes before a box that holds it: more than rounding errors.
const SLACK: f64 = 1e-6;

/// A level of a store in a view.
#[derive(Debug)]
pub(super) struct Source {
    pub(super) store: Arc<dyn Store>,
    pub(super) level: usize,
    pub(super) grid: Grid,
    /// The voxels of a chunk that is drawn: some of the store's, in whole bricks.
    pub(super) side: UVec3,
    pub(super) ranges: Ranges,
    /// Where classification comes before splatting.
    pub(super) splats: Option<Splats>,
}

/// How voxels are classified and splatted.
#[derive(Debug)]
pub(super) struct Splats {
    pub(super) transfer: TransferFunction,
    /// The values that are splatted.
    pub(super) shown: ValueSet,
    /// The voxels that clip planes leave.
    pub(super) clipped: ClippedVoxels,
    pub(super) projection: Projection,
    /// The radius of footprints in pixels' terms, [`Kernel::support`](crate::kernel::Kernel::support).
    pub(super) support: f64,
}

impl Source {
    /// The voxels of a chunk that is drawn, for the store's.
    pub(super) fn side(chunk: UVec3, grid: &Grid) -> UVec3 {
        let of = |chunk: u32, count: u32| {
            let chunk = chunk.min(count);
            let joined = chunk * LEAST_SIDE.div_ceil(chunk);
            // Bricks of neighbouring chunks must not share voxels.
            joined.next_multiple_of(SIDE).min(count.next_multiple_of(SIDE))
        };
        UVec3::new(of(chunk.x, grid.dims.x), of(chunk.y, grid.dims.y), of(chunk.z, grid.dims.z))
    }

    /// The number of chunks along each axis.
    pub(super) fn across(&self) -> UVec3 {
        StoreLevel { grid: self.grid, chunk: self.side }.chunks()
    }

    /// Checks that the chunks of a level, and the voxels of each, are no more than can be noted.
    ///
    /// # Errors
    /// If a chunk has no voxels, or there are more of either than numbers.
    pub(super) fn check(level: &StoreLevel) -> Result<(), SettingError> {
        let StoreLevel { grid, chunk } = level;
        let count = |sizes: UVec3| sizes.to_array().map(u128::from).iter().product::<u128>();
        if chunk.min_element() > 0 {
            let side = Self::side(*chunk, grid);
            // With the voxels around a chunk.
            let with_rim = side + 2 * MEMBERSHIP_REACH;
            if count(StoreLevel { grid: *grid, chunk: side }.chunks()) <= MOST_CHUNKS && count(with_rim) <= MOST_VOXELS
            {
                return Ok(());
            }
        }
        let found = format!("chunks of {chunk} voxels in a level of {}", grid.dims);
        let allowed = format!("at most {MOST_CHUNKS} chunks of at least 1 and at most {MOST_VOXELS} voxels");
        Err(SettingError::new("volume", found, allowed))
    }

    /// The number of the chunk that holds a voxel.
    pub(super) fn number_of(&self, voxel: UVec3) -> u32 {
        let (at, across) = (voxel / self.side, self.across());
        at.x + across.x * (at.y + across.y * at.z)
    }

    /// The first voxel of a chunk, and its voxels along each axis.
    pub(super) fn bounds(&self, number: u32) -> (UVec3, UVec3) {
        let across = self.across();
        let from =
            self.side * UVec3::new(number % across.x, number / across.x % across.y, number / (across.x * across.y));
        (from, self.side.min(self.grid.dims - from))
    }

    /// All chunks that may be on the image, in memory order.
    pub(super) fn placed(&self) -> Vec<Placed> {
        let place = |number| if self.shows_nothing(number) { None } else { self.place(number, self.bounds(number)) };
        (0..self.across().element_product()).filter_map(place).collect()
    }

    /// Where the voxels of a chunk within a box are, whatever their values; `None` off the image, or if voxels are not splatted.
    pub(super) fn place(&self, number: u32, (from, dims): (UVec3, UVec3)) -> Option<Placed> {
        let Splats { projection, support, .. } = self.splats.as_ref()?;
        let half = (dims.as_dvec3() - 1.0) / 2.0;
        let placed = place_box(number, (from.as_dvec3() + half, half + SLACK), projection, *support)?;
        // Rounding must not let one of its bricks be seen where it is not.
        let half = placed.half.map(|half| half * (1.0 + 8.0 * f32::EPSILON) + 0.01);
        Some(Placed { half, ..placed })
    }

    /// Whether none of a chunk's voxels is splatted, as far as its values are known.
    pub(super) fn shows_nothing(&self, number: u32) -> bool {
        let Some(Splats { shown, .. }) = &self.splats else { return false };
        self.known_range(number).is_some_and(|[min, max]| min > max || !shown.meets(min, max))
    }

    /// The box that a chunk is read with: its voxels, and those around them on which depends what takes part, with gradient opacity, or a label map's normals.
    pub(super) fn read_bounds(&self, number: u32) -> (UVec3, UVec3) {
        let (from, dims) = self.bounds(number);
        let rim = self.splats.as_ref().map_or(0, |Splats { transfer, .. }| match transfer.membership {
            true => MEMBERSHIP_REACH,
            false => u32::from(transfer.gradient_opacity.is_some()),
        });
        let low = from.saturating_sub(UVec3::splat(rim));
        (low, (from + dims + rim).min(self.grid.dims) - low)
    }

    /// The store's chunks that share voxels with a box.
    pub(super) fn stored(&self, (from, dims): (UVec3, UVec3)) -> impl Iterator<Item = UVec3> {
        let chunk = self.store.levels()[self.level].chunk;
        let (first, last) = (from / chunk, (from + dims - 1) / chunk);
        let columns = move |y, z| (first.x..=last.x).map(move |x| UVec3::new(x, y, z));
        (first.z..=last.z).flat_map(move |z| (first.y..=last.y).flat_map(move |y| columns(y, z)))
    }

    /// The minimum and maximum of a chunk's values, if the store knows them, or they have been read, or it turned out that the store does not hold them.
    pub(super) fn known_range(&self, number: u32) -> Option<[f32; 2]> {
        if let Some(range) = self.ranges.of(number) {
            return Some(range);
        }
        let of = |chunk| self.store.chunk_range(self.level, chunk);
        let range = self.stored(self.bounds(number)).map(of).reduce(|a, b| Some(union(a?, b?))).flatten();
        range.inspect(|&range| self.ranges.set(number, range))
    }

    /// Notes the values of a chunk that has been read, with those around it.
    pub(super) fn note(&self, number: u32, values: &[f32]) {
        self.ranges.set(number, finite_range(values));
    }

    /// Notes that the store holds none of a chunk's values.
    pub(super) fn note_fill(&self, number: u32) {
        let fill = self.store.fill();
        self.ranges.set(number, if fill.is_finite() { [fill; 2] } else { EMPTY });
    }

    /// Whether the store holds any voxel of a chunk.
    ///
    /// # Errors
    /// If the store cannot be read.
    pub(super) fn is_stored(&self, number: u32) -> Result<bool, VolumeError> {
        for chunk in self.stored(self.bounds(number)) {
            if self.store.contains(self.level, chunk)? {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Whether voxels may be splatted that the store does not hold.
    pub(super) fn shows_fill(&self) -> bool {
        let Some(Splats { transfer, .. }) = &self.splats else { return false };
        let (value, tables) = (f64::from(self.store.fill()), transfer.tables(None));
        value.is_finite() && tables.opacity.at(value) > 0.0 && tables.in_iso_range(value)
    }

    /// The values of a box of voxels, with holes as NaN; and the bytes read from the store.
    ///
    /// # Errors
    /// If the store cannot be read.
    pub(super) fn values(&self, from: UVec3, dims: UVec3) -> Result<(Vec<f32>, u64), VolumeError> {
        let mut values = vec![0.0; dims.element_product() as usize];
        let read = self.store.read(self.level, from, dims, &mut values)?;
        values.iter_mut().filter(|value| !value.is_finite()).for_each(|value| *value = f32::NAN);
        Ok((values, read))
    }

    /// A voxel with its neighbours along the axes, whose values `value` tells, as a volume; and the voxel's place there.
    pub(super) fn around(&self, voxel: UVec3, mut value: impl FnMut(UVec3) -> f32) -> (Volume, UVec3) {
        let low = voxel.saturating_sub(UVec3::ONE);
        let dims = (voxel + 2).min(self.grid.dims) - low;
        let grid = self.grid.resized(dims);
        let at = voxel - low;
        let mut values = vec![f32::NAN; dims.element_product() as usize];
        values[grid.index_of(at) as usize] = value(voxel);
        for axis in [UVec3::X, UVec3::Y, UVec3::Z] {
            for neighbour in [at.wrapping_sub(axis), at + axis] {
                if neighbour.cmplt(dims).all() {
                    values[grid.index_of(neighbour) as usize] = value(low + neighbour);
                }
            }
        }
        (Volume::piece(grid, values), at)
    }
}
