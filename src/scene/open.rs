//! Opening a scene's volume: in memory, or where it fits into none, to be read while it is drawn.

use std::sync::Arc;

use glam::UVec3;

use super::{Scene, load};
use crate::error::setting::SettingError;
use crate::settings::keys::{METHODS, name_of};
use crate::settings::splatting::{Classification, Interpolation, Method, Splatting};
use crate::volume::{
    Access, COLOR_BYTES, Grid, ReadOptions, StoreIndex, StreamedLevel, StreamedVolume, Volume, VolumeError,
};

/// The chunks that a thread that draws has in memory: its own, two that are read ahead, and one whose voxels are sorted.
pub(crate) const CHUNKS_OF_THREAD: u64 = 4;

/// A volume that can be drawn.
#[derive(Clone, Debug)]
pub enum OpenVolume {
    /// It is in memory.
    Whole(Arc<Volume>),
    /// It is read while it is drawn.
    Streamed(StreamedVolume),
}

impl OpenVolume {
    /// The volume by which everything is chosen that scenes leave open: itself, or the sample of one that is streamed.
    pub fn sample(&self) -> &Arc<Volume> {
        match self {
            Self::Whole(volume) => volume,
            Self::Streamed(StreamedVolume { sample, .. }) => sample,
        }
    }

    /// The number of the level that is drawn, 0 for the finest.
    pub fn level(&self) -> u32 {
        match self {
            Self::Whole(volume) => volume.level(),
            Self::Streamed(volume) => volume.level() as u32,
        }
    }

    /// One of its channels by itself, given by its number; the volume must have it.
    pub(crate) fn of_channel(&self, number: usize) -> Self {
        match self {
            Self::Whole(volume) => volume.channel(number).unwrap_or(volume).alone().into(),
            Self::Streamed(volume) => Self::Streamed(volume.of_channel(number)),
        }
    }

    /// The grid of the voxels that are drawn.
    pub fn grid(&self) -> &Grid {
        match self {
            Self::Whole(volume) => volume.grid(),
            Self::Streamed(volume) => volume.grid(),
        }
    }
}

impl From<Arc<Volume>> for OpenVolume {
    fn from(volume: Arc<Volume>) -> Self {
        Self::Whole(volume)
    }
}

impl From<Volume> for OpenVolume {
    fn from(volume: Volume) -> Self {
        Self::Whole(volume.into())
    }
}

impl From<StreamedVolume> for OpenVolume {
    fn from(volume: StreamedVolume) -> Self {
        Self::Streamed(volume)
    }
}

impl Scene {
    /// Opens the volume: as [`Self::load_volume`] does, or if it does not fit into memory and can be read by boxes, to be streamed (SPEC §13).
    ///
    /// # Errors
    /// As for [`Self::load_volume`].
    pub fn open_volume(&self) -> Result<OpenVolume, VolumeError> {
        self.open_volume_with(&ReadOptions::default())
    }

    /// Like [`Self::open_volume`], with the options of [`Self::load_volume_with`].
    ///
    /// # Errors
    /// As for [`Self::load_volume_with`].
    pub fn open_volume_with(&self, options: &ReadOptions) -> Result<OpenVolume, VolumeError> {
        let scene = self.choose_levels(options, Self::explicit)?;
        let access = Access::new(options)?;
        if let Some(volume) = streamed(&scene, options, &access)? {
            return Ok(volume.into());
        }
        // What the store reserved is free again.
        let access = Access::new(options)?;
        Ok(load::channels(&scene, &access)?.into())
    }

    /// Checks that the scene can show a volume that is read while it is drawn: with image-aligned sheets, and interpolated as they are. The sample must have
    /// the volume's channels, labels and colours.
    pub(crate) fn check_streamed(&self, volume: &StreamedVolume) -> Result<(), SettingError> {
        let refused = |key: &str, found: &str, allowed: &str| {
            let found = format!("{found} for a volume that is streamed");
            Err(SettingError::new(key, found, format!("{allowed}, or more memory")))
        };
        let sample = &volume.sample;
        // Whether each channel has labels, and whether it has colours.
        let of_stores: Vec<[bool; 2]> =
            volume.channels.iter().map(|of| [of.labels.is_some(), of.values.store.has_colors()]).collect();
        let of_sample: Vec<[bool; 2]> =
            sample.channels().map(|of| [of.labels().is_some(), of.colors().is_some()]).collect();
        if of_stores != of_sample {
            let [found, allowed] = [of_sample, of_stores].map(|channels| {
                let count = |which: usize| channels.iter().filter(|has| has[which]).count();
                format!("{} channels, {} of them with labels and {} with colours", channels.len(), count(0), count(1))
            });
            return Err(SettingError::new(
                "volume",
                format!("a sample of {found}"),
                format!("{allowed}, as the stores have"),
            ));
        }
        let Splatting { interpolation, method, .. } = self.splatting;
        if (self.classification(sample), interpolation) == (Classification::After, Interpolation::Exact) {
            return refused("splatting.interpolation", "\"exact\"", "\"smooth\"");
        }
        if method != Method::ImageAligned {
            let found = format!("{:?}", name_of(METHODS, method));
            return refused("splatting.method", &found, "\"image-aligned\"");
        }
        Ok(())
    }
}

/// The scene's volume, if its channels and labels can be read by boxes, and fit into no memory; `None` for any other. A file that cannot be opened gives
/// `None` too: reading it as a whole then tells why.
///
/// # Errors
/// If channels or labels lie on several grids, the index is of none of them, or their sample cannot be read.
fn streamed(scene: &Scene, options: &ReadOptions, access: &Access) -> Result<Option<StreamedVolume>, VolumeError> {
    let memory = options.memory_limit();
    let mut channels = match (load::streamed(scene, access), &options.index) {
        (Some(Ok(channels)), _) => channels,
        (_, None) => return Ok(None),
        (None, Some(path)) => {
            let [found, allowed] =
                ["an index for a volume that comes from no file", "none, or one of the volume's store"];
            return Err(VolumeError::invalid(
                path.display().to_string(),
                "index".to_owned(),
                found.to_owned(),
                allowed.to_owned(),
            ));
        }
        (Some(Err(error)), Some(_)) => return Err(error),
    };
    // It is wrong also where the volume fits into memory.
    if let Some(path) = &options.index {
        // The text, and up to five times as many bytes of ranges.
        let text = access.text(path, memory / 8)?.map_err(|source| VolumeError::io(path, source))?;
        let origin = path.display().to_string();
        StreamedVolume::index(&mut channels, StoreIndex::decode(&origin, &text)?, &origin)?;
    }
    let (mut bytes, mut largest) = (0, 0_u64);
    let of_voxels =
        |dims: UVec3, each: u64| dims.to_array().into_iter().fold(each, |all, n| all.saturating_mul(n.into()));
    for channel in &channels {
        for (of, is_labels) in [(Some(&channel.values), false), (channel.labels.as_ref(), true)] {
            let Some(StreamedLevel { store, level, .. }) = of else { continue };
            let Some(of) = store.levels().get(*level) else { return Ok(None) };
            let held = if is_labels { of_voxels(of.grid.dims, 2) } else { store.memory(*level) };
            bytes = held.saturating_add(bytes);
            let read = if store.has_colors() { COLOR_BYTES } else { size_of::<f32>() as u64 };
            largest = largest.max(of_voxels(of.chunk, read));
        }
    }
    // A thread that draws holds some chunks, beside those that are read for it. More threads draw where there is room for theirs.
    let least = largest.saturating_mul(CHUNKS_OF_THREAD);
    if bytes <= memory || least > memory / 2 {
        return Ok(None);
    }
    StreamedVolume::of_channels(channels, memory).map(Some)
}
