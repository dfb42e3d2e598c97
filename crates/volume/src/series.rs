//! Several volumes of one grid in a file: channels, times, or both (SPEC §10).

#[cfg(any(feature = "dicom", feature = "tiff"))]
use std::collections::TryReserveError;
use std::ops::Range;
use std::path::Path;

use super::VolumeError;
use super::error::volume::invalid;
use super::samples::{Samples, Stream, dims_of};
use super::seek::Located;
use super::voxel::{Many, Voxel};

/// The maximum number of channels in a file.
pub(super) const MAX_CHANNELS: u32 = 64;

/// How many volumes a file holds, and the order of their samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Series {
    pub(super) channels: u32,
    pub(super) times: u32,
    pub(super) order: SeriesOrder,
    /// Whether the channels are red, green, blue and perhaps A of one channel.
    pub(super) is_color: bool,
}

/// The order of a file's samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SeriesOrder {
    /// The channels of a voxel lie side by side.
    Interleaved,
    /// All times of a voxel lie side by side in each of its channels, and these side by side.
    #[cfg(feature = "npy")]
    TimesInChannels,
    /// Whole volumes, of which all channels of a time lie together.
    ChannelsFirst,
    /// Whole volumes, of which all times of a channel lie together.
    #[cfg(feature = "nifti")]
    TimesFirst,
}

/// What is read of a file with several volumes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Selection {
    /// The number of the only channel; `None` for all.
    pub channel: Option<u32>,
    /// The number of the time; `None` for the first.
    pub time: Option<u32>,
    /// The number of the level; `None` for the finest, which must fit in memory.
    pub level: Option<u32>,
}

impl Default for Series {
    fn default() -> Self {
        Self { channels: 1, times: 1, order: SeriesOrder::ChannelsFirst, is_color: false }
    }
}

impl Series {
    /// Colours of three or four numbers that lie side by side.
    #[cfg(any(feature = "dicom", feature = "nifti", feature = "npy", feature = "tiff"))]
    pub(super) fn of_colors(components: u32, times: u32) -> Self {
        Self { channels: components, times, order: SeriesOrder::Interleaved, is_color: true }
    }

    /// Checks that the file holds what is to be read.
    ///
    /// # Errors
    /// If it does not.
    pub(super) fn check(&self, path: &Path, selection: Selection) -> Result<(), VolumeError> {
        let channels = if self.is_color { 1 } else { self.channels };
        let wanted = [("channel", selection.channel, channels), ("time", selection.time, self.times)];
        for (field, number, count) in wanted {
            if let Some(number) = number.filter(|&number| number >= count) {
                let allowed = if count == 1 { "0, the only one".to_owned() } else { format!("0 to {}", count - 1) };
                return Err(invalid(path, field, number, allowed));
            }
        }
        if self.times > 1 && selection.time.is_none() {
            log::warn!("{}: {} times: the first is read", path.display(), self.times);
        }
        Ok(())
    }

    /// The channels that are read; all numbers of a colour.
    pub(super) fn channels(&self, selection: Selection) -> Range<u32> {
        let chosen = selection.channel.filter(|_| !self.is_color);
        chosen.map_or(0..self.channels, |channel| channel..channel + 1)
    }

    /// The position among the file's volumes of a channel at the time that is read. It ascends with the channel.
    pub(super) fn block(&self, channel: u32, selection: Selection) -> u64 {
        let time = u64::from(selection.time.unwrap_or(0));
        match self.order {
            #[cfg(feature = "nifti")]
            SeriesOrder::TimesFirst => u64::from(channel) * u64::from(self.times) + time,
            _ => time * u64::from(self.channels) + u64::from(channel),
        }
    }

    /// The number of volumes in the file.
    pub(super) fn count(&self) -> u64 {
        u64::from(self.channels) * u64::from(self.times)
    }
}

/// Numbers of which those of a voxel lie side by side, sorted by what they are of.
///
/// # Errors
/// If there is no memory for a copy of them.
#[cfg(any(feature = "dicom", feature = "tiff"))]
pub(super) fn apart<T: Voxel>(numbers: T::Many, count: usize) -> Result<T::Many, TryReserveError> {
    if count == 1 {
        return Ok(numbers);
    }
    let mut sorted = T::Many::default();
    let indices = (0..count).flat_map(|first| (first..numbers.count()).step_by(count));
    sorted.append_from(&numbers, indices)?;
    Ok(sorted)
}

impl Stream {
    /// The samples of the selected volumes of a series, channel by channel; `samples` are those of one volume. The stream must end after them as in
    /// [`Self::samples`].
    pub(super) fn series<T: Voxel>(
        mut self,
        samples: &Samples,
        series: &Series,
        window: bool,
    ) -> Result<T::Many, VolumeError> {
        let selection = self.access.selection();
        series.check(&self.path, selection)?;
        if self.access.is_noting() {
            let located = self.locate(samples, series)?;
            self.access.note(located);
            return Ok(T::Many::default());
        }
        let channels = series.channels(selection);
        if series.count() == 1 {
            return self.samples::<T>(samples, window);
        }
        let total = samples.bytes().saturating_mul(series.count());
        let is_wrong = |left: u64| left < total || left > total && !window;
        if let Some(left) = self.exactly_left().filter(|&left| is_wrong(left)) {
            let allowed = format!("{total} bytes ({} volumes of {} samples)", series.count(), samples.count());
            return Err(invalid(&self.path, "data", format!("{left} bytes"), allowed));
        }
        let time = selection.time.unwrap_or(0);
        match series.order {
            SeriesOrder::Interleaved => {
                self.skip(u64::from(time) * u64::from(series.channels) * samples.bytes())?;
                let numbers = channels.map(u64::from);
                return self.interleaved::<T>(samples, (series.channels.into(), numbers), window || series.times > 1);
            }
            #[cfg(feature = "npy")]
            SeriesOrder::TimesInChannels => {
                let numbers = channels.map(|channel| u64::from(channel) * u64::from(series.times) + u64::from(time));
                return self.interleaved::<T>(samples, (series.count(), numbers), window);
            }
            _ => {}
        }
        let (mut values, mut at) = (T::Many::default(), 0);
        for channel in channels {
            let block = series.block(channel, selection);
            self.skip((block - at) * samples.bytes())?;
            samples.reserve::<T>(&self.path, &self.access)?;
            let of_channel = self.read_samples::<T>(samples)?;
            if values.count() == 0 {
                values = of_channel;
            } else {
                let appended = values.append_from(&of_channel, 0..of_channel.count());
                appended.map_err(samples.too_many(&self.path))?;
            }
            at = block + 1;
        }
        Ok(values)
    }

    /// Where the samples are in an uncompressed file, which must hold them all.
    fn locate(&mut self, samples: &Samples, series: &Series) -> Result<Located, VolumeError> {
        let total = samples.bytes().saturating_mul(series.count());
        let allowed = format!("at least {total} bytes, uncompressed, x fastest");
        let at =
            self.position()?.filter(|_| !samples.z_fastest && self.exactly_left().is_some_and(|left| left >= total));
        let at = at.ok_or_else(|| {
            let found = self.exactly_left().map_or("a compressed stream".to_owned(), |left| format!("{left} bytes"));
            let found = if samples.z_fastest { "z fastest".to_owned() } else { found };
            invalid(&self.path, "data", found, allowed)
        })?;
        Ok(Located { path: self.path.clone(), at, samples: *samples, series: *series })
    }

    /// The samples with some numbers, of `count` that each voxel has side by side.
    fn interleaved<T: Voxel>(
        self,
        samples: &Samples,
        (count, numbers): (u64, impl Iterator<Item = u64>),
        window: bool,
    ) -> Result<T::Many, VolumeError> {
        let [x, y, z] = samples.dims.to_array().map(u64::from);
        // They count as voxels along the axis that changes first.
        let sides = if samples.z_fastest { [x, y, z.saturating_mul(count)] } else { [x.saturating_mul(count), y, z] };
        let Some(dims) = dims_of(sides) else {
            let found = format!("{count} channels of {} voxels", samples.count());
            return Err(invalid(&self.path, "sizes", found, "at most 4294967295 samples"));
        };
        let (path, access) = (self.path.clone(), self.access.clone());
        let all = self.samples::<T>(&Samples { dims, ..*samples }, window)?;
        // Those of a voxel lie together, or where z changes first, those of a slice.
        let together = if samples.z_fastest { (x * y) as usize } else { 1 };
        let (count, mut values) = (count as usize, T::Many::default());
        for number in numbers {
            samples.reserve::<T>(&path, &access)?;
            let runs = (number as usize * together..all.count()).step_by(count * together);
            let appended = values.append_from(&all, runs.flat_map(|first| first..first + together));
            appended.map_err(samples.too_many(&path))?;
        }
        Ok(values)
    }
}
