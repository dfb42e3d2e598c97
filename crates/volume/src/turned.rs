//! Left-handed files: world axes are right-handed (SPEC §2), so that of a file whose axes are left-handed the first one is turned.
//!
//! Everything that is drawn or measured in the world has the turned order, and [`Grid::file_voxel`] leads back to the file's own. A volume in memory is turned
//! once it is read; a store is wrapped, and its boxes are turned.

use std::sync::Arc;

use glam::UVec3;

use super::coefficients::KeptCoefficients;
use super::error::volume::VolumeError;
use super::range::union;
use super::{Grid, Orientation, Store, StoreFacts, StoreLevel, Texel, Values, Volume};
use crate::for_type;

/// Reverses the first axis of voxels, x fastest.
pub(super) fn turn<T>(voxels: &mut [T], width: u32) {
    voxels.chunks_exact_mut(width as usize).for_each(<[T]>::reverse);
}

impl Grid {
    /// The same grid with the first axis turned.
    pub(super) fn turned(self) -> Self {
        let mut grid = Self { turned: !self.turned, ..self };
        grid.place.x = -grid.place.x;
        grid
    }

    /// Whether the first axis runs against the file's, whose axes are left-handed.
    pub fn is_turned(&self) -> bool {
        self.turned
    }

    /// The indices that a voxel has in its file, whose first axis may be turned. The same function leads back from them. A voxel outside stays outside.
    pub fn file_voxel(&self, voxel: UVec3) -> UVec3 {
        let x = if self.turned { (self.dims.x - 1).wrapping_sub(voxel.x) } else { voxel.x };
        UVec3::new(x, voxel.y, voxel.z)
    }

    /// Brings a number for every voxel, x fastest, from the file's own order into the grid's, or back.
    #[doc(hidden)]
    pub fn reorder<T>(&self, voxels: &mut [T]) {
        if self.turned {
            turn(voxels, self.dims.x);
        }
    }
}

impl Orientation {
    /// The orientation of a grid with the first axis turned.
    pub(super) fn turned(self, grid: &Grid) -> Self {
        let Self { mut axes, origin } = self;
        let last = axes.x_axis * (f64::from(grid.dims.x - 1) * grid.spacing.x);
        axes.x_axis = -axes.x_axis;
        Self { axes, origin: origin + last }
    }
}

impl Volume {
    /// The same volume with right-handed axes, as its orientation tells, or with left-handed ones turned that lie in no patient.
    pub(super) fn right_handed(self, is_left_handed: bool) -> Self {
        let is_left_handed = is_left_handed || self.orientation.is_some_and(|orientation| orientation.is_mirrored());
        if is_left_handed { self.with_turned(true) } else { self }
    }

    /// The same volume with the first axis turned against the file's, or as in the file.
    pub(super) fn with_turned(mut self, turned: bool) -> Self {
        if self.grid.turned == turned {
            return self;
        }
        let width = self.grid.dims.x;
        self.orientation = self.orientation.map(|orientation| orientation.turned(&self.grid));
        for_type!(Values, &mut self.values, values => turn(values, width));
        self.colors.as_mut().into_iter().for_each(|colors| turn(Arc::make_mut(colors), width));
        self.labels.as_mut().into_iter().for_each(|labels| turn(Arc::make_mut(labels), width));
        let others = self.others.into_iter();
        let others = others.map(|channel| Arc::new(Arc::unwrap_or_clone(channel).with_turned(turned))).collect();
        let (coefficients, membership) = (KeptCoefficients::default(), Default::default());
        Self { grid: self.grid.turned(), others, coefficients, membership, ..self }
    }

    /// How the file's own axes lie in a patient, if known: as [`Self::orientation`], unless the first axis is turned.
    pub fn file_orientation(&self) -> Option<Orientation> {
        let orientation = self.orientation?;
        Some(if self.grid.turned { orientation.turned(&self.grid) } else { orientation })
    }
}

/// Whether a store's orientation has left-handed axes.
#[cfg(feature = "zarr")]
pub(super) fn is_left_handed(store: &dyn Store) -> bool {
    store.facts().orientation.is_some_and(|orientation| orientation.is_mirrored())
}

/// The stores of a file's channels, turned if its axes are left-handed.
pub(super) fn all(stores: Vec<Arc<dyn Store>>, is_left_handed: bool) -> Vec<Arc<dyn Store>> {
    stores.into_iter().map(|store| with_turned(store, is_left_handed)).collect()
}

/// A store with its first axis turned against the file's, or as in the file.
pub(super) fn with_turned(store: Arc<dyn Store>, turned: bool) -> Arc<dyn Store> {
    if store.levels()[0].grid.turned == turned { store } else { Arc::new(TurnedStore::new(store)) }
}

/// A store with its first axis turned. Its chunks begin at the other end, so that one may share voxels with two of the file's.
#[derive(Debug)]
pub(super) struct TurnedStore {
    store: Arc<dyn Store>,
    levels: Vec<StoreLevel>,
}

impl TurnedStore {
    pub(super) fn new(store: Arc<dyn Store>) -> Self {
        let turned = |level: &StoreLevel| StoreLevel { grid: level.grid.turned(), ..*level };
        let levels = store.levels().iter().map(turned).collect();
        Self { store, levels }
    }

    /// The first voxel of a box in the other order. A box that does not lie in the level stays outside.
    fn from(&self, level: usize, from: UVec3, dims: UVec3) -> UVec3 {
        let end = self.levels.get(level).and_then(|level| level.grid.dims.x.checked_sub(from.x)?.checked_sub(dims.x));
        UVec3::new(end.unwrap_or(from.x), from.y, from.z)
    }

    /// The chunks in the other order that share voxels with a chunk; itself if the level has no such chunk.
    fn chunks(&self, level: usize, chunk: UVec3) -> impl Iterator<Item = UVec3> {
        let of = self.levels.get(level).filter(|level| chunk.cmplt(level.chunks()).all());
        let [first, last] = of.map_or([chunk.x; 2], |StoreLevel { grid, chunk: side }| {
            let (low, end) = (chunk.x * side.x, grid.dims.x.min((chunk.x + 1).saturating_mul(side.x)));
            [grid.dims.x - end, grid.dims.x - 1 - low].map(|x| x / side.x)
        });
        (first..=last).map(move |x| UVec3::new(x, chunk.y, chunk.z))
    }
}

impl Store for TurnedStore {
    fn levels(&self) -> &[StoreLevel] {
        &self.levels
    }

    fn read(&self, level: usize, from: UVec3, dims: UVec3, values: &mut [f32]) -> Result<u64, VolumeError> {
        let bytes = self.store.read(level, self.from(level, from, dims), dims, values)?;
        turn(values, dims.x);
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
        let bytes = self.store.read_colors(level, self.from(level, from, dims), dims, values, colors)?;
        turn(values, dims.x);
        turn(colors, dims.x);
        Ok(bytes)
    }

    fn contains(&self, level: usize, chunk: UVec3) -> Result<bool, VolumeError> {
        for chunk in self.chunks(level, chunk) {
            if self.store.contains(level, chunk)? {
                return Ok(true);
            }
        }
        Ok(false)
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

    /// The range of all chunks which share voxels with it.
    fn chunk_range(&self, level: usize, chunk: UVec3) -> Option<[f32; 2]> {
        let ranges = self.chunks(level, chunk).map(|chunk| self.store.chunk_range(level, chunk));
        ranges.reduce(|one, other| Some(union(one?, other?)))?
    }

    fn facts(&self) -> StoreFacts {
        let mut facts = self.store.facts();
        facts.orientation = facts.orientation.map(|orientation| orientation.turned(&self.store.levels()[0].grid));
        facts
    }

    /// Another one than the file's: its chunks are others.
    fn identity(&self) -> String {
        blake3::hash(format!("turned {}", self.store.identity()).as_bytes()).to_hex().to_string()
    }
}
