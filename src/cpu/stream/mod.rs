//! Volumes that fit into no memory (SPEC §13): every tile is drawn front to back, and asks for a store's chunks as their depth comes. A chunk behind
//! opaque pixels is never read. Images are those of the volume in memory: byte by byte, but where classification comes after splatting and the store does not
//! know the range of its values, to rounding.

mod approach;
mod chunk;
mod pool;
mod ranges;
mod renderer;
mod source;

use std::sync::Arc;

use glam::UVec3;

use super::bin::Placed;
use super::material::Material;
use crate::lists::quad_plan::Overlaps;
use crate::parallel::ThreadPool;
use crate::volume::Grid;
use crate::volume::range::{EMPTY, union};
pub(super) use approach::Approach;
pub(super) use chunk::Chunk;
use pool::Pool;
pub use renderer::StreamRenderer;
use source::Source;

/// A store in a view.
#[derive(Debug)]
pub(super) struct Stream {
    source: Source,
    pool: Pool,
    /// Threads that only read. Those that draw wait for them, and must not draw another tile meanwhile, which might wait for the first.
    readers: ThreadPool,
    /// The number of chunks that a tile lets be read at once.
    ahead: usize,
}

impl Stream {
    /// The voxels of the store's level.
    pub(super) fn grid(&self) -> &Grid {
        &self.source.grid
    }

    /// The number of chunks.
    pub(super) fn chunks(&self) -> u32 {
        self.source.across().element_product()
    }

    /// The first voxel of a chunk, and its voxels along each axis.
    pub(super) fn bounds(&self, number: u32) -> (UVec3, UVec3) {
        self.source.bounds(number)
    }

    /// The minimum and maximum of the values in the chunks that share voxels with a box, as far as they are known.
    pub(super) fn range(&self, within: (UVec3, UVec3)) -> Option<[f32; 2]> {
        self.chunks_in(within).try_fold(EMPTY, |all, number| Some(union(all, self.source.known_range(number)?)))
    }

    /// Where a box of a chunk's voxels is, given by its first voxel and its voxels along each axis; `None` off the image.
    fn place(&self, number: u32, within: (UVec3, UVec3)) -> Option<Placed> {
        self.source.place(number, within)
    }

    /// Whether none of a chunk's voxels is splatted, as far as its values are known.
    fn shows_nothing(&self, number: u32) -> bool {
        self.source.shows_nothing(number)
    }

    /// Whether nothing is known of a chunk's values.
    pub(super) fn is_unread(&self, number: u32) -> bool {
        self.source.known_range(number).is_none()
    }

    /// The chunks that share voxels with a box, given by its first voxel and its voxels along each axis.
    pub(super) fn chunks_in(&self, (low, dims): (UVec3, UVec3)) -> impl Iterator<Item = u32> {
        let (side, across) = (self.source.side, self.source.across());
        let (first, last) = (low / side, (low + dims - 1) / side);
        let number = move |x, y, z| x + across.x * (y + across.y * z);
        let row = move |y, z| (first.x..=last.x).map(move |x| number(x, y, z));
        (first.z..=last.z).flat_map(move |z| (first.y..=last.y).flat_map(move |y| row(y, z)))
    }

    /// The values of a box from some of the chunks; NaN from others.
    pub(super) fn values(self: &Arc<Self>, (low, dims): (UVec3, UVec3), seen: &[u32]) -> Vec<f32> {
        let store = &self.source.store;
        let mut values = vec![f32::NAN; dims.element_product() as usize];
        for (at, &number) in seen.iter().enumerate() {
            // The next ones are read meanwhile.
            seen[at..].iter().take(self.ahead).for_each(|&number| self.request(number));
            let Some(chunk) = self.chunk(number) else { break };
            let (own, own_dims) = self.bounds(number);
            let (from, end) = (own.max(low), (own + own_dims).min(low + dims));
            let rows = (from.z..end.z).flat_map(|z| (from.y..end.y).map(move |y| UVec3::new(from.x, y, z)));
            let count = (end.x - from.x) as usize;
            let index = |voxel: UVec3, low: UVec3, dims: UVec3| {
                let [x, y, z] = (voxel - low).to_array().map(|n| n as usize);
                x + dims.x as usize * (y + dims.y as usize * z)
            };
            for row in rows {
                let there = &mut values[index(row, low, dims)..][..count];
                match chunk.values() {
                    None => there.fill(store.fill()),
                    Some((low, read)) => {
                        let first = index(row, low, read.dims());
                        let own = read.values().slice(first..first + count);
                        there.iter_mut().zip(own).for_each(|(there, own)| *there = own);
                    }
                }
            }
        }
        values
    }

    /// All chunks that may be on the image, in memory order.
    pub(super) fn placed(&self) -> Vec<Placed> {
        self.source.placed()
    }

    /// Lets a chunk be read if it is not in memory.
    pub(super) fn request(self: &Arc<Self>, number: u32) {
        if self.pool.reserve(number) {
            let stream = Arc::clone(self);
            self.readers.spawn(move || stream.pool.read(&stream.source, number));
        }
    }

    /// A chunk, once it has been read; `None` if the store cannot be read, which makes the frame an error.
    pub(super) fn chunk(self: &Arc<Self>, number: u32) -> Option<Arc<Chunk>> {
        loop {
            self.request(number);
            match self.pool.wait(number) {
                None if !self.pool.has_failed() => {}
                found => return found,
            }
        }
    }

    /// The material of a chunk's voxel. Its gradient may need values of other chunks, which are read for it; with a label map they have been read with the
    /// chunk.
    pub(super) fn material(self: &Arc<Self>, chunk: &Chunk, voxel: UVec3) -> Material {
        let of_labels = self.source.splats.as_ref().filter(|splats| splats.transfer.membership);
        if let (Some(splats), Some((low, volume))) = (of_labels, chunk.values()) {
            return Material::of(volume, &splats.transfer, voxel - low);
        }
        let value = |voxel| {
            let outside = || self.chunk(self.source.number_of(voxel))?.value(voxel);
            chunk.value(voxel).or_else(outside).unwrap_or_else(|| self.source.store.fill())
        };
        let (volume, at) = self.source.around(voxel, value);
        self.source.splats.as_ref().map_or_else(Material::default, |splats| Material::of(&volume, &splats.transfer, at))
    }

    /// The overlaps of the voxels that have been read with slabs.
    pub(super) fn overlaps(&self) -> Overlaps {
        self.pool.reads().overlaps
    }
}
