//! Several volumes of one grid in a file: channels, times, or both (SPEC §10).

#[cfg(any(feature = "dicom", feature = "tiff"))]
use std::collections::TryReserveError;
use std::ops::Range;
use std::path::Path;

use super::VolumeError;
use super::error::volume::invalid;
#[cfg(any(feature = "dicom", feature = "tiff"))]
use super::voxels::Voxels;

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

/// The volumes that are read from a file with several.
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
pub(super) fn apart(numbers: Voxels, count: usize) -> Result<Voxels, TryReserveError> {
    if count == 1 {
        return Ok(numbers);
    }
    let mut sorted = numbers.none_alike();
    let indices = (0..count).flat_map(|first| (first..numbers.count()).step_by(count));
    sorted.append_from(&numbers, indices)?;
    Ok(sorted)
}
