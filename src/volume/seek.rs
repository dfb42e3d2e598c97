//! Uncompressed files, read by boxes.

use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use glam::{DVec3, UVec3};

use super::access::Access;
use super::loaded::Loaded;
use super::samples::Samples;
use super::series::{Series, SeriesOrder};
use super::source::{invalid, io_error};
use super::store::{Store, StoreLevel, check_box, check_chunk, facts_of_channel, values_of};
use super::voxel::Voxel;
use super::{Grid, StoreFacts, VolumeError};

/// The sizes of a chunk, unless the volume is smaller: any box can be read, so these only divide it into parts of a convenient size.
const CHUNK: u32 = 64;

/// The number of stretches of a file that its identity covers, and their length in bytes.
const STRETCHES: u64 = 64;
const STRETCH: u64 = 4096;

/// The bytes between a box's rows in a file up to which rows are read together, and the most bytes that are, if they are several.
const GAP: u64 = 4096;
const RUN: u64 = 1 << 20;

/// Where the samples of a file are.
#[derive(Clone, Debug)]
pub(super) struct Located {
    pub(super) path: PathBuf,
    /// The byte of the first sample.
    pub(super) at: u64,
    pub(super) samples: Samples,
    pub(super) series: Series,
}

/// What readers note in place of reading samples.
pub(super) type Notes = Mutex<Vec<Located>>;

/// A file that is read by boxes.
#[derive(Debug)]
pub(super) struct FileStore {
    located: Located,
    access: Access,
    levels: [StoreLevel; 1],
    /// The number of samples from one voxel to the next, and the sample of the first voxel.
    step: u64,
    first: u64,
    facts: StoreFacts,
    identity: String,
}

impl FileStore {
    /// The stores of the selected channels of a file whose header was read, of which `notes` tells where the samples are.
    pub(super) fn of_header(
        path: &Path,
        (format, loaded): (&'static str, &Loaded<f32>),
        notes: &[Located],
        access: &Access,
    ) -> Result<Vec<Arc<dyn Store>>, VolumeError> {
        let [located] = notes else {
            let found = format!("{} places", notes.len());
            return Err(invalid(path, "data", found, "one stretch of uncompressed samples, x fastest"));
        };
        let series = &located.series;
        series.check(path, access.selection())?;
        if series.is_color {
            return Err(invalid(path, "channels", "colours", "channels of values, for what is read by boxes"));
        }
        let store = |(at, channel): (usize, u32)| {
            let facts = facts_of_channel(loaded.facts(format, channel as usize), at);
            let spacing = loaded.spacing.unwrap_or(DVec3::ONE);
            Ok(Arc::new(Self::new(located.clone(), channel, spacing, facts, access)?) as Arc<dyn Store>)
        };
        series.channels(access.selection()).enumerate().map(store).collect()
    }

    /// One channel of a file.
    pub(super) fn new(
        located: Located,
        channel: u32,
        spacing: DVec3,
        facts: StoreFacts,
        access: &Access,
    ) -> Result<Self, VolumeError> {
        let Located { samples, series, .. } = &located;
        let selection = access.selection();
        let (count, time) = (u64::from(samples.count()), u64::from(selection.time.unwrap_or(0)));
        let (step, first) = match series.order {
            SeriesOrder::Interleaved => {
                let channels = u64::from(series.channels);
                (channels, time * channels * count + u64::from(channel))
            }
            _ => (1, series.block(channel, selection) * count),
        };
        let level = StoreLevel { grid: Grid::new(samples.dims, spacing), chunk: samples.dims.min(UVec3::splat(CHUNK)) };
        let mut store = Self {
            access: access.clone(),
            levels: [level],
            step,
            first,
            identity: String::new(),
            facts,
            located: located.clone(),
        };
        store.identity = store.hash()?;
        Ok(store)
    }

    /// A hash of the layout and of stretches all over the samples.
    fn hash(&self) -> Result<String, VolumeError> {
        let Located { path, at, samples, .. } = &self.located;
        let mut hash = blake3::Hasher::new();
        let layout = (samples.kind, samples.dims, samples.big_endian, samples.rescale, self.step, self.first);
        hash.update(format!("sheetsplat file 1\n{layout:?}\n").as_bytes());
        let mut file = self.access.open_to_look(path)?;
        file.reader.seek(SeekFrom::Start(*at)).map_err(io_error(path))?;
        let bytes = file.left()?;
        hash.update(&bytes.to_le_bytes());
        for stretch in 0..STRETCHES.min(bytes.div_ceil(STRETCH)) {
            let from =
                at + (bytes.saturating_sub(STRETCH) as u128 * u128::from(stretch) / u128::from(STRETCHES - 1)) as u64;
            let mut found = Vec::new();
            file.reader.seek(SeekFrom::Start(from)).map_err(io_error(path))?;
            file.reader.by_ref().take(STRETCH).read_to_end(&mut found).map_err(io_error(path))?;
            hash.update(&found);
        }
        Ok(hash.finalize().to_hex().to_string())
    }
}

impl Store for FileStore {
    fn levels(&self) -> &[StoreLevel] {
        &self.levels
    }

    fn read(&self, level: usize, from: UVec3, dims: UVec3, values: &mut [f32]) -> Result<u64, VolumeError> {
        let Located { path, at, samples, .. } = &self.located;
        check_box(path, &self.levels, level, (from, dims), values.len())?;
        // Each run of rows is read at once, so that a buffer would only read more.
        let mut file = self.access.open_to_look(path)?.reader.into_inner();
        let [nx, ny] = [samples.dims.x, samples.dims.y].map(u64::from);
        let bytes = samples.kind.bytes();
        // The samples of the voxels of a row, and of those between them.
        let length = (u64::from(dims.x - 1) * self.step + 1) * bytes;
        let from_row_to_row = nx * self.step * bytes;
        let at_once = match from_row_to_row - length.min(from_row_to_row) {
            ..=GAP => 1 + RUN.saturating_sub(length) / from_row_to_row,
            _ => 1,
        };
        let runs = (0..dims.z).flat_map(|z| (0..dims.y).step_by(at_once as usize).map(move |y| UVec3::new(0, y, z)));
        let mut rows = values.chunks_exact_mut(dims.x as usize);
        let (mut code, mut row_values) = (Vec::new(), Vec::new());
        for first in runs {
            let count = u64::from(dims.y - first.y).min(at_once);
            let [x, y, z] = (from + first).to_array().map(u64::from);
            let sample = self.first + (x + nx * (y + ny * z)) * self.step;
            file.seek(SeekFrom::Start(at + sample * bytes)).map_err(io_error(path))?;
            code.clear();
            let run = (count - 1) * from_row_to_row + length;
            code.reserve(run.min(RUN) as usize);
            file.by_ref().take(run).read_to_end(&mut code).map_err(io_error(path))?;
            for (number, row) in (0..count).zip(&mut rows) {
                let begin = number * from_row_to_row;
                let Some(code) = code.get(begin as usize..(begin + length) as usize) else {
                    let voxel = from + first + UVec3::new(0, number as u32, 0);
                    let found = format!("the end of the file before voxel {voxel}");
                    return Err(invalid(path, "data", found, "the whole file"));
                };
                row_values.clear();
                samples.convert::<f32>(path, code, &mut row_values, 0)?;
                for (value, &found) in row.iter_mut().zip(row_values.iter().step_by(self.step as usize)) {
                    *value = found;
                }
            }
        }
        Ok(u64::from(dims.y) * u64::from(dims.z) * length)
    }

    fn contains(&self, level: usize, chunk: UVec3) -> Result<bool, VolumeError> {
        check_chunk(&self.located.path, &self.levels, level, chunk)?;
        Ok(true)
    }

    /// A hole, though the file holds every chunk.
    fn fill(&self) -> f32 {
        f32::NAN
    }

    fn memory(&self, level: usize) -> u64 {
        let Samples { kind, rescale, .. } = &self.located.samples;
        values_of(&self.levels, level).saturating_mul(f32::bytes(*kind, rescale.is_some()))
    }

    fn facts(&self) -> StoreFacts {
        self.facts.clone()
    }

    fn identity(&self) -> String {
        self.identity.clone()
    }
}
