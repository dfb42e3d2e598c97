//! Samples of stores: as many values as fit into memory, from which histograms, presets and the camera's frame are taken.

use glam::{DVec3, UVec3};

use super::{Grid, Store, StoreLevel, Texel, Values, Volume, VolumeError};
use crate::StoreCounts;
use crate::parallel::prelude::*;

/// The maximum number of chunks that are read of a level of which not all values fit.
const MOST_CHUNKS: u64 = 1000;

/// Reads a sample of a store's values, which takes at most `memory` bytes: the finest level that fits, or else every nth voxel along each axis of the
/// coarsest level. The sample's voxels lie where they do in the store. `origin` names the store in errors.
///
/// Of a level that does not fit and has more than 1000 chunks, no more are read, evenly spread. Each stands for those around it, as far as the ranges allow that the
/// store knows of their values ([`Store::chunk_range`]): these decide the minimum and the maximum.
///
/// # Errors
/// If the store cannot be read, or holds no finite value there.
pub fn sample(origin: &str, store: &dyn Store, memory: u64) -> Result<Volume, VolumeError> {
    let grids: Vec<Grid> = store.levels().iter().map(|level| level.grid).collect();
    let (number, step) = spread(&grids, memory / parts_of(store));
    some(origin, sample_at(origin, store, (number, step), Chunks::Few)?)
}

/// Which chunks of a level are read for every nth voxel of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Chunks {
    /// At most 1000, evenly spread, each of which stands for those around it.
    Few,
    /// All.
    All,
}

/// The memory of a voxel of a store, counted in values.
pub(super) fn parts_of(store: &dyn Store) -> u64 {
    if store.has_colors() { 1 + (size_of::<Texel>() / size_of::<f32>()) as u64 } else { 1 }
}

/// Of some levels, from the finest, the number of the one that a sample of at most `memory` bytes is taken of, and the sample's step in voxels.
pub(super) fn spread(grids: &[Grid], memory: u64) -> (usize, u32) {
    let values_of = |dims: UVec3| dims.to_array().map(u64::from).iter().product::<u64>();
    let fits = |dims: UVec3| values_of(dims).saturating_mul(size_of::<f32>() as u64) <= memory;
    let number = grids.iter().position(|grid| fits(grid.dims)).unwrap_or(grids.len() - 1);
    let dims = grids[number].dims;
    let longest = dims.max_element();
    let fits_by = |step: u32| fits(dims.map(|count| count.div_ceil(step)));
    (number, (1..longest).find(|&step| fits_by(step)).unwrap_or(longest))
}

/// A sample that has a finite value.
///
/// # Errors
/// If it has none.
pub(super) fn some(origin: &str, sample: Volume) -> Result<Volume, VolumeError> {
    if sample.holes < sample.grid.voxels() {
        return Ok(sample);
    }
    let found = "only NaN or infinite samples".to_owned();
    Err(VolumeError::invalid(origin, "data", found, "at least one finite sample".to_owned()))
}

/// Every `step`th voxel of a level along each axis; all may be holes.
pub(super) fn sample_at(
    origin: &str,
    store: &dyn Store,
    (number, step): (usize, u32),
    chunks: Chunks,
) -> Result<Volume, VolumeError> {
    let levels = store.levels();
    let level = &levels[number];
    let dims = level.grid.dims.map(|count| count.div_ceil(step));
    let mut values = vec![0.0; dims.element_product() as usize];
    let mut colors = vec![Texel::default(); if store.has_colors() { values.len() } else { 0 }];
    let (pieces, reads) = pieces(store, (number, level), step, chunks)?;
    for piece in pieces {
        put(&piece.values, &piece, (&mut values, dims));
        put(&piece.colors, &piece, (&mut colors, dims));
    }
    let spacing = level.grid.spacing * f64::from(step);
    // The first voxel of the sample is the level's first.
    let center = |grid: &Grid| grid.center() * grid.spacing;
    let grid = Grid { turned: level.grid.turned, ..Grid::new(dims, spacing) };
    let place: DVec3 = level.grid.place() + center(&grid) - center(&level.grid);
    let grid = if number == 0 && step == 1 { level.grid } else { grid.coarser_than(&levels[0].grid, place) };
    let volume = Volume::punched(grid, Values::from(values).narrowed());
    let volume = if store.has_colors() { volume.with_texels(colors) } else { volume };
    Volume { reads: Some(reads), ..volume }.stating(origin, store.facts())
}

/// The voxels of a sample that lie in one chunk: the first one, how many there are along each axis, their values, and their colours if they have any.
struct Piece {
    from: UVec3,
    dims: UVec3,
    values: Vec<f32>,
    colors: Vec<Texel>,
}

/// What was read of a chunk: the first voxel and the voxels along each axis, their values and colours, and the bytes of the store; no values if the store does
/// not hold it.
struct Read {
    low: UVec3,
    dims: UVec3,
    values: Option<Vec<f32>>,
    colors: Vec<Texel>,
    bytes: u64,
}

/// Puts what a piece has of each of its voxels, if it has anything, where they are in the sample.
fn put<T: Copy>(own: &[T], Piece { from, dims: own_dims, .. }: &Piece, (to, dims): (&mut [T], UVec3)) {
    for (at, row) in (0..).zip(own.chunks(own_dims.x as usize)) {
        let (y, z) = (from.y + at % own_dims.y, from.z + at / own_dims.y);
        let first = (from.x + dims.x * (y + dims.y * z)) as usize;
        to[first..first + row.len()].copy_from_slice(row);
    }
}

/// Every `step`th voxel of a level, chunk by chunk; and what was read for it.
fn pieces(
    store: &dyn Store,
    (number, level): (usize, &StoreLevel),
    step: u32,
    chunks: Chunks,
) -> Result<(Vec<Piece>, StoreCounts), VolumeError> {
    let across = level.chunks();
    let total = across.as_u64vec3().element_product();
    // Chunks to a side of the boxes of which one is read.
    let groups = |side: u32| across.map(|count| count.div_ceil(side));
    let is_few = |side: &u32| groups(*side).as_u64vec3().element_product() <= MOST_CHUNKS;
    let side =
        if step == 1 || chunks == Chunks::All { 1 } else { (1..=across.max_element()).find(is_few).unwrap_or(1) };
    let groups = groups(side);
    let of_group = |at: u32| {
        let at = UVec3::new(at % groups.x, at / groups.x % groups.y, at / (groups.x * groups.y)) * side;
        let (low, end) = (at, (at + side).min(across));
        let read = read(store, number, level, low + (end - low - 1) / 2)?;
        let rows = (low.z..end.z).flat_map(|z| (low.y..end.y).map(move |y| (y, z)));
        let chunks = rows.flat_map(|(y, z)| (low.x..end.x).map(move |x| UVec3::new(x, y, z)));
        let pieces: Vec<Piece> = chunks.filter_map(|chunk| piece(store, (number, level), chunk, step, &read)).collect();
        Ok((pieces, u64::from(read.values.is_some()), read.bytes))
    };
    let all = (0..groups.element_product()).into_par_iter().map(of_group).collect::<Result<Vec<_>, VolumeError>>()?;
    let sum = |of: fn(&(Vec<Piece>, u64, u64)) -> u64| all.iter().map(of).sum();
    let reads = StoreCounts {
        level: number as u64,
        chunks_total: total,
        chunks_read: sum(|group| group.1),
        bytes_read: sum(|group| group.2),
        ..StoreCounts::default()
    };
    Ok((all.into_iter().flat_map(|(pieces, ..)| pieces).collect(), reads))
}

/// Reads a chunk.
fn read(store: &dyn Store, number: usize, level: &StoreLevel, chunk: UVec3) -> Result<Read, VolumeError> {
    let (low, high) = (chunk * level.chunk, ((chunk + 1) * level.chunk).min(level.grid.dims));
    let dims = high - low;
    if !store.contains(number, chunk)? {
        return Ok(Read { low, dims, values: None, colors: Vec::new(), bytes: 0 });
    }
    let mut values = vec![0.0; dims.element_product() as usize];
    let mut colors = vec![Texel::default(); if store.has_colors() { values.len() } else { 0 }];
    let bytes = if store.has_colors() {
        store.read_colors(number, low, dims, &mut values, &mut colors)?
    } else {
        store.read(number, low, dims, &mut values)?
    };
    Ok(Read { low, dims, values: Some(values), colors, bytes })
}

/// The sample's voxels within a chunk, from the values of this chunk or of a neighbour that stands for it; `None` if the sample has no voxel there.
fn piece(
    store: &dyn Store,
    (number, level): (usize, &StoreLevel),
    chunk: UVec3,
    step: u32,
    read: &Read,
) -> Option<Piece> {
    let (low, high) = (chunk * level.chunk, ((chunk + 1) * level.chunk).min(level.grid.dims));
    let (from, end) = (low.map(|low| low.div_ceil(step)), high.map(|high| high.div_ceil(step)));
    if !from.cmplt(end).all() {
        return None;
    }
    let dims = end - from;
    let index = |voxel: UVec3| {
        let at = (voxel * step - low).min(read.dims - 1);
        (at.x + read.dims.x * (at.y + read.dims.y * at.z)) as usize
    };
    let rows = || (from.z..end.z).flat_map(|z| (from.y..end.y).map(move |y| (y, z)));
    let indices = || rows().flat_map(|(y, z)| (from.x..end.x).map(move |x| UVec3::new(x, y, z))).map(index);
    let mut values: Vec<f32> =
        indices().map(|index| read.values.as_ref().map_or(store.fill(), |values| values[index])).collect();
    let texel = |index: usize| read.colors.get(index).copied().unwrap_or_default();
    let colors = if store.has_colors() { indices().map(texel).collect() } else { Vec::new() };
    if read.low != low
        && let Some([min, max]) = store.chunk_range(number, chunk)
    {
        if min <= max {
            values.iter_mut().for_each(|value| *value = if value.is_nan() { min } else { value.clamp(min, max) });
            (values[0], *values.last_mut()?) = (min, max);
        } else {
            values.fill(f32::NAN);
        }
    }
    Some(Piece { from, dims, values, colors })
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;
    use std::path::Path;

    use crate::{RawLayout, ReadOptions, SampleType, open_raw_store};

    #[test]
    fn samples_lie_where_the_store_does() {
        let dims = UVec3::new(50, 41, 33);
        let values: Vec<u8> = (0..dims.element_product()).map(|index| (index % 251) as u8).collect();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("volume.raw");
        std::fs::write(&path, &values).unwrap();
        let layout = RawLayout { dims, sample_type: SampleType::U8, big_endian: false, offset: 0 };
        let store = open_raw_store(Path::new(&path), &layout, &ReadOptions::default()).unwrap();
        let whole = Volume::open_raw_with(&path, &layout, &ReadOptions::default()).unwrap();
        for (memory, step) in [(u64::MAX, 1), (100_000, 2), (1000, 7), (4, 50)] {
            let sample = sample("volume.raw", &*store, memory).unwrap();
            assert_eq!(sample.dims(), dims.map(|count| count.div_ceil(step)), "{memory}");
            assert_eq!(sample.grid().unit(), whole.grid().unit());
            for index in 0..sample.dims().element_product() {
                let voxel = sample.grid().voxel_at(index);
                assert_eq!(sample.value(voxel), whole.value(voxel * step), "{memory} {voxel}");
                let place = sample.grid().world_position(voxel) + sample.grid().place();
                assert_eq!(place, whole.grid().world_position(voxel * step), "{memory} {voxel}");
            }
        }
    }

    /// Levels of chunks of 4³ voxels, whose values are functions of the voxel.
    #[derive(Debug)]
    struct Function {
        levels: Vec<StoreLevel>,
        /// Whether the ranges of chunks are known.
        is_indexed: bool,
    }

    impl Function {
        fn new(sides: &[u32], is_indexed: bool) -> Self {
            let finest = Grid::new(UVec3::splat(sides[0]), DVec3::ONE);
            let level = |&side: &u32| {
                let spacing = DVec3::splat(f64::from(sides[0] / side));
                let own = Grid::new(UVec3::splat(side), spacing);
                let grid = if side == sides[0] { finest } else { own.coarser_than(&finest, DVec3::ZERO) };
                StoreLevel { grid, chunk: UVec3::splat(4) }
            };
            Self { levels: sides.iter().map(level).collect(), is_indexed }
        }

        /// Between 0 and 1000, most of it smooth.
        fn value(&self, level: usize, voxel: UVec3) -> f32 {
            let side = self.levels[level].grid.dims.x;
            let peak = UVec3::splat(side - 3);
            if voxel == peak { 1000.0 } else { (voxel.element_sum() * 100 / side) as f32 }
        }

        fn values(&self, level: usize, from: UVec3, dims: UVec3) -> Vec<f32> {
            let own = Grid::new(dims, DVec3::ONE);
            (0..dims.element_product()).map(|index| self.value(level, from + own.voxel_at(index))).collect()
        }
    }

    impl Store for Function {
        fn levels(&self) -> &[StoreLevel] {
            &self.levels
        }

        fn read(&self, level: usize, from: UVec3, dims: UVec3, values: &mut [f32]) -> Result<u64, VolumeError> {
            values.copy_from_slice(&self.values(level, from, dims));
            Ok(values.len() as u64)
        }

        fn contains(&self, _: usize, _: UVec3) -> Result<bool, VolumeError> {
            Ok(true)
        }

        fn fill(&self) -> f32 {
            0.0
        }

        fn chunk_range(&self, level: usize, chunk: UVec3) -> Option<[f32; 2]> {
            let values = || self.values(level, chunk * 4, UVec3::splat(4));
            self.is_indexed.then(|| {
                values().into_iter().fold([f32::MAX, f32::MIN], |[min, max], value| [min.min(value), max.max(value)])
            })
        }

        fn identity(&self) -> String {
            "function".to_owned()
        }
    }

    #[test]
    fn the_finest_level_that_fits_is_the_sample() {
        let store = Function::new(&[64, 32, 16], false);
        for (level, side) in [(0, 64_u64), (1, 32), (2, 16)] {
            let sample = sample("function", &store, side.pow(3) * 4).unwrap();
            assert_eq!(sample.dims(), UVec3::splat(side as u32));
            let value = |index: u32| store.value(level, sample.grid().voxel_at(index));
            assert!((0..).zip(sample.values()).all(|(index, found)| found == value(index)), "{level}");
            assert_eq!((sample.grid().unit(), sample.spacing()), (1.0, DVec3::splat(64.0 / side as f64)));
            let reads = sample.reads().unwrap();
            let chunks = (side / 4).pow(3);
            assert_eq!((reads.level, reads.chunks_read, reads.bytes_read), (level as u64, chunks, side.pow(3)));
        }
    }

    #[test]
    fn no_more_chunks_are_read_than_a_sample_needs() {
        let dims = UVec3::splat(64);
        for is_indexed in [false, true] {
            // 32³ chunks, of every 4³ of which one is read.
            let store = Function::new(&[128], is_indexed);
            let sample = sample("function", &store, 64_u64.pow(3) * 4).unwrap();
            let reads = sample.reads().unwrap();
            assert_eq!((sample.dims(), reads.chunks_total, reads.chunks_read), (dims, 32768, 512));
            assert_eq!(reads.bytes_read, 512 * 64);
            // A chunk stands for others at most two chunks away along each axis, eight voxels of 128.
            let difference = |index: u32| {
                let voxel = sample.grid().voxel_at(index);
                (sample.value(voxel) - store.value(0, voxel * 2)).abs()
            };
            let most = (0..dims.element_product() - 1).map(difference).fold(0.0, f32::max);
            let extremes =
                sample.values().iter().fold([f32::MAX, f32::MIN], |[min, max], value| [min.min(value), max.max(value)]);
            if is_indexed {
                assert_eq!(extremes, [0.0, 1000.0]);
            } else {
                assert!(most <= 8.0 * 3.0 * 100.0 / 128.0 + 1.0, "{most}");
                // The first chunk that is read is the second along each axis.
                assert!(
                    extremes[0] <= 3.0 * 4.0 * 100.0 / 128.0 && (200.0..300.0).contains(&extremes[1]),
                    "{extremes:?}"
                );
            }
        }
    }
}
