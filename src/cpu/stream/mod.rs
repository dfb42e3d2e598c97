//! Volumes that fit into no memory (SPEC §13): every tile is drawn front to back, and asks for a store's chunks as their depth comes. A chunk behind
//! opaque pixels is never read. Images are those of the volume in memory, byte by byte.

mod chunk;
mod pool;
mod renderer;
mod source;

use std::sync::Arc;

use glam::UVec3;
use rayon::ThreadPool;

use super::bin::Placed;
use super::material::Material;
use crate::lists::quad_plan::Overlaps;
pub(super) use chunk::Chunk;
use pool::Pool;
pub use renderer::{StreamError, StreamRenderer};
use source::Source;

/// A store in a view.
#[derive(Debug)]
pub(super) struct Stream {
    source: Source,
    pool: Pool,
    /// Threads that only read. Those that draw wait for them, and must not draw another tile meanwhile, which might wait for the first.
    readers: ThreadPool,
}

impl Stream {
    /// All chunks that may be on the image, by first sheet.
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

    /// The material of a chunk's voxel. Its gradient may need values of other chunks, which are read for it.
    pub(super) fn material(self: &Arc<Self>, chunk: &Chunk, voxel: UVec3) -> Material {
        let value = |voxel| {
            let outside = || self.chunk(self.source.number_of(voxel))?.value(voxel);
            chunk.value(voxel).or_else(outside).unwrap_or_else(|| self.source.store.fill())
        };
        let (volume, at) = self.source.around(voxel, value);
        Material::of(&volume, &self.source.transfer, at)
    }

    /// The overlaps of the voxels that have been read with slabs.
    pub(super) fn overlaps(&self) -> Overlaps {
        self.pool.reads().overlaps
    }
}
