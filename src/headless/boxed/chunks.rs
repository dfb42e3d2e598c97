//! The chunks of a store in a view, and the boxes of voxels that bear on windows.

use std::collections::HashSet;
use std::ops::Range;

use glam::{DVec2, DVec3, UVec3};

use crate::error::RenderError;
use crate::error::setting::SettingError;
use crate::geometry::plane_geometry::PlaneGeometry;
use crate::geometry::view_geometry::ViewGeometry;
use crate::lists::iso_range::ValueSet;
use crate::parallel::prelude::*;
use crate::scene::Scene;
use crate::settings::splatting::Classification;
use crate::settings::window::Region;
use crate::stats::StoreCounts;
use crate::volume::range::{EMPTY, union};
use crate::volume::{StoreLevel, StreamedVolume, Volume, VolumeError};

/// The maximum number of chunks.
const MOST_CHUNKS: u64 = 1 << 24;

/// The part of the chunks' memory that the values of a box may take: backends hold them several times.
const SHARE: u64 = 4;

/// Slabs around those of a window, which share planes with them.
const SLABS: f64 = 2.0;

/// Voxels around those whose kernels reach a window: for differences between neighbours, and rounding.
const RIM: f64 = 3.0;

/// Pixels around those of a window.
const PIXELS: f64 = 1.0;

/// The chunks of a level in a view.
pub(super) struct Chunks<'a> {
    volume: &'a StreamedVolume,
    level: StoreLevel,
    view: ViewGeometry,
    /// Voxels around a point on a pixel's ray whose kernels reach it.
    half_box: DVec3,
    /// The values that can be seen; `None` where chunks are smaller than the distance at which values bear on what is seen.
    shown: Option<Shown>,
    read: HashSet<UVec3>,
    bytes_read: u64,
    most_held: u64,
}

/// By which values it is told that a chunk shows nothing.
struct Shown {
    values: ValueSet,
    /// Whether points between voxels have values between theirs.
    is_between: bool,
}

/// A box of voxels: the first one, and the one behind the last.
#[derive(Clone, Copy)]
pub(super) struct VoxelBox {
    low: UVec3,
    end: UVec3,
}

/// Some slabs, and the box of voxels that they need; `None` if they need none.
pub(super) type Step = (Range<i32>, Option<VoxelBox>);

/// What was read of a chunk for a box: the first voxel and the voxels along each axis, their values, and the bytes of the store; no bytes if the store does not hold
/// the chunk.
struct Piece {
    chunk: UVec3,
    low: UVec3,
    dims: UVec3,
    values: Vec<f32>,
    bytes: Option<u64>,
}

impl<'a> Chunks<'a> {
    /// # Errors
    /// If the chunks are too many.
    pub(super) fn new(volume: &'a StreamedVolume, scene: &Scene, view: &ViewGeometry) -> Result<Self, RenderError> {
        let level = volume.store.levels()[volume.level];
        let across = level.chunks();
        let count = across.to_array().iter().fold(1, |count: u64, &n| count.saturating_mul(n.into()));
        if level.chunk.min_element() == 0 || count > MOST_CHUNKS {
            let found = format!("chunks of {} voxels in a level of {}", level.chunk, level.grid.dims);
            let allowed = format!("at most {MOST_CHUNKS} chunks of at least 1 voxel");
            return Err(SettingError::new("volume", found, allowed).into());
        }
        let is_after = scene.splatting.classification == Classification::After;
        let geometry = PlaneGeometry::new(view, &level.grid);
        let reach = if is_after { geometry.reach(view) } else { UVec3::ZERO };
        let shown = reach
            .cmple(level.chunk)
            .all()
            .then(|| ValueSet::of_tables(&scene.resolve(&volume.sample).tables(None)))
            .map(|values| Shown { values, is_between: is_after });
        let half_box = geometry.widest_half_box(view);
        let (read, bytes_read, most_held) = (HashSet::new(), 0, 0);
        Ok(Self { volume, level, view: *view, half_box, shown, read, bytes_read, most_held })
    }

    /// The steps in which the slabs behind a region are drawn, front to back, each of as many slabs as fit into memory with the voxels that they need; `None` if
    /// those of some slab do not fit.
    pub(super) fn steps(&self, region: &Region, slabs: &Range<i32>) -> Option<Vec<Step>> {
        let mut steps = Vec::new();
        let mut start = slabs.start;
        while start < slabs.end {
            let step = self.deepest(region, start..slabs.end)?;
            start = step.0.end;
            steps.push(step);
        }
        Some(steps)
    }

    /// The first step of those of some slabs.
    fn deepest(&self, region: &Region, slabs: Range<i32>) -> Option<Step> {
        let mut best = None;
        let mut depth = 1;
        loop {
            let end = slabs.end.min(slabs.start.saturating_add(depth));
            let needed = self.needed(region, &(slabs.start..end));
            if needed.map_or(0, |needed| needed.bytes()) > self.budget() {
                return best;
            }
            best = Some((slabs.start..end, needed));
            if end == slabs.end {
                return best;
            }
            depth = depth.saturating_mul(2);
        }
    }

    /// The smallest box with all voxels that can change a pixel of a region in some slabs; `None` if no voxel can.
    fn needed(&self, region: &Region, slabs: &Range<i32>) -> Option<VoxelBox> {
        let view = &self.view;
        let first = DVec2::new(f64::from(region.x), f64::from(region.y)) - PIXELS;
        let last = first + DVec2::new(f64::from(region.width), f64::from(region.height)) + 2.0 * PIXELS;
        let near = view.perspective.map_or(f64::NEG_INFINITY, |perspective| view.slabs.origin + perspective.eye.near);
        let depth = |slab: i32, around: f64| (view.slabs.plane(slab) + around * view.slabs.width).max(near);
        let depths = [depth(slabs.start, -SLABS), depth(slabs.end, SLABS)];
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for depth in depths {
            for (x, y) in [(first.x, first.y), (last.x, first.y), (first.x, last.y), (last.x, last.y)] {
                let at = view.voxel_at(DVec2::new(x, y), depth);
                (low, high) = (low.min(at), high.max(at));
            }
        }
        let dims = self.level.grid.dims.as_dvec3();
        let low = (low - self.half_box - RIM).floor().max(DVec3::ZERO);
        let end = (high + self.half_box + RIM).ceil().min(dims);
        low.cmplt(end).all().then(|| VoxelBox { low: low.as_uvec3(), end: end.as_uvec3() })
    }

    /// Reads the values of a box; `None` if nothing of it can be seen.
    ///
    /// # Errors
    /// If the store cannot be read.
    pub(super) fn read(&mut self, VoxelBox { low, end }: VoxelBox) -> Result<Option<Volume>, RenderError> {
        let chunks: Vec<UVec3> = between(low / self.level.chunk, (end - 1) / self.level.chunk).collect();
        let mut is_visible = false;
        for &chunk in &chunks {
            is_visible = is_visible || self.is_visible(chunk)?;
        }
        if !is_visible {
            return Ok(None);
        }
        let grid = self.level.grid.part(low, end - low);
        let pieces = chunks.into_par_iter().map(|chunk| self.piece(chunk, VoxelBox { low, end }));
        let pieces = pieces.collect::<Result<Vec<_>, _>>()?;
        let mut values = vec![f32::NAN; grid.dims.element_product() as usize];
        self.most_held = self.most_held.max(size_of_val(values.as_slice()) as u64);
        for Piece { chunk, low: from, dims, values: own, bytes } in pieces {
            for (row, number) in own.chunks_exact(dims.x as usize).zip(0..) {
                let first = from - low + UVec3::new(0, number % dims.y, number / dims.y);
                values[grid.index_of(first) as usize..][..row.len()].copy_from_slice(row);
            }
            if let Some(bytes) = bytes.filter(|_| self.read.insert(chunk)) {
                self.bytes_read += bytes;
            }
        }
        values.iter_mut().filter(|value| !value.is_finite()).for_each(|value| *value = f32::NAN);
        Ok(Some(Volume::piece(grid, values)))
    }

    /// Reads the part of a chunk that lies in a box.
    fn piece(&self, chunk: UVec3, within: VoxelBox) -> Result<Piece, VolumeError> {
        let (StreamedVolume { store, level, .. }, side) = (self.volume, self.level.chunk);
        let low = within.low.max(chunk * side);
        let dims = within.end.min((chunk + 1) * side) - low;
        let mut values = vec![store.fill(); dims.element_product() as usize];
        let is_held = store.contains(*level, chunk)?;
        let bytes = is_held.then(|| store.read(*level, low, dims, &mut values)).transpose()?;
        Ok(Piece { chunk, low, dims, values, bytes })
    }

    /// Whether anything of a chunk can be seen.
    fn is_visible(&self, chunk: UVec3) -> Result<bool, RenderError> {
        let Some(Shown { values, is_between }) = &self.shown else { return Ok(true) };
        let StreamedVolume { store, level, .. } = self.volume;
        let last = self.level.chunks() - 1;
        let around = if *is_between { 1 } else { 0 };
        let mut range = EMPTY;
        for chunk in between(chunk.saturating_sub(UVec3::splat(around)), (chunk + around).min(last)) {
            if store.contains(*level, chunk)? {
                let Some(own) = store.chunk_range(*level, chunk) else { return Ok(true) };
                range = union(range, own);
            } else if store.fill().is_finite() {
                range = union(range, [store.fill(); 2]);
            }
        }
        let [min, max] = range;
        Ok(min <= max && values.meets(min, max))
    }

    /// The error for a view whose boxes do not fit.
    pub(super) fn too_large(&self) -> SettingError {
        let found =
            format!("{}, in which few pixels see a box of more than {} bytes", self.volume.level, self.budget());
        SettingError::new("volume.level", found, "a coarser level, more pixels, or more memory")
    }

    /// What has been read.
    pub(super) fn counts(&self) -> StoreCounts {
        StoreCounts {
            chunks_read: self.read.len() as u64,
            bytes_read: self.bytes_read,
            chunk_bytes: self.most_held,
            ..StoreCounts::default()
        }
    }

    fn budget(&self) -> u64 {
        self.volume.memory / SHARE
    }
}

impl VoxelBox {
    /// The bytes of the box's values.
    fn bytes(&self) -> u64 {
        let dims = self.end - self.low;
        dims.to_array().iter().fold(size_of::<f32>() as u64, |bytes, &n| bytes.saturating_mul(n.into()))
    }
}

/// All chunks from one to another.
fn between(first: UVec3, last: UVec3) -> impl Iterator<Item = UVec3> {
    let row = move |y, z| (first.x..=last.x).map(move |x| UVec3::new(x, y, z));
    (first.z..=last.z).flat_map(move |z| (first.y..=last.y).flat_map(move |y| row(y, z)))
}
