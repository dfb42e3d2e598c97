//! Zarr stores (versions 2 and 3): OME-Zarr 0.4 and 0.5 images with their levels and labels, and plain arrays.
//!
//! A store is a folder, on disk or at an address, or a ZIP archive of one (`.zip`, `.ozx`). `metadata` reads what an array states, `keys` which
//! bytes of the store are read, and `codec` and `shards` take chunks apart.

mod array;
mod axes;
mod blosc;
mod codec;
mod display;
mod extension;
#[cfg(feature = "http")]
mod http;
mod image;
mod json;
mod keys;
mod listings;
mod metadata;
mod multiscale;
mod number;
mod shards;
mod steps;
mod zstandard;

use std::path::Path;
use std::sync::Arc;

use glam::UVec3;

use self::array::{Held, Region};
use self::image::{Image, Level};
use super::access::Access;
use super::error::volume::invalid;
use super::grid::{SIZES, dims_of};
use super::loaded::{Levels, Loaded};
use super::store::{Store, StoreLevel, check_box, check_chunk};
use super::voxel::{Many, Voxel};
use super::voxels::{Voxels, Wanted};
use super::{Grid, StoreFacts, Values, VolumeError};
use crate::StoreCounts;

/// Reads an image at one level.
pub(super) fn read(path: &Path, access: &Access) -> Result<Loaded, VolumeError> {
    match access.wanted() {
        Wanted::Values => read_as::<f32>(path, access),
        Wanted::Ids => read_as::<u64>(path, access),
    }
}

fn read_as<T: Voxel>(path: &Path, access: &Access) -> Result<Loaded, VolumeError>
where
    Voxels: From<T::Many>,
{
    let mut image = Image::open(path, access)?;
    let selection = access.selection();
    image.series.check(path, selection)?;
    let channels = image.series.channels(selection);
    let channels = u64::from(channels.start)..u64::from(channels.end);
    let number = level_of::<T>(&image, channels.end - channels.start, path, access)?;
    let bytes = image.levels[number].array.memory::<T>(channels.end - channels.start);
    image.levels[number].array.keep_within::<T>(access.memory_left().saturating_sub(bytes));
    let level = &image.levels[number];
    let array = &level.array;
    let dims = level.grid.dims;
    let voxels = dims_of(dims.to_array()).ok_or_else(|| invalid(path, "sizes", dims, SIZES))?.element_product();
    let count = (channels.end - channels.start) * u64::from(voxels);
    let time = u64::from(selection.time.unwrap_or(0));
    let pieces = array.pieces::<T>(channels.clone(), time);
    let found = format!("{} × {} × {} voxels of {} channels", dims.x, dims.y, dims.z, count / u64::from(voxels));
    access.reserve(path, "data", found, bytes)?;
    let at_once = pieces.iter().map(|piece| array.at_once(piece)).max().unwrap_or(0);
    array.reserve::<T>(at_once, access)?;
    let too_many = |error| invalid(path, "data", format!("{count} samples: {error}"), "fewer");
    let mut values = T::Many::default();
    let mut held = Held::default();
    for (at, piece) in pieces.iter().enumerate() {
        let mut read = Vec::new();
        read.try_reserve_exact(piece.count()).map_err(too_many)?;
        read.resize(piece.count(), T::HOLE);
        let of_piece = array.read(piece, &mut read)?;
        held = Held { chunks: held.chunks + of_piece.chunks, bytes: held.bytes + of_piece.bytes };
        match pieces.len() {
            1 => values = read.into(),
            _ => {
                values.append(&read).map_err(too_many)?;
                // The first piece tells how many bits most values need.
                if at == 0 {
                    values.try_reserve_exact(count as usize - read.len()).map_err(too_many)?;
                }
            }
        }
    }
    let reads = StoreCounts {
        level: number as u64,
        chunks_total: pieces.iter().map(|piece| array.count(piece)).sum(),
        chunks_read: held.chunks,
        bytes_read: held.bytes,
        chunk_bytes: bytes,
        ..StoreCounts::default()
    };
    let dims_of_levels = image.levels.iter().map(|level| level.grid.dims).collect();
    let levels = Some(Levels { dims: dims_of_levels, level: number as u32, grid: level.grid, reads });
    Ok(Loaded { levels, ..image.stated(number, values.into()) })
}

/// The grids of an image's levels, from the finest.
pub(super) fn grids(path: &Path, access: &Access) -> Result<Vec<Grid>, VolumeError> {
    Ok(Image::open(path, access)?.levels.iter().map(|level| level.grid).collect())
}

/// The number of the level to read: the selected one, or else the finest. Its values must fit in memory.
fn level_of<T: Voxel>(image: &Image, channels: u64, path: &Path, access: &Access) -> Result<usize, VolumeError> {
    let count = image.levels.len();
    let stated = access.selection().level;
    let number = stated.unwrap_or(0) as usize;
    if number >= count {
        let allowed = if count == 1 { "0, the only one".to_owned() } else { format!("0 to {}", count - 1) };
        return Err(invalid(path, "level", number, allowed));
    }
    let needs = |level: &Level| level.array.memory::<T>(channels);
    let left = access.memory_left();
    let fits = |level: &Level| dims_of(level.grid.dims.to_array()).is_some() && needs(level) <= left;
    if fits(&image.levels[number]) || count == 1 {
        return Ok(number);
    }
    let sizes = image.levels.iter().zip(0..).map(|(level, number)| {
        let [x, y, z] = level.grid.dims.to_array();
        format!("{number}: {x} × {y} × {z}, {} bytes", needs(level))
    });
    let sizes = sizes.collect::<Vec<_>>().join("; ");
    let found = match stated {
        Some(level) => format!("level {level} of the levels {sizes}"),
        None => format!("no level stated, of the levels {sizes}"),
    };
    let allowed = match image.levels.iter().position(fits) {
        Some(level) => format!("within the memory limit of {left} bytes, level {level} or a coarser one"),
        None => format!("a level within the memory limit of {left} bytes, of which there is none"),
    };
    Err(invalid(path, "level", found, allowed))
}

/// Opens the selected channels of an image at one time. `format` is the name of the format.
pub(super) fn open(path: &Path, format: &'static str, access: &Access) -> Result<Vec<Arc<dyn Store>>, VolumeError> {
    let mut image = Image::open(path, access)?;
    let selection = access.selection();
    image.series.check(path, selection)?;
    let share = access.memory_left() / (4 * image.levels.len() as u64).max(1);
    for level in &mut image.levels {
        level.array.keep_within::<f32>(share);
        level.array.reserve::<f32>(level.array.most_at_once(), access)?;
    }
    let image = Arc::new(image);
    let levels = image.levels.iter().map(|level| StoreLevel { grid: level.grid, chunk: level.array.chunk_dims() });
    let levels: Vec<StoreLevel> = levels.collect();
    let stated = image.stated(0, Values::default().into());
    let time = u64::from(selection.time.unwrap_or(0));
    let store = |(at, channel): (usize, u32)| {
        let facts = stated.facts(format, channel as usize, at);
        let (image, levels) = (Arc::clone(&image), levels.clone());
        Arc::new(ZarrStore { image, levels, channel: channel.into(), time, facts }) as Arc<dyn Store>
    };
    Ok(image.series.channels(selection).enumerate().map(store).collect())
}

/// One channel of an image at one time, read by boxes.
#[derive(Debug)]
struct ZarrStore {
    image: Arc<Image>,
    levels: Vec<StoreLevel>,
    channel: u64,
    time: u64,
    facts: StoreFacts,
}

impl Store for ZarrStore {
    fn levels(&self) -> &[StoreLevel] {
        &self.levels
    }

    fn read(&self, level: usize, from: UVec3, dims: UVec3, values: &mut [f32]) -> Result<u64, VolumeError> {
        check_box(&self.image.keys.path, &self.levels, level, (from, dims), values.len())?;
        let region = Region { channels: self.channel..self.channel + 1, time: self.time, from, dims };
        let array = &self.image.levels[level].array;
        let bytes = array.read(&region, values)?.bytes;
        self.image.keys.access.warn_of_box(&self.image.keys.path, array.kind, values);
        Ok(bytes)
    }

    fn contains(&self, level: usize, chunk: UVec3) -> Result<bool, VolumeError> {
        check_chunk(&self.image.keys.path, &self.levels, level, chunk)?;
        self.image.levels[level].array.contains(self.channel, self.time, chunk)
    }

    fn fill(&self) -> f32 {
        self.image.levels[0].array.fill()
    }

    fn decodes_whole_chunks(&self) -> bool {
        true
    }

    fn memory(&self, level: usize) -> u64 {
        let Some(Level { array, .. }) = self.image.levels.get(level) else { return 0 };
        array.memory::<f32>(1).saturating_add(array.chunk_memory::<f32>(array.most_at_once()))
    }

    fn facts(&self) -> StoreFacts {
        self.facts.clone()
    }

    fn identity(&self) -> String {
        let mut hash = blake3::Hasher::new();
        hash.update(b"sheetsplat zarr 1\n");
        for metadata in &self.image.metadata {
            hash.update(metadata.to_string().as_bytes()).update(b"\n");
        }
        hash.update(&self.channel.to_le_bytes()).update(&self.time.to_le_bytes());
        hash.finalize().to_hex().to_string()
    }
}
