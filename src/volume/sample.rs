//! Samples of stores: as many values as fit into memory, from which histograms, presets and the camera's frame are taken.

use glam::{DVec3, UVec3};

use super::{Grid, Store, StoreLevel, Volume, VolumeError, invalid, punch_holes};
use crate::parallel::prelude::*;

/// Reads a sample of a store's values, which takes at most `memory` bytes: the finest level that fits, or else every nth voxel along each axis of the
/// coarsest level. The sample's voxels lie where they do in the store. `origin` names the store in errors.
///
/// # Errors
/// If the store cannot be read, or holds no finite value there.
pub fn sample(origin: &str, store: &dyn Store, memory: u64) -> Result<Volume, VolumeError> {
    let levels = store.levels();
    let values_of = |dims: UVec3| dims.to_array().map(u64::from).iter().product::<u64>();
    let fits = |dims: UVec3| values_of(dims).saturating_mul(size_of::<f32>() as u64) <= memory;
    let number = levels.iter().position(|level| fits(level.grid.dims)).unwrap_or(levels.len() - 1);
    let level = &levels[number];
    let of_step = |step: u32| level.grid.dims.map(|count| count.div_ceil(step));
    let longest = level.grid.dims.max_element();
    let step = (1..longest).find(|&step| fits(of_step(step))).unwrap_or(longest);
    let dims = of_step(step);
    let mut values = vec![0.0; dims.element_product() as usize];
    for (from, piece_dims, piece) in pieces(store, number, level, step)? {
        for (at, row) in piece.chunks(piece_dims.x as usize).enumerate() {
            let (y, z) = (from.y + at as u32 % piece_dims.y, from.z + at as u32 / piece_dims.y);
            let first = (from.x + dims.x * (y + dims.y * z)) as usize;
            values[first..first + row.len()].copy_from_slice(row);
        }
    }
    let holes = punch_holes(&mut values);
    if holes == values.len() as u64 {
        let found = "only NaN or infinite samples".to_owned();
        return Err(invalid(origin, "data", found, "at least one finite sample".to_owned()));
    }
    let spacing = level.grid.spacing * f64::from(step);
    // The first voxel of the sample is the level's first.
    let center = |grid: &Grid| grid.center() * grid.spacing;
    let grid = Grid::new(dims, spacing);
    let place: DVec3 = level.grid.place() + center(&grid) - center(&level.grid);
    let grid = if number == 0 && step == 1 { level.grid } else { grid.coarser_than(&levels[0].grid, place) };
    Volume { holes, ..Volume::piece(grid, values) }.stating(origin, store.facts())
}

/// Every `step`th voxel of a level, chunk by chunk: the first voxel of each piece in the sample, the piece's dimensions, and its values.
fn pieces(
    store: &dyn Store,
    number: usize,
    level: &StoreLevel,
    step: u32,
) -> Result<Vec<(UVec3, UVec3, Vec<f32>)>, VolumeError> {
    let StoreLevel { grid, chunk } = *level;
    let across = level.chunks();
    let piece = |at: u32| {
        let at = UVec3::new(at % across.x, at / across.x % across.y, at / (across.x * across.y));
        let (low, high) = (at * chunk, ((at + 1) * chunk).min(grid.dims));
        let (from, end) = (low.map(|low| low.div_ceil(step)), high.map(|high| high.div_ceil(step)));
        let dims = end - from;
        if dims.min_element() == 0 {
            return Ok(None);
        }
        let count = dims.element_product() as usize;
        if !store.contains(number, at)? {
            return Ok(Some((from, dims, vec![store.fill(); count])));
        }
        let own = high - low;
        let mut values = vec![0.0; own.element_product() as usize];
        store.read(number, low, own, &mut values)?;
        let mut picked = Vec::with_capacity(count);
        for (z, y) in (from.z..end.z).flat_map(|z| (from.y..end.y).map(move |y| (z, y))) {
            let row = own.x * (y * step - low.y + own.y * (z * step - low.z));
            picked.extend((from.x..end.x).map(|x| values[(row + x * step - low.x) as usize]));
        }
        Ok(Some((from, dims, picked)))
    };
    (0..across.element_product()).into_par_iter().filter_map(|at| piece(at).transpose()).collect()
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;
    use std::path::Path;

    use crate::volume::{RawLayout, ReadOptions, SampleType, store::open_raw_store};

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
}
