//! A store's voxels that are read together, and the bricks of those that take part.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use glam::UVec3;

use super::source::Source;
use crate::cpu::bin::{Placed, place_brick};
use crate::cpu::count::Drawn;
use crate::lists::brick::{self, Brick, BrickList};
use crate::lists::classify::takes_part;
use crate::lists::quad_plan::Overlaps;
use crate::volume::{Grid, Volume, VolumeError};

/// A chunk that has been read.
#[derive(Debug)]
pub(in crate::cpu) struct Chunk {
    number: u32,
    from: UVec3,
    dims: UVec3,
    /// Empty if all are the store's fill value, and that does not take part.
    values: Vec<f32>,
    /// In memory order.
    bricks: Vec<Brick>,
    /// Those of them that are on the image, by first sheet and then in memory order.
    placed: Vec<Placed>,
    drawn: Arc<Drawn>,
    overlaps: Overlaps,
    /// The bytes of all chunks in memory, and how many of them are this one's.
    held: Arc<AtomicUsize>,
    bytes: usize,
}

impl Chunk {
    /// Reads a chunk, of whose bricks something may have been drawn when it was read before. Also returns the bytes read from the store.
    ///
    /// # Errors
    /// If the store cannot be read.
    pub(super) fn read(
        source: &Source,
        number: u32,
        drawn: Option<Arc<Drawn>>,
        held: &Arc<AtomicUsize>,
    ) -> Result<(Self, u64), VolumeError> {
        let (from, dims) = source.bounds(number);
        let (values, read) = match source.is_stored(number)? {
            true => source.values(from, dims)?,
            false if source.shows_fill() => (vec![source.store.fill(); dims.element_product() as usize], 0),
            false => (Vec::new(), 0),
        };
        let bricks = if values.is_empty() { Vec::new() } else { bricks(source, from, dims, &values)? };
        let overlaps = Overlaps::count(&bricks, &source.projection.view);
        let place = |(at, brick)| place_brick(at as u32, brick, &source.projection, source.support);
        let mut placed: Vec<Placed> = bricks.iter().enumerate().filter_map(place).collect();
        placed.sort_unstable_by_key(|placed| (placed.first, placed.brick));
        let bytes = size_of_val(&values[..])
            + bricks.len() * (size_of::<Brick>() + 2 * size_of::<u64>())
            + placed.len() * size_of::<Placed>();
        let drawn = drawn.unwrap_or_else(|| Arc::new(Drawn::new(bricks.len(), &source.projection.view)));
        held.fetch_add(bytes, Ordering::Relaxed);
        let held = Arc::clone(held);
        Ok((Self { number, from, dims, values, bricks, placed, drawn, overlaps, held, bytes }, read))
    }

    /// Its number among the store's chunks.
    pub(super) fn number(&self) -> u32 {
        self.number
    }

    /// The overlaps of its voxels with slabs.
    pub(super) fn overlaps(&self) -> &Overlaps {
        &self.overlaps
    }

    /// What has been drawn of its bricks.
    pub(in crate::cpu) fn drawn(&self) -> &Arc<Drawn> {
        &self.drawn
    }

    /// A brick, by its number.
    pub(in crate::cpu) fn brick(&self, number: u32) -> &Brick {
        &self.bricks[number as usize]
    }

    /// A brick that is on the image, by its place in the order of arrival.
    pub(in crate::cpu) fn placed(&self, at: u32) -> &Placed {
        &self.placed[at as usize]
    }

    /// The bricks that a tile, given by its column and row, may show, by their places in the order of arrival.
    pub(in crate::cpu) fn bricks_of(&self, [column, row]: [usize; 2]) -> impl Iterator<Item = u32> {
        let contains = |[first, last]: [usize; 2], at: usize| first <= at && at <= last;
        let is_there = move |placed: &Placed| contains(placed.columns, column) && contains(placed.rows, row);
        (0..).zip(&self.placed).filter(move |(_, placed)| is_there(placed)).map(|(at, _)| at)
    }

    /// What sorts the bricks of all chunks as [`bin::place`](crate::cpu::bin::place) sorts those of a volume in memory.
    pub(in crate::cpu) fn order(&self, at: u32) -> (i32, [u32; 3]) {
        let placed = self.placed(at);
        (placed.first, brick::position(self.brick(placed.brick)))
    }

    /// The value of one of its voxels; `None` outside of it.
    pub(super) fn value(&self, voxel: UVec3, fill: f32) -> Option<f32> {
        if voxel.cmplt(self.from).any() || voxel.cmpge(self.from + self.dims).any() {
            return None;
        }
        let at = voxel - self.from;
        let index = at.x + self.dims.x * (at.y + self.dims.y * at.z);
        Some(self.values.get(index as usize).copied().unwrap_or(fill))
    }
}

impl Drop for Chunk {
    fn drop(&mut self) {
        self.held.fetch_sub(self.bytes, Ordering::Relaxed);
    }
}

/// The bricks of the voxels that take part, in memory order.
fn bricks(source: &Source, from: UVec3, dims: UVec3, values: &[f32]) -> Result<Vec<Brick>, VolumeError> {
    let Source { transfer, clipped, grid, .. } = source;
    let own = Grid { dims, ..*grid };
    // Only gradient opacity needs values around the chunk to decide what takes part.
    let rim = u32::from(transfer.gradient_opacity.is_some());
    let low = from.saturating_sub(UVec3::splat(rim));
    let high = (from + dims + rim).min(grid.dims);
    let around = match rim {
        0 => values.to_vec(),
        _ => source.values(low, high - low)?.0,
    };
    let volume = Volume::piece(Grid { dims: high - low, ..own }, around);
    let takes_part =
        |voxel: &UVec3| clipped.contain(*voxel) && takes_part(&volume, transfer, volume.grid().index_of(*voxel - low));
    let voxels = (0..own.dims.element_product()).map(|index| (index, from + own.voxel_at(index)));
    let taking_part: Vec<u32> = voxels.filter(|(_, voxel)| takes_part(voxel)).map(|(index, _)| index).collect();
    let mut bricks = BrickList::new(&own, &taking_part).bricks().to_vec();
    for brick in &mut bricks {
        (brick.x, brick.y, brick.z) = (brick.x + from.x, brick.y + from.y, brick.z + from.z);
    }
    Ok(bricks)
}
