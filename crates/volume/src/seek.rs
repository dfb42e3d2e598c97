//! Uncompressed files, read by boxes.

use std::io::{Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use glam::{DVec3, UVec3};

use super::access::Access;
use super::error::volume::{invalid, io_error};
use super::loaded::Loaded;
use super::located::Located;
use super::samples::Samples;
use super::series::SeriesOrder;
use super::store::{Store, StoreLevel, check_box, check_chunk, values_of};
use super::texel::{COLOR_BYTES, luminance, texel};
use super::voxels::Wanted;
use super::{Grid, StoreFacts, Texel, VolumeError};

/// The sizes of a chunk, unless the volume is smaller: any box can be read, so these only divide it into parts of a convenient size. Colours are larger than
/// values.
const CHUNK: u32 = 64;
const COLOR_CHUNK: u32 = 32;

/// The number of stretches of a file that its identity covers, and their length in bytes.
const STRETCHES: u64 = 64;
const STRETCH: u64 = 4096;

/// The bytes between a box's rows in a file up to which rows are read together, and the most bytes that are, if they are several.
const GAP: u64 = 4096;
const RUN: u64 = 1 << 20;

/// A file that is read by boxes.
#[derive(Debug)]
pub(super) struct FileStore {
    located: Located,
    access: Access,
    levels: [StoreLevel; 1],
    /// The number of samples from one voxel to the next, and the samples of the first voxel: its value, or the components of its colour.
    step: u64,
    firsts: Vec<u64>,
    facts: StoreFacts,
    identity: String,
}

impl FileStore {
    /// The stores of the selected channels of a file whose header was read, of which `notes` tells where the samples are.
    pub(super) fn of_header(
        path: &Path,
        (format, loaded): (&'static str, &Loaded),
        notes: &[Located],
        access: &Access,
    ) -> Result<Vec<Arc<dyn Store>>, VolumeError> {
        let [located] = notes else {
            let found = format!("{} places", notes.len());
            return Err(invalid(path, "data", found, "one stretch of uncompressed samples, x fastest"));
        };
        let series = &located.series;
        series.check(path, access.selection())?;
        let channels = series.channels(access.selection());
        let of_stores = if series.is_color { vec![channels] } else { channels.map(|of| of..of + 1).collect() };
        let store = |(at, components): (usize, Range<u32>)| {
            let facts = loaded.facts(format, components.start as usize, at);
            // Colours are their own palette.
            let of_color = StoreFacts { palette: None, channel_name: None, display: None, ..facts.clone() };
            let facts = if series.is_color { of_color } else { facts };
            let spacing = loaded.spacing.unwrap_or(DVec3::ONE);
            Ok(Arc::new(Self::new(located.clone(), components, spacing, facts, access)?) as Arc<dyn Store>)
        };
        of_stores.into_iter().enumerate().map(store).collect()
    }

    /// One channel of a file, given by the numbers of its components, which are several if it is of colours.
    pub(super) fn new(
        located: Located,
        components: Range<u32>,
        spacing: DVec3,
        facts: StoreFacts,
        access: &Access,
    ) -> Result<Self, VolumeError> {
        let Located { samples, series, .. } = &located;
        let selection = access.selection();
        let (count, time) = (u64::from(samples.count()), u64::from(selection.time.unwrap_or(0)));
        let channels = u64::from(series.channels);
        let (step, firsts): (u64, Vec<u64>) = match series.order {
            SeriesOrder::Interleaved => {
                (channels, components.map(|channel| time * channels * count + u64::from(channel)).collect())
            }
            _ => (1, components.map(|channel| series.block(channel, selection) * count).collect()),
        };
        let side = if firsts.len() > 1 { COLOR_CHUNK } else { CHUNK };
        let level = StoreLevel { grid: Grid::new(samples.dims, spacing), chunk: samples.dims.min(UVec3::splat(side)) };
        let mut store = Self {
            access: access.clone(),
            levels: [level],
            step,
            firsts,
            identity: String::new(),
            facts,
            located: located.clone(),
        };
        store.identity = store.hash()?;
        Ok(store)
    }

    /// Reads rows of a box: `row` is told the index of a row's first voxel in the box, and its samples, from the first of the first voxel to the last of `width`
    /// samples of the last voxel, given the first sample of the volume's first voxel. Returns the number of bytes.
    fn read_rows(
        &self,
        (from, dims): (UVec3, UVec3),
        (first, width): (u64, u64),
        mut row: impl FnMut(usize, &[f32]),
    ) -> Result<u64, VolumeError> {
        let Located { path, at, samples, .. } = &self.located;
        // Each run of rows is read at once, so that a buffer would only read more.
        let mut file = self.access.open_to_look(path)?.reader.into_inner();
        let [nx, ny] = [samples.dims.x, samples.dims.y].map(u64::from);
        let bytes = samples.kind.bytes();
        // The samples of the voxels of a row, and of those between them.
        let length = (u64::from(dims.x - 1) * self.step + width) * bytes;
        let from_row_to_row = nx * self.step * bytes;
        let at_once = match from_row_to_row - length.min(from_row_to_row) {
            ..=GAP => 1 + RUN.saturating_sub(length) / from_row_to_row,
            _ => 1,
        };
        let runs = (0..dims.z).flat_map(|z| (0..dims.y).step_by(at_once as usize).map(move |y| UVec3::new(0, y, z)));
        let mut firsts = (0..).step_by(dims.x as usize);
        let (mut code, mut row_samples) = (Vec::new(), Vec::new());
        for corner in runs {
            let count = u64::from(dims.y - corner.y).min(at_once);
            let [x, y, z] = (from + corner).to_array().map(u64::from);
            let sample = first + (x + nx * (y + ny * z)) * self.step;
            file.seek(SeekFrom::Start(at + sample * bytes)).map_err(io_error(path))?;
            code.clear();
            let run = (count - 1) * from_row_to_row + length;
            code.reserve(run.min(RUN) as usize);
            file.by_ref().take(run).read_to_end(&mut code).map_err(io_error(path))?;
            for (number, first) in (0..count).zip(&mut firsts) {
                let begin = number * from_row_to_row;
                let Some(code) = code.get(begin as usize..(begin + length) as usize) else {
                    let voxel = from + corner + UVec3::new(0, number as u32, 0);
                    let found = format!("the end of the file before voxel {voxel}");
                    return Err(invalid(path, "data", found, "the whole file"));
                };
                row_samples.clear();
                self.access.note_rounding(samples.convert::<f32>(path, code, &mut row_samples, 0)?);
                row(first, &row_samples);
            }
        }
        Ok(u64::from(dims.y) * u64::from(dims.z) * length)
    }

    /// A hash of the layout and of stretches all over the samples.
    fn hash(&self) -> Result<String, VolumeError> {
        let Located { path, at, samples, .. } = &self.located;
        let mut hash = blake3::Hasher::new();
        let layout = (samples.kind, samples.dims, samples.big_endian, samples.rescale, self.step, self.firsts[0]);
        hash.update(format!("sheetsplat file 1\n{layout:?}\n").as_bytes());
        if self.has_colors() {
            hash.update(format!("colors {:?}\n", self.firsts).as_bytes());
        }
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
        if self.has_colors() {
            return self.read_colors(level, from, dims, values, &mut vec![Texel::default(); values.len()]);
        }
        check_box(&self.located.path, &self.levels, level, (from, dims), values.len())?;
        let bytes = self.read_rows((from, dims), (self.firsts[0], 1), |first, samples| {
            let row = &mut values[first..first + dims.x as usize];
            match self.step {
                1 => row.copy_from_slice(samples),
                step => row.iter_mut().zip(samples.iter().step_by(step as usize)).for_each(|(to, &from)| *to = from),
            }
        })?;
        self.access.warn_of_box(&self.located.path, self.located.samples.kind, values);
        Ok(bytes)
    }

    fn has_colors(&self) -> bool {
        self.firsts.len() > 1
    }

    fn read_colors(
        &self,
        level: usize,
        from: UVec3,
        dims: UVec3,
        values: &mut [f32],
        colors: &mut [Texel],
    ) -> Result<u64, VolumeError> {
        check_box(&self.located.path, &self.levels, level, (from, dims), values.len())?;
        check_box(&self.located.path, &self.levels, level, (from, dims), colors.len())?;
        let kind = self.located.samples.kind;
        let mut numbers = vec![[kind.full() as f32; 4]; values.len()];
        // Components that lie side by side are read together.
        let together = if self.step == 1 { 1 } else { self.firsts.len() };
        let mut bytes = 0;
        for (first_component, firsts) in (0..).step_by(together).zip(self.firsts.chunks(together)) {
            bytes += self.read_rows((from, dims), (firsts[0], together as u64), |first, samples| {
                let row = &mut numbers[first..first + dims.x as usize];
                for (numbers, samples) in row.iter_mut().zip(samples.chunks(self.step as usize)) {
                    numbers[first_component..first_component + together].copy_from_slice(&samples[..together]);
                }
            })?;
        }
        for ((value, color), numbers) in values.iter_mut().zip(colors).zip(&numbers) {
            (*value, *color) = (luminance(*numbers), texel(*numbers, kind));
        }
        Ok(bytes)
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
        let own = Wanted::Values.bytes(*kind, rescale.is_some());
        let of_color = self.firsts.len() as u64 * own + COLOR_BYTES;
        values_of(&self.levels, level).saturating_mul(if self.has_colors() { of_color } else { own })
    }

    fn facts(&self) -> StoreFacts {
        self.facts.clone()
    }

    fn identity(&self) -> String {
        self.identity.clone()
    }
}
