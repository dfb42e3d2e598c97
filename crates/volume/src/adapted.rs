//! Stores with something added: another spacing, or somebody who is told of every chunk that is read.

use std::fmt::{self, Debug, Formatter};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use glam::{DVec3, UVec3};

use super::error::volume::refused;
use super::grid::check_spacing;
use super::{Store, StoreFacts, StoreLevel, Texel, VolumeError};

/// A function that is told how many chunks of a level have been read, and how many there are.
pub type ChunkProgress = dyn Fn(u64, u64) + Send + Sync;

/// A store with another spacing, or one whose reading somebody is told of. All else is the other store's.
#[derive(Debug)]
pub struct AdaptedStore {
    store: Arc<dyn Store>,
    levels: Vec<StoreLevel>,
    watch: Option<Watch>,
}

impl AdaptedStore {
    /// A store with the spacing of its finest level; the others' is in proportion. `origin` names the store in errors.
    ///
    /// # Errors
    /// As for [`Volume::with_spacing`](super::Volume::with_spacing).
    #[doc(hidden)]
    pub fn spaced(origin: &str, store: Arc<dyn Store>, spacing: DVec3) -> Result<Self, VolumeError> {
        check_spacing("spacing", spacing).map_err(|error| refused(origin, error))?;
        let spaced = |level: &StoreLevel| {
            let grid = level.grid.with_finest_spacing(spacing);
            grid.check().map_err(|error| refused(origin, error))?;
            Ok(StoreLevel { grid, ..*level })
        };
        let levels = store.levels().iter().map(spaced).collect::<Result<_, VolumeError>>()?;
        Ok(Self { store, levels, watch: None })
    }

    /// A store that tells of the chunks of one level that are read, each once.
    pub(super) fn watched(store: Arc<dyn Store>, level: usize, tally: &Arc<Tally>) -> Self {
        let levels = store.levels().to_vec();
        let watch = Watch::new(level, levels[level].chunks(), tally);
        Self { store, levels, watch: Some(watch) }
    }

    /// Tells of a box of a level that has been read.
    fn note(&self, level: usize, from: UVec3, dims: UVec3) {
        if let Some(watch) = self.watch.as_ref().filter(|watch| watch.level == level) {
            watch.note(&self.levels[level], from, dims);
        }
    }
}

/// The number of chunks that have been read of one store or of several.
pub(super) struct Tally {
    total: u64,
    count: AtomicU64,
    progress: Arc<ChunkProgress>,
}

impl Tally {
    /// `total` is the number of all chunks.
    pub(super) fn new(total: u64, progress: Arc<ChunkProgress>) -> Self {
        Self { total, count: AtomicU64::new(0), progress }
    }
}

/// The chunks of a level that have been read.
struct Watch {
    level: usize,
    /// A bit for every chunk: whether any of its voxels has been read.
    read: Vec<AtomicU64>,
    tally: Arc<Tally>,
}

impl Watch {
    fn new(level: usize, chunks: UVec3, tally: &Arc<Tally>) -> Self {
        let total = chunks.as_u64vec3().element_product();
        let read = (0..total.div_ceil(64)).map(|_| AtomicU64::new(0)).collect();
        Self { level, read, tally: Arc::clone(tally) }
    }

    /// Notes that a box of the level has been read.
    fn note(&self, of: &StoreLevel, from: UVec3, dims: UVec3) {
        let (across, first, last) = (of.chunks().as_u64vec3(), from / of.chunk, (from + dims - 1) / of.chunk);
        for (z, y) in (first.z..=last.z).flat_map(|z| (first.y..=last.y).map(move |y| (z, y))) {
            for x in first.x..=last.x {
                let number = u64::from(x) + across.x * (u64::from(y) + across.y * u64::from(z));
                let bit = 1 << (number % 64);
                if self.read[(number / 64) as usize].fetch_or(bit, Ordering::Relaxed) & bit == 0 {
                    let Tally { total, count, progress } = &*self.tally;
                    progress(count.fetch_add(1, Ordering::Relaxed) + 1, *total);
                }
            }
        }
    }
}

impl Debug for Watch {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.debug_struct("Watch").field("level", &self.level).finish_non_exhaustive()
    }
}

impl Store for AdaptedStore {
    fn levels(&self) -> &[StoreLevel] {
        &self.levels
    }

    fn read(&self, level: usize, from: UVec3, dims: UVec3, values: &mut [f32]) -> Result<u64, VolumeError> {
        let bytes = self.store.read(level, from, dims, values)?;
        self.note(level, from, dims);
        Ok(bytes)
    }

    fn has_colors(&self) -> bool {
        self.store.has_colors()
    }

    fn read_colors(
        &self,
        level: usize,
        from: UVec3,
        dims: UVec3,
        values: &mut [f32],
        colors: &mut [Texel],
    ) -> Result<u64, VolumeError> {
        let bytes = self.store.read_colors(level, from, dims, values, colors)?;
        self.note(level, from, dims);
        Ok(bytes)
    }

    fn contains(&self, level: usize, chunk: UVec3) -> Result<bool, VolumeError> {
        self.store.contains(level, chunk)
    }

    fn fill(&self) -> f32 {
        self.store.fill()
    }

    fn decodes_whole_chunks(&self) -> bool {
        self.store.decodes_whole_chunks()
    }

    fn memory(&self, level: usize) -> u64 {
        self.store.memory(level)
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
