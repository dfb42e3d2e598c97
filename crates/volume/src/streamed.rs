//! Volumes that are read while they are drawn.

use std::sync::Arc;

use glam::{DVec3, UVec3};

use super::adapted::{AdaptedStore, Tally};
use super::channels::Channels;
use super::labels::labels_of;
use super::resample::{Oriented, is_same_grid};
use super::sample::{Chunks, parts_of, sample_at, some, spread};
use super::turned::with_turned;
use super::{ChunkProgress, Grid, IndexedStore, Labels, Store, StoreIndex, Volume, VolumeError};
use crate::StoreCounts;

/// A volume that is drawn without being in memory as a whole (SPEC §13): one channel or several on one grid, each with labels or without.
#[derive(Clone, Debug)]
pub struct StreamedVolume {
    /// The channels (SPEC §10), all on the first one's grid.
    pub channels: Channels<StreamedChannel>,
    /// Values by which everything is chosen that scenes leave open, such as the transfer function and the camera's frame: a coarser level, or a subset of the
    /// voxels, with the same box, and with all channels and labels.
    pub sample: Arc<Volume>,
    /// The bytes that chunks may hold together; beyond them those are dropped, and read again, that no tile is drawn from.
    pub memory: u64,
}

/// A level of a volume, or every nth voxel of one along each axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thinned {
    /// The number of the level in the first channel's store.
    pub level: usize,
    /// n.
    pub stride: u32,
    /// The voxels along each axis that are left.
    pub dims: UVec3,
    /// Their distances, in world units.
    pub spacing: DVec3,
}

/// A channel of a [`StreamedVolume`].
#[derive(Clone, Debug)]
pub struct StreamedChannel {
    /// The values.
    pub values: StreamedLevel,
    /// A label for every voxel, a whole number from 0 to 65535; `None` if the channel is not segmented.
    pub labels: Option<StreamedLevel>,
}

/// A level of a store that is read while it is drawn.
#[derive(Clone, Debug)]
pub struct StreamedLevel {
    /// The name in errors: a file.
    pub origin: String,
    /// The store.
    pub store: Arc<dyn Store>,
    /// The number of the level, from 0 for the finest.
    pub level: usize,
}

impl StreamedLevel {
    /// A level of a store. `origin` names the store in errors.
    pub fn new(origin: impl Into<String>, store: Arc<dyn Store>, level: usize) -> Self {
        Self { origin: origin.into(), store, level }
    }

    /// The grid of the level, which the store must have.
    pub(crate) fn grid(&self) -> &Grid {
        &self.store.levels()[self.level].grid
    }

    /// The minimum and maximum of the values, if the store knows them.
    #[doc(hidden)]
    pub fn range(&self) -> Option<[f32; 2]> {
        self.store.range(self.level)
    }

    /// Checks that the store has the level.
    fn check(&self) -> Result<(), VolumeError> {
        let levels = self.store.levels().len();
        if self.level < levels {
            return Ok(());
        }
        Err(VolumeError::invalid(&self.origin, "level", self.level.to_string(), format!("0 to {}", levels - 1)))
    }

    /// The level with its first axis turned as another one's, unless both state how they lie in the patient.
    fn in_order_of(self, other: &Self) -> Self {
        if self.store.facts().orientation.is_some() && other.store.facts().orientation.is_some() {
            return self;
        }
        Self { store: with_turned(self.store, other.grid().is_turned()), ..self }
    }

    /// The number of the level whose voxels lie on those of a grid, which counts as lying where the finest level does.
    fn level_on(&self, grid: &Grid) -> Option<usize> {
        self.store.levels().iter().position(|level| is_same_grid((&level.grid, None), (grid, None)))
    }
}

impl From<StreamedLevel> for StreamedChannel {
    /// A channel without labels.
    fn from(values: StreamedLevel) -> Self {
        Self { values, labels: None }
    }
}

impl StreamedChannel {
    /// The channel with labels in place of any others. Labels of a store that states no spacing have that of the values. If one of the two does not state how it
    /// lies in the patient, the labels count as in the order of the values' file.
    ///
    /// # Errors
    /// If the values' spacing is not one that a store can have.
    pub fn with_labels(self, labels: StreamedLevel) -> Result<Self, VolumeError> {
        let labels = labels.in_order_of(&self.values);
        let finest = |of: &StreamedLevel| of.store.levels()[0].grid.spacing;
        let (spacing, is_stated) = (finest(&self.values), labels.store.facts().spacing.is_some());
        let labels = match is_stated || finest(&labels) == spacing {
            true => labels,
            false => {
                let store = AdaptedStore::spaced(&labels.origin, labels.store, spacing)?;
                StreamedLevel { store: Arc::new(store), ..labels }
            }
        };
        Ok(Self { labels: Some(labels), ..self })
    }

    /// All that is read: the values and the labels.
    pub(crate) fn levels(&self) -> impl Iterator<Item = &StreamedLevel> {
        std::iter::once(&self.values).chain(&self.labels)
    }

    /// As [`Self::levels`].
    fn levels_mut(&mut self) -> impl Iterator<Item = &mut StreamedLevel> {
        std::iter::once(&mut self.values).chain(&mut self.labels)
    }
}

impl StreamedVolume {
    /// Reads the sample of a level of one store that is to be drawn with some bytes of memory: an eighth of them for the sample, half of them for chunks.
    /// `origin` names the store in errors.
    ///
    /// # Errors
    /// If the store has no such level, cannot be read, or holds no finite value in the sample.
    pub fn new(origin: &str, store: Arc<dyn Store>, level: usize, memory: u64) -> Result<Self, VolumeError> {
        Self::of_channels(StreamedChannel::from(StreamedLevel::new(origin, store, level)), memory)
    }

    /// As [`Self::new`], of several channels and labels, which all lie on the grid of the first channel's level. The memory is for all of them together.
    ///
    /// # Errors
    /// As for [`Self::new`], if a level lies on another grid, or if a value of labels in the sample is no label.
    pub fn of_channels(channels: impl Into<Channels<StreamedChannel>>, memory: u64) -> Result<Self, VolumeError> {
        let channels = channels.into();
        let sample = sample_of_channels(&channels, memory / 8)?.sampling(*channels.first().values.grid());
        Ok(Self { channels, sample: Arc::new(sample), memory: memory / 2 })
    }

    /// The same volume, none of whose chunks is read that an index tells to show nothing: chunks of the channel whose store the index is of. `origin` names the
    /// index in errors.
    ///
    /// # Errors
    /// If the index is of none of the channels' stores.
    pub fn with_index(mut self, index: StoreIndex, origin: &str) -> Result<Self, VolumeError> {
        Self::index(&mut self.channels, index, origin)?;
        Ok(self)
    }

    /// As [`Self::with_index`], before the sample is read.
    #[doc(hidden)]
    pub fn index(channels: &mut Channels<StreamedChannel>, index: StoreIndex, origin: &str) -> Result<(), VolumeError> {
        // An index of none is refused by the first one.
        let number = channels.iter().position(|channel| index.is_of(&*channel.values.store)).unwrap_or(0);
        let StreamedChannel { values, .. } = &mut channels[number];
        values.store = Arc::new(IndexedStore::new(Arc::clone(&values.store), index, origin)?);
        Ok(())
    }

    /// The same volume, with a function that is told of every chunk of all channels and labels when it is read for the first time. Several threads may call it at
    /// once.
    pub fn watched_by(mut self, progress: Arc<ChunkProgress>) -> Self {
        let tally = Arc::new(Tally::new(self.chunks(), progress));
        for of in self.channels.iter_mut().flat_map(StreamedChannel::levels_mut) {
            of.store = Arc::new(AdaptedStore::watched(Arc::clone(&of.store), of.level, &tally));
        }
        self
    }

    /// A channel by itself, given by its number.
    ///
    /// # Panics
    /// If there is no such channel.
    #[doc(hidden)]
    pub fn of_channel(&self, number: usize) -> Self {
        let sample = self.sample.channel(number).unwrap_or(&self.sample).alone().sampling(*self.grid());
        Self { channels: self.channels[number].clone().into(), sample: Arc::new(sample), memory: self.memory }
    }

    /// The values of the only channel, if there are no others, no labels and no colours.
    #[doc(hidden)]
    pub fn only_values(&self) -> Option<&StreamedLevel> {
        let [StreamedChannel { values, labels: None }] = &*self.channels else { return None };
        (!values.store.has_colors()).then_some(values)
    }

    /// The number of chunks of all channels and labels.
    #[doc(hidden)]
    pub fn chunks(&self) -> u64 {
        let chunks = |of: &StreamedLevel| of.store.levels()[of.level].chunks().as_u64vec3().element_product();
        self.channels.iter().flat_map(StreamedChannel::levels).map(chunks).sum()
    }

    /// The counts of a frame with those of reading the sample.
    #[doc(hidden)]
    pub fn with_sample(&self, counts: StoreCounts) -> StoreCounts {
        let of_sample = self.sample.reads().unwrap_or_default();
        StoreCounts { sample_chunks_read: of_sample.chunks_read, sample_bytes_read: of_sample.bytes_read, ..counts }
    }

    /// The finest level of at most `most` voxels that all channels and labels have; without one, every nth voxel of the coarsest, n the least power of 2 that
    /// leaves no more.
    #[doc(hidden)]
    pub fn thinned(&self, most: u64) -> Thinned {
        let common = common_levels(&self.channels);
        let voxels = |grid: &Grid, stride: u32| grid.resized(grid.dims.map(|count| count.div_ceil(stride))).voxels();
        // The level that is drawn is among them.
        let chosen = common.iter().find(|(_, grid)| voxels(grid, 1) <= most).or(common.last());
        let &(level, grid) = chosen.unwrap_or(&(self.level(), *self.grid()));
        let stride = (0..u32::BITS).map(|power| 1 << power).find(|&stride| voxels(&grid, stride) <= most).unwrap_or(1);
        let dims = grid.dims.map(|count| count.div_ceil(stride));
        Thinned { level, stride, dims, spacing: grid.spacing * f64::from(stride) }
    }

    /// Reads all voxels of [`Self::thinned`], of all channels with their labels. All may be holes.
    ///
    /// # Errors
    /// If a store cannot be read, or a value of labels is no label.
    #[doc(hidden)]
    pub fn read_thinned(&self, Thinned { level, stride, .. }: Thinned) -> Result<Volume, VolumeError> {
        let grid = self.channels.first().values.store.levels()[level].grid;
        read_every(&self.channels, (&grid, stride), Chunks::All)
    }

    /// The number of the first channel's level that is drawn.
    #[doc(hidden)]
    pub fn level(&self) -> usize {
        self.channels.first().values.level
    }

    /// The grid of the level that is drawn.
    #[doc(hidden)]
    pub fn grid(&self) -> &Grid {
        self.channels.first().values.grid()
    }
}

/// Checks that the levels of channels and labels exist and lie on the grid of the first channel's.
///
/// # Errors
/// If one does not.
pub fn check_grids(channels: &Channels<StreamedChannel>) -> Result<(), VolumeError> {
    fn oriented<'a>(of: &'a StreamedLevel, facts: &'a super::StoreFacts) -> Oriented<'a> {
        (of.grid(), facts.orientation.as_ref())
    }
    let first = channels.first();
    first.values.check()?;
    let facts = first.values.store.facts();
    for (number, channel) in channels.iter().enumerate() {
        channel.values.check()?;
        let own = channel.values.store.facts();
        if !is_same_grid(oriented(&first.values, &facts), oriented(&channel.values, &own)) {
            return Err(other_grid(&channel.values, &format!("channel[{number}].volume"), "channel[0]", first));
        }
        let Some(labels) = &channel.labels else { continue };
        labels.check()?;
        let of_labels = labels.store.facts();
        if !is_same_grid(oriented(&channel.values, &own), oriented(labels, &of_labels)) {
            return Err(other_grid(labels, "labels", "the values", channel));
        }
    }
    Ok(())
}

/// The error for a level on another grid than that of a channel.
fn other_grid(found: &StreamedLevel, key: &str, name: &str, of: &StreamedChannel) -> VolumeError {
    let shown = |Grid { dims, spacing, .. }: &Grid| format!("{dims} voxels of {spacing}");
    let allowed = format!(
        "the grid of {name}, {}, in one place, for a volume that is streamed, or more memory",
        shown(of.values.grid())
    );
    VolumeError::invalid(&found.origin, key, format!("a grid of {}", shown(found.grid())), allowed)
}

/// A sample of all channels and labels ([`sample`](super::sample())), which takes at most some bytes, of a level that all of them have.
///
/// # Errors
/// If a level lies on another grid than the first channel's, a store cannot be read or holds no finite value in the sample, or a value of labels is no label.
pub fn sample_of_channels(channels: &Channels<StreamedChannel>, memory: u64) -> Result<Volume, VolumeError> {
    check_grids(channels)?;
    let common = common_levels(channels);
    let parts: u64 = channels.iter().flat_map(StreamedChannel::levels).map(|of| parts_of(&*of.store)).sum();
    let grids: Vec<Grid> = common.iter().map(|&(_, grid)| grid).collect();
    let (number, step) = spread(&grids, memory / parts);
    read_every(channels, (&common[number].1, step), Chunks::Few)
}

/// The levels that all channels and labels have, from the finest: their numbers in the first channel's store, and their grids. The levels that are drawn are
/// among them.
fn common_levels(channels: &Channels<StreamedChannel>) -> Vec<(usize, Grid)> {
    let is_on_all =
        |grid: &Grid| channels.iter().flat_map(StreamedChannel::levels).all(|of| of.level_on(grid).is_some());
    let levels = channels.first().values.store.levels().iter().map(|level| level.grid).enumerate();
    levels.filter(|(_, grid)| is_on_all(grid)).collect()
}

/// Every nth voxel of a level along each axis, given by its grid, of all channels and labels.
///
/// # Errors
/// If a store cannot be read, or holds no finite value in chunks that stand for others, or a value of labels is no label.
fn read_every(
    channels: &Channels<StreamedChannel>,
    (grid, step): (&Grid, u32),
    chunks: Chunks,
) -> Result<Volume, VolumeError> {
    let mut reads = StoreCounts::default();
    let mut read = |of: &StreamedLevel| -> Result<Volume, VolumeError> {
        let level = of.level_on(grid).unwrap_or(of.level);
        let sample = sample_at(&of.origin, &*of.store, (level, step), chunks)?;
        let sample = if chunks == Chunks::Few { some(&of.origin, sample)? } else { sample };
        let own = sample.reads().unwrap_or_default();
        reads = StoreCounts {
            chunks_total: reads.chunks_total + own.chunks_total,
            chunks_read: reads.chunks_read + own.chunks_read,
            bytes_read: reads.bytes_read + own.bytes_read,
            ..own
        };
        Ok(sample)
    };
    let sample = |channel: StreamedChannel| {
        let values = read(&channel.values)?;
        let Some(labels) = &channel.labels else { return Ok(values) };
        let own = read(labels)?;
        values.with_labels_in_order(Labels {
            origin: labels.origin.clone(),
            dims: own.dims(),
            spacing: None,
            values: labels_of(&labels.origin, (grid, UVec3::ZERO, own.dims(), step), own.values().iter())?,
            names: labels.store.facts().label_names,
        })
    };
    let samples = channels.clone().try_map(sample)?;
    Ok(Volume { reads: Some(reads), ..Volume::of_channels(&channels.first().values.origin, samples)? })
}

impl Volume {
    /// The volume as a sample of the voxels of a grid.
    fn sampling(self, grid: Grid) -> Self {
        Self { sampled: Some(grid), ..self }
    }
}
