//! Volumes that are read while they are drawn.

use std::sync::Arc;

use super::adapted::AdaptedStore;
use super::{ChunkProgress, Grid, IndexedStore, Store, StoreIndex, Volume, VolumeError, sample};
use crate::stats::StoreCounts;

/// A level of a store that is drawn without being in memory as a whole (SPEC §13).
#[derive(Clone, Debug)]
pub struct StreamedVolume {
    /// The store.
    pub store: Arc<dyn Store>,
    /// The level that is drawn.
    pub level: usize,
    /// Values by which everything is chosen that scenes leave open, such as the transfer function and the camera's frame: a coarser level, or a subset of the
    /// voxels, with the same box.
    pub sample: Arc<Volume>,
    /// The bytes that chunks may hold together; beyond them those are dropped, and read again, that no tile is drawn from.
    pub memory: u64,
}

impl StreamedVolume {
    /// Reads the sample of a level that is to be drawn with some bytes of memory: an eighth of them for the sample, half of them for chunks. `origin` names the
    /// store in errors.
    ///
    /// # Errors
    /// If the store has no such level, cannot be read, or holds no finite value in the sample.
    pub fn new(origin: &str, store: Arc<dyn Store>, level: usize, memory: u64) -> Result<Self, VolumeError> {
        let levels = store.levels().len();
        if level >= levels {
            let allowed = format!("0 to {}", levels - 1);
            return Err(super::invalid(origin, "level", level.to_string(), allowed));
        }
        let sampled = Some(store.levels()[level].grid);
        let sample = Arc::new(Volume { sampled, ..sample(origin, &*store, memory / 8)? });
        Ok(Self { store, level, sample, memory: memory / 2 })
    }

    /// The same volume, none of whose chunks is read that an index tells to show nothing. `origin` names the index in errors.
    ///
    /// # Errors
    /// If the index is of another store.
    pub fn with_index(self, index: StoreIndex, origin: &str) -> Result<Self, VolumeError> {
        let store = Arc::new(IndexedStore::new(self.store, index, origin)?);
        Ok(Self { store, ..self })
    }

    /// The same volume, with a function that is told of every chunk of the level when it is read for the first time. Several threads may call it at once.
    pub fn watched_by(self, progress: Arc<ChunkProgress>) -> Self {
        let store = Arc::new(AdaptedStore::watched(self.store, self.level, progress));
        Self { store, ..self }
    }

    /// The counts of a frame with those of reading the sample.
    pub(crate) fn with_sample(&self, counts: StoreCounts) -> StoreCounts {
        let of_sample = self.sample.reads().unwrap_or_default();
        StoreCounts { sample_chunks_read: of_sample.chunks_read, sample_bytes_read: of_sample.bytes_read, ..counts }
    }

    /// The grid of the level that is drawn.
    pub(crate) fn grid(&self) -> &Grid {
        &self.store.levels()[self.level].grid
    }
}
