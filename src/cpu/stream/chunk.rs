//! A store's voxels that are read together, and where voxels are splatted, the bricks of those that take part.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use glam::UVec3;

use super::source::{Source, Splats};
use crate::cpu::bin::{Placed, place_brick};
use crate::cpu::count::Drawn;
use crate::lists::brick::{self, Brick, BrickList};
use crate::lists::classify::TakingPart;
use crate::lists::quad_plan::Overlaps;
use crate::volume::{Volume, VolumeError};

/// A chunk that has been read.
#[derive(Debug)]
pub(in crate::cpu) struct Chunk {
    number: u32,
    /// The first of the voxels that were read.
    low: UVec3,
    /// Their values; `None` if the store holds none of the chunk's voxels, and its fill value is not splatted.
    values: Option<Volume>,
    /// In memory order; none where voxels are not splatted.
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
        let (low, dims) = source.read_bounds(number);
        let (values, read) = match source.is_stored(number)? || source.shows_fill() {
            true => {
                let (values, read) = source.values(low, dims)?;
                source.note(number, &values);
                (Some(Volume::piece(source.grid.resized(dims), values)), read)
            }
            false => {
                source.note_fill(number);
                (None, 0)
            }
        };
        let (mut bricks, mut placed, mut overlaps) = (Vec::new(), Vec::new(), Overlaps::default());
        let mut new = Drawn::default();
        if let (Some(splats), Some(volume)) = (&source.splats, &values) {
            bricks = bricks_of(source, splats, number, (volume, low));
            overlaps = Overlaps::count(&bricks, &splats.projection.view);
            let place = |(at, brick)| place_brick(at as u32, brick, &splats.projection, splats.support);
            placed = bricks.iter().enumerate().filter_map(place).collect();
            placed.sort_unstable_by_key(|placed: &Placed| (placed.first, placed.brick));
            new = Drawn::new(bricks.len(), &splats.projection.view);
            // What is counted as held is what is allocated.
            bricks.shrink_to_fit();
            placed.shrink_to_fit();
        }
        let bytes = values.as_ref().map_or(0, |volume| volume.values().bytes())
            + bricks.len() * (size_of::<Brick>() + 2 * size_of::<u64>())
            + placed.len() * size_of::<Placed>();
        let drawn = drawn.unwrap_or_else(|| Arc::new(new));
        held.fetch_add(bytes, Ordering::Relaxed);
        let held = Arc::clone(held);
        Ok((Self { number, low, values, bricks, placed, drawn, overlaps, held, bytes }, read))
    }

    /// Its number among the store's chunks.
    pub(super) fn number(&self) -> u32 {
        self.number
    }

    /// Whether it needed the store's values.
    pub(super) fn is_read(&self) -> bool {
        self.values.is_some()
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
        let contains = |[first, last]: [u16; 2], at: usize| (usize::from(first)..=usize::from(last)).contains(&at);
        let is_there = move |placed: &Placed| contains(placed.columns, column) && contains(placed.rows, row);
        (0..).zip(&self.placed).filter(move |(_, placed)| is_there(placed)).map(|(at, _)| at)
    }

    /// What sorts the bricks of all chunks as [`bin::place`](crate::cpu::bin::place) sorts those of a volume in memory.
    pub(in crate::cpu) fn order(&self, at: u32) -> (i32, [u32; 3]) {
        let placed = self.placed(at);
        (placed.first, brick::position(self.brick(placed.brick)))
    }

    /// The first of the voxels that were read, and their values; `None` if the store holds none of the chunk's.
    pub(super) fn values(&self) -> Option<(UVec3, &Volume)> {
        self.values.as_ref().map(|values| (self.low, values))
    }

    /// A voxel's value; `None` if it was not read.
    pub(super) fn value(&self, voxel: UVec3) -> Option<f32> {
        let volume = self.values.as_ref()?;
        let is_there = voxel.cmpge(self.low).all() && voxel.cmplt(self.low + volume.dims()).all();
        is_there.then(|| volume.value(voxel - self.low))
    }
}

impl Drop for Chunk {
    fn drop(&mut self) {
        self.held.fetch_sub(self.bytes, Ordering::Relaxed);
    }
}

/// The bricks of a chunk's voxels that take part, in memory order. `volume` holds them and what was read around them, from the voxel `low` on.
fn bricks_of(source: &Source, splats: &Splats, number: u32, (volume, low): (&Volume, UVec3)) -> Vec<Brick> {
    let Splats { transfer, clipped, .. } = splats;
    let (from, dims) = source.bounds(number);
    let own = source.grid.resized(dims);
    let taking_part = TakingPart::new(volume, std::slice::from_ref(transfer));
    let list = BrickList::by_rows(&own, &|y, z, flags: &mut [bool]| {
        let at = from + UVec3::new(0, y, z);
        let inside = clipped.in_row(at.y, at.z, from.x + dims.x);
        let inside = inside.start.saturating_sub(from.x)..inside.end.saturating_sub(from.x);
        taking_part.flag(volume.grid().index_of(at - low), inside, flags);
    });
    let mut bricks = list.bricks().to_vec();
    for brick in &mut bricks {
        (brick.x, brick.y, brick.z) = (brick.x + from.x, brick.y + from.y, brick.z + from.z);
    }
    bricks
}
