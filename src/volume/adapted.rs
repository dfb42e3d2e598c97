//! Stores with something added: another spacing, or somebody who is told of every chunk that is read.

use std::fmt::{self, Debug, Formatter};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use glam::{DVec3, UVec3};

use super::grid::check_spacing;
use super::{Store, StoreFacts, StoreLevel, VolumeError, refused};

/// A function that is told how many chunks of a level have been read, and how many there are.
pub type ChunkProgress = dyn Fn(u64, u64) + Send + Sync;

/// A store whose voxels are farther apart, or nearer.
#[derive(Debug)]
pub(crate) struct SpacedStore {
    store: Arc<dyn Store>,
    levels: Vec<StoreLevel>,
}

impl SpacedStore {
    /// A store with the spacing of its finest level; the others' is in proportion. `origin` names the store in errors.
    ///
    /// # Errors
    /// As for [`Volume::with_spacing`](super::Volume::with_spacing).
    pub(crate) fn new(origin: &str, store: Arc<dyn Store>, spacing: DVec3) -> Result<Self, VolumeError> {
        check_spacing("spacing", spacing).map_err(|error| refused(origin, error))?;
        let spaced = |level: &StoreLevel| {
            let grid = level.grid.with_finest_spacing(spacing);
            grid.check().map_err(|error| refused(origin, error))?;
            Ok(StoreLevel { grid, ..*level })
        };
        let levels = store.levels().iter().map(spaced).collect::<Result<_, VolumeError>>()?;
        Ok(Self { store, levels })
    }
}

impl Store for SpacedStore {
    fn levels(&self) -> &[StoreLevel] {
        &self.levels
    }

    fn read(&self, level: usize, from: UVec3, dims: UVec3, values: &mut [f32]) -> Result<u64, VolumeError> {
        self.store.read(level, from, dims, values)
    }

    fn contains(&self, level: usize, chunk: UVec3) -> Result<bool, VolumeError> {
        self.store.contains(level, chunk)
    }

    fn fill(&self) -> f32 {
        self.store.fill()
    }

    fn range(&self, level: usize) -> Option<[f32; 2]> {
        self.store.range(level)
    }

    fn chunk_range(&self, level: usize, chunk: UVec3) -> Option<[f32; 2]> {
        self.store.chunk_range(level, chunk)
    }

    fn facts(&self) -> StoreFacts {
        self.store.facts()
    }

    fn identity(&self) -> String {
        self.store.identity()
    }
}

/// A store that tells of the chunks of one level that are read, each once.
pub(super) struct WatchedStore {
    store: Arc<dyn Store>,
    level: usize,
    total: u64,
    /// A bit for every chunk: whether any of its voxels has been read.
    read: Vec<AtomicU64>,
    count: AtomicU64,
    progress: Arc<ChunkProgress>,
}

impl WatchedStore {
    pub(super) fn new(store: Arc<dyn Store>, level: usize, progress: Arc<ChunkProgress>) -> Self {
        let total = store.levels()[level].chunks().as_u64vec3().element_product();
        let read = (0..total.div_ceil(64)).map(|_| AtomicU64::new(0)).collect();
        Self { store, level, total, read, count: AtomicU64::new(0), progress }
    }

    /// Notes that a box has been read.
    fn note(&self, from: UVec3, dims: UVec3) {
        let of = &self.store.levels()[self.level];
        let (across, first, last) = (of.chunks().as_u64vec3(), from / of.chunk, (from + dims - 1) / of.chunk);
        for (z, y) in (first.z..=last.z).flat_map(|z| (first.y..=last.y).map(move |y| (z, y))) {
            for x in first.x..=last.x {
                let number = u64::from(x) + across.x * (u64::from(y) + across.y * u64::from(z));
                let bit = 1 << (number % 64);
                if self.read[(number / 64) as usize].fetch_or(bit, Ordering::Relaxed) & bit == 0 {
                    (self.progress)(self.count.fetch_add(1, Ordering::Relaxed) + 1, self.total);
                }
            }
        }
    }
}

impl Debug for WatchedStore {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.debug_struct("WatchedStore").field("store", &self.store).field("level", &self.level).finish_non_exhaustive()
    }
}

impl Store for WatchedStore {
    fn levels(&self) -> &[StoreLevel] {
        self.store.levels()
    }

    fn read(&self, level: usize, from: UVec3, dims: UVec3, values: &mut [f32]) -> Result<u64, VolumeError> {
        let bytes = self.store.read(level, from, dims, values)?;
        if level == self.level {
            self.note(from, dims);
        }
        Ok(bytes)
    }

    fn contains(&self, level: usize, chunk: UVec3) -> Result<bool, VolumeError> {
        self.store.contains(level, chunk)
    }

    fn fill(&self) -> f32 {
        self.store.fill()
    }

    fn range(&self, level: usize) -> Option<[f32; 2]> {
        self.store.range(level)
    }

    fn chunk_range(&self, level: usize, chunk: UVec3) -> Option<[f32; 2]> {
        self.store.chunk_range(level, chunk)
    }

    fn facts(&self) -> StoreFacts {
        self.store.facts()
    }

    fn identity(&self) -> String {
        self.store.identity()
    }
}
