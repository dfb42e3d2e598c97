//! The chunks of one channel of a volume that is streamed: of its values and of its labels.

use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use glam::{DVec3, UVec3};

use super::kept::Kept;
use crate::error::RenderError;
use crate::error::setting::SettingError;
use crate::lists::iso_range::ValueSet;
use crate::parallel::current_num_threads;
use crate::parallel::prelude::*;
use crate::settings::splatting::{Classification, Splatting};
use crate::settings::transfer_function::TransferFunction;
use crate::volume::range::{EMPTY, finite_range, union};
use crate::volume::{
    Grid, Labels, Store, StoreLevel, StreamedChannel, StreamedLevel, Texel, Values, Volume, VolumeError, labels_of,
};

/// The maximum number of chunks of a level.
const MOST_CHUNKS: u64 = 1 << 24;

/// The most voxels along each axis of what is read for single ones.
const BLOCK: u32 = 32;

/// A box of voxels: the first one, and the one behind the last.
#[derive(Clone, Copy)]
pub(super) struct VoxelBox {
    pub(super) low: UVec3,
    pub(super) end: UVec3,
}

impl VoxelBox {
    /// Its middle, and half its size, in voxels.
    #[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
    pub(super) fn bounds(&self) -> (DVec3, DVec3) {
        let half = (self.end - self.low - 1).as_dvec3() / 2.0;
        (self.low.as_dvec3() + half, half)
    }

    /// The number of voxels.
    pub(super) fn voxels(&self) -> u64 {
        (self.end - self.low).to_array().iter().fold(1, |all: u64, &n| all.saturating_mul(n.into()))
    }
}

/// A channel, and what has been read of it.
pub(super) struct ChannelChunks<'a> {
    /// The number of the channel in the volume.
    pub(super) number: usize,
    values: LevelChunks<'a>,
    labels: Option<LevelChunks<'a>>,
    /// The values that have an opacity, under the tables of any label.
    opaque: ValueSet,
    /// Whether its values are labels, with normals of their membership.
    is_label_map: bool,
    /// Whether points between voxels have values between theirs.
    is_between: bool,
    /// Whether values count that have no opacity.
    counts_all: bool,
    /// Whether chunks are no smaller than the distance at which values bear on what is seen, so that chunks tell what can be seen by their neighbours' values.
    is_told_by_chunks: bool,
}

impl<'a> ChannelChunks<'a> {
    /// A channel, given by its number, under its transfer function. Values bear on points at most `reach` voxels away. Decoded chunks of values, and those of
    /// labels, may take `kept` bytes.
    ///
    /// # Errors
    /// If the chunks are too many.
    pub(super) fn new(
        (number, channel): (usize, &'a StreamedChannel),
        transfer: &TransferFunction,
        splatting: &Splatting,
        (reach, kept): (UVec3, u64),
    ) -> Result<Self, SettingError> {
        let values = LevelChunks::new(&channel.values, kept)?;
        let labels = channel.labels.as_ref().map(|labels| LevelChunks::new(labels, kept)).transpose()?;
        let opaque = opaque_values(transfer);
        let is_told_by_chunks = reach.cmple(values.level.chunk).all();
        let is_between = splatting.classification == Classification::After;
        let (is_label_map, counts_all) =
            (transfer.membership, splatting.compositing.counts_all_values(splatting.classification));
        Ok(Self { number, values, labels, opaque, is_label_map, is_between, counts_all, is_told_by_chunks })
    }

    /// Whether any value has an opacity.
    pub(super) fn has_opacity(&self) -> bool {
        !self.opaque.ranges().is_empty()
    }

    /// Whether values count that have no opacity.
    #[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
    pub(super) fn counts_all(&self) -> bool {
        self.counts_all
    }

    /// What is read of the channel.
    pub(super) fn levels(&self) -> impl Iterator<Item = &LevelChunks<'a>> {
        std::iter::once(&self.values).chain(&self.labels)
    }

    /// The bytes in memory of a voxel's value, colour and label.
    pub(super) fn voxel_bytes(&self) -> u64 {
        let labels = if self.labels.is_some() { size_of::<u16>() } else { 0 };
        let colors = if self.values.of.store.has_colors() { size_of::<Texel>() } else { 0 };
        (size_of::<f32>() + colors + labels) as u64
    }

    /// Reads some parts of a box of the channel, whose voxels lie on a grid, and leaves holes in the rest; `None` if nothing can be seen of the parts, or of a box
    /// in them.
    ///
    /// # Errors
    /// If a store cannot be read, or holds a value that is no label.
    pub(super) fn read(
        &self,
        (within, parts): (VoxelBox, &[VoxelBox]),
        seen: VoxelBox,
        grid: &Grid,
    ) -> Result<Option<Volume>, RenderError> {
        if !self.is_visible(seen)? {
            return Ok(None);
        }
        let voxels = self.values.read((within, parts), f32::NAN)?;
        if !self.counts_all && !self.has_opaque(voxels.range) {
            return Ok(None);
        }
        self.with_labels(voxels, (within, parts), grid).map(Some)
    }

    /// Reads a box of the channel, whose voxels lie on a grid, seen or not.
    ///
    /// # Errors
    /// If a store cannot be read, or holds a value that is no label.
    #[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
    pub(super) fn read_all(&self, within: VoxelBox, grid: &Grid) -> Result<Volume, RenderError> {
        let parts = (within, &[within][..]);
        self.with_labels(self.values.read(parts, f32::NAN)?, parts, grid)
    }

    /// A volume of the voxels of a box, with the labels of some parts of it, which are read.
    fn with_labels(
        &self,
        Voxels { values, colors, .. }: Voxels,
        (within, parts): (VoxelBox, &[VoxelBox]),
        grid: &Grid,
    ) -> Result<Volume, RenderError> {
        let volume = Volume::punched(*grid, values);
        let volume = if self.is_label_map { volume.as_label_map() } else { volume };
        let volume = if self.values.of.store.has_colors() { volume.with_texels(colors) } else { volume };
        let Some(labels) = &self.labels else { return Ok(volume) };
        let origin = labels.of.origin.clone();
        let values = labels_of(
            &origin,
            (&labels.level.grid, within.low, grid.dims, 1),
            labels.read((within, parts), 0.0)?.values,
        )?;
        let labels = Labels { origin, dims: grid.dims, spacing: None, values, names: BTreeMap::new() };
        Ok(volume.with_labels_in_order(labels)?)
    }

    /// The labels of some voxels, 0 without any, which are read in blocks.
    ///
    /// # Errors
    /// If a store cannot be read, or holds a value that is no label.
    pub(super) fn labels_at(&self, voxels: &[UVec3]) -> Result<Vec<u16>, RenderError> {
        let mut found = vec![0; voxels.len()];
        let Some(labels) = &self.labels else { return Ok(found) };
        let side = labels.level.chunk.min(UVec3::splat(BLOCK));
        let mut blocks = BTreeMap::<[u32; 3], Vec<usize>>::new();
        for (at, voxel) in voxels.iter().enumerate() {
            blocks.entry((voxel / side).to_array()).or_default().push(at);
        }
        for block in blocks.into_values() {
            let ends = (UVec3::MAX, UVec3::ZERO);
            let (low, last) = block.iter().fold(ends, |(low, last), &at| (low.min(voxels[at]), last.max(voxels[at])));
            let (within, grid) = (VoxelBox { low, end: last + 1 }, Grid::new(last + 1 - low, DVec3::ONE));
            let own = labels.read((within, &[within]), 0.0)?.values;
            let own = labels_of(&labels.of.origin, (&labels.level.grid, low, grid.dims, 1), own)?;
            block.into_iter().for_each(|at| found[at] = own[grid.index_of(voxels[at] - low) as usize]);
        }
        Ok(found)
    }

    /// Whether anything of the chunks in a box can be seen.
    fn is_visible(&self, within: VoxelBox) -> Result<bool, VolumeError> {
        if self.counts_all || !self.is_told_by_chunks {
            return Ok(true);
        }
        for chunk in self.values.chunks(within) {
            if self.is_chunk_visible(chunk)? {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Whether anything of a chunk can be seen.
    fn is_chunk_visible(&self, chunk: UVec3) -> Result<bool, VolumeError> {
        let StreamedLevel { store, level, .. } = self.values.of;
        let last = self.values.level.chunks() - 1;
        let around = if self.is_between { 1 } else { 0 };
        let mut range = EMPTY;
        for chunk in between(chunk.saturating_sub(UVec3::splat(around)), (chunk + around).min(last)) {
            if store.contains(*level, chunk)? {
                let Some(own) = store.chunk_range(*level, chunk) else { return Ok(true) };
                range = union(range, own);
            } else if store.fill().is_finite() {
                range = union(range, [store.fill(); 2]);
            }
        }
        Ok(self.has_opaque(range))
    }

    /// Whether a value of a range, which may be empty, has an opacity.
    fn has_opaque(&self, [min, max]: [f32; 2]) -> bool {
        min <= max && self.opaque.meets(min, max)
    }
}

/// The values that have an opacity under the tables of any label of a channel.
pub(in crate::headless) fn opaque_values(transfer: &TransferFunction) -> ValueSet {
    let labels = transfer.labels.keys().map(|&label| Some(label)).chain([None]);
    ValueSet::union_of(labels.map(|label| ValueSet::of_tables(&transfer.tables(label))))
}

/// A level of a store, and what has been read of it.
pub(super) struct LevelChunks<'a> {
    of: &'a StreamedLevel,
    level: StoreLevel,
    /// The chunks of which something was read, and the bytes of the store that this took.
    tally: Mutex<HashMap<UVec3, u64>>,
    /// Chunks, if the store decodes them as a whole, and there is room for as many as are read at once.
    kept: Option<Kept>,
}

/// The values of some voxels, their range, and the voxels' colours if they have any.
struct Voxels {
    values: Vec<f32>,
    range: [f32; 2],
    colors: Vec<Texel>,
}

impl Voxels {
    /// As many voxels of one value, as the store has them.
    fn filled(store: &dyn Store, count: u32, value: f32) -> Self {
        let colors = if store.has_colors() { count } else { 0 };
        Self { values: vec![value; count as usize], range: EMPTY, colors: vec![Texel::default(); colors as usize] }
    }
}

/// What was read of a chunk for a box: the first voxel and the voxels along each axis, what they are, and the bytes of the store; no bytes if the store does not
/// hold the chunk.
struct Piece {
    chunk: UVec3,
    low: UVec3,
    dims: UVec3,
    voxels: Voxels,
    bytes: Option<u64>,
}

impl<'a> LevelChunks<'a> {
    fn new(of: &'a StreamedLevel, kept: u64) -> Result<Self, SettingError> {
        let level = of.store.levels()[of.level];
        let count = if level.chunk.min_element() == 0 { 0 } else { level.chunks().as_u64vec3().element_product() };
        if !(1..=MOST_CHUNKS).contains(&count) {
            let found = format!("chunks of {} voxels in a level of {}", level.chunk, level.grid.dims);
            let allowed = format!("at most {MOST_CHUNKS} chunks of at least 1 voxel");
            return Err(SettingError::new("volume", found, allowed));
        }
        let values = level.chunk.min(level.grid.dims).as_u64vec3().element_product();
        let at_once = values.saturating_mul(size_of::<f32>() as u64).saturating_mul(current_num_threads() as u64);
        let is_kept = of.store.decodes_whole_chunks() && !of.store.has_colors() && at_once <= kept;
        Ok(Self { of, level, tally: Mutex::default(), kept: is_kept.then(|| Kept::new(kept)) })
    }

    /// The number of chunks of which something was read.
    pub(super) fn chunks_read(&self) -> u64 {
        self.tally().len() as u64
    }

    /// The bytes of the store that reading them took, without those of reading again.
    pub(super) fn bytes_read(&self) -> u64 {
        self.tally().values().sum()
    }

    fn tally(&self) -> MutexGuard<'_, HashMap<UVec3, u64>> {
        self.tally.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The voxels along each axis of a chunk.
    #[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
    pub(super) fn chunk(&self) -> UVec3 {
        self.level.chunk
    }

    /// The most bytes that decoded chunks took at a time.
    pub(super) fn most_kept(&self) -> u64 {
        self.kept.as_ref().map_or(0, Kept::most_held)
    }

    /// The chunks that share voxels with a box.
    fn chunks(&self, VoxelBox { low, end }: VoxelBox) -> impl Iterator<Item = UVec3> {
        between(low / self.level.chunk, (end - 1) / self.level.chunk)
    }

    /// Reads the voxels of some parts of a box; the others have a value that stands for what is not read.
    fn read(&self, (within, parts): (VoxelBox, &[VoxelBox]), unread: f32) -> Result<Voxels, VolumeError> {
        let VoxelBox { low, end } = within;
        let chunks = parts.iter().flat_map(|&part| self.chunks(part).map(move |chunk| (chunk, part)));
        let chunks: Vec<(UVec3, VoxelBox)> = chunks.collect();
        let grid = self.level.grid.part(low, end - low);
        let pieces = chunks.into_par_iter().map(|(chunk, part)| self.piece(chunk, part));
        let pieces = pieces.collect::<Result<Vec<_>, _>>()?;
        let mut all = Voxels::filled(&*self.of.store, grid.dims.element_product(), unread);
        for Piece { chunk, low: from, dims, voxels, bytes } in pieces {
            all.range = union(all.range, voxels.range);
            let first = |row: u32| grid.index_of(from - low + UVec3::new(0, row % dims.y, row / dims.y)) as usize;
            put(&voxels.values, dims.x, &mut all.values, first);
            put(&voxels.colors, dims.x, &mut all.colors, first);
            if let Some(bytes) = bytes {
                self.count(chunk, dims, bytes);
            }
        }
        Ok(all)
    }

    /// Counts the bytes that reading a part of a chunk took, given by its voxels along each axis. Parts may share voxels, but a chunk has no more bytes than all of
    /// its voxels.
    fn count(&self, chunk: UVec3, dims: UVec3, bytes: u64) {
        let voxels = |dims: UVec3| dims.as_u64vec3().element_product();
        let first = chunk * self.level.chunk;
        let whole = self.level.chunk.min(self.level.grid.dims - first);
        let of_all = || bytes.div_ceil(voxels(dims)).saturating_mul(voxels(whole));
        let most = if self.of.store.decodes_whole_chunks() { bytes } else { of_all() };
        let mut tally = self.tally();
        let counted = tally.entry(chunk).or_default();
        *counted = (*counted + bytes).min(most.max(*counted));
    }

    /// Reads the part of a chunk that lies in a box.
    fn piece(&self, chunk: UVec3, within: VoxelBox) -> Result<Piece, VolumeError> {
        let (StreamedLevel { store, level, .. }, side) = (self.of, self.level.chunk);
        let low = within.low.max(chunk * side);
        let dims = within.end.min((chunk + 1) * side) - low;
        let mut voxels = Voxels::filled(&**store, dims.element_product(), store.fill());
        let bytes =
            if store.contains(*level, chunk)? { Some(self.fill((chunk, low, dims), &mut voxels)?) } else { None };
        voxels.range = finite_range(&voxels.values);
        Ok(Piece { chunk, low, dims, voxels, bytes })
    }

    /// Fills in the part of a chunk of the store that has a first voxel and voxels along each axis, and returns the bytes of the store that were read.
    fn fill(&self, (chunk, low, dims): (UVec3, UVec3, UVec3), voxels: &mut Voxels) -> Result<u64, VolumeError> {
        let (StreamedLevel { store, level, .. }, side) = (self.of, self.level.chunk);
        let Voxels { values, colors, .. } = voxels;
        if store.has_colors() {
            return store.read_colors(*level, low, dims, values, colors);
        }
        let Some(kept) = &self.kept else { return store.read(*level, low, dims, values) };
        let first = chunk * side;
        let whole = self.level.grid.part(first, self.level.grid.dims.min(first + side) - first);
        let (decoded, bytes) = match kept.get(chunk) {
            // Its bytes have been counted.
            Some(decoded) => (decoded, 0),
            None => {
                let mut decoded = vec![store.fill(); whole.dims.element_product() as usize];
                let bytes = store.read(*level, first, whole.dims, &mut decoded)?;
                let decoded = Arc::new(Values::from(decoded).narrowed());
                kept.keep(chunk, &decoded);
                (decoded, bytes)
            }
        };
        for (row, number) in values.chunks_exact_mut(dims.x as usize).zip(0..) {
            let from = low - first + UVec3::new(0, number % dims.y, number / dims.y);
            let at = whole.index_of(from) as usize;
            let own = decoded.as_slice().slice(at..at + row.len());
            row.iter_mut().zip(own.iter()).for_each(|(to, value)| *to = value);
        }
        Ok(bytes)
    }
}

/// Copies rows, each of `length` voxels, to where `first` tells that the row of a number begins. Of voxels without colours there are no rows.
fn put<T: Copy>(rows: &[T], length: u32, to: &mut [T], first: impl Fn(u32) -> usize) {
    for (row, number) in rows.chunks_exact(length as usize).zip(0..) {
        to[first(number)..][..row.len()].copy_from_slice(row);
    }
}

/// All chunks from one to another.
fn between(first: UVec3, last: UVec3) -> impl Iterator<Item = UVec3> {
    let row = move |y, z| (first.x..=last.x).map(move |x| UVec3::new(x, y, z));
    (first.z..=last.z).flat_map(move |z| (first.y..=last.y).flat_map(move |y| row(y, z)))
}
