//! Opening a scene's volume: in memory, or where it fits into none, to be read while it is drawn.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::names::{METHODS, name_of};
use super::{Scene, load};
use crate::error::setting::SettingError;
use crate::parallel;
use crate::settings::splatting::{Classification, Interpolation, Method, Splatting};
use crate::volume::{Access, Grid, IndexedStore, ReadOptions, Store, StoreIndex, StreamedVolume, Volume, VolumeError};

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
            Self::Streamed(volume) => volume.level as u32,
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
        self.open_volume_and_files(&ReadOptions::default()).map(|(volume, _)| volume)
    }

    /// Like [`Self::open_volume`], with the options of [`Self::load_volume_with`], and the files of [`Self::load_volume_and_files`].
    ///
    /// # Errors
    /// As for [`Self::load_volume_with`].
    pub fn open_volume_and_files(&self, options: &ReadOptions) -> Result<(OpenVolume, Vec<PathBuf>), VolumeError> {
        let scene = self.choose_levels(options, Self::explicit)?;
        let access = Access::new(options)?;
        if let Some(volume) = streamed(&scene, options, &access)? {
            return Ok((volume.into(), access.files()));
        }
        // What the store reserved is free again.
        let access = Access::new(options)?;
        let volume = load::channels(&scene, &access)?;
        Ok((volume.into(), access.files()))
    }

    /// Checks that the scene can show a volume that is read while it is drawn, given its sample: one channel of values, with image-aligned sheets, and values that
    /// are interpolated as they are.
    pub(crate) fn check_streamed(&self, sample: &Volume) -> Result<(), SettingError> {
        let refused = |key: &str, found: &str, allowed: &str| {
            let found = format!("{found} for a volume that is streamed");
            Err(SettingError::new(key, found, format!("{allowed}, or more memory")))
        };
        let of_volume = match sample {
            _ if !self.further.is_empty() || !sample.further().is_empty() => Some("several channels"),
            _ if sample.labels().is_some() => Some("labels"),
            _ if sample.colors().is_some() => Some("colours"),
            _ => None,
        };
        if let Some(found) = of_volume {
            let found = format!("{found} of a volume that is streamed");
            return Err(SettingError::new("volume", found, "one channel of values without labels, or more memory"));
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

/// The scene's volume, if it has one channel, can be read by boxes, and fits into no memory; `None` for any other. A file that cannot be opened gives
/// `None` too: reading it as a whole then tells why.
fn streamed(scene: &Scene, options: &ReadOptions, access: &Access) -> Result<Option<StreamedVolume>, VolumeError> {
    let memory = options.memory_limit();
    let Some(Ok(store)) = load::store(scene, access) else { return Ok(None) };
    let level = scene.level.unwrap_or(0) as usize;
    let Some(of) = store.levels().get(level) else { return Ok(None) };
    let bytes = |dims: [u32; 3]| dims.into_iter().fold(4, |bytes: u64, n| bytes.saturating_mul(n.into()));
    // Every thread that draws or reads holds some chunks, beside those that wait for other tiles.
    let least = bytes(of.chunk.to_array()).saturating_mul(4 * parallel::current_num_threads() as u64);
    if bytes(of.grid.dims.to_array()) <= memory || least > memory / 2 {
        return Ok(None);
    }
    let store = match &options.index {
        Some(path) => indexed(store, path, access)?,
        None => store,
    };
    StreamedVolume::new(&load::origin(&scene.volume), store, level, memory).map(Some)
}

/// A store with the index in a file.
fn indexed(store: Arc<dyn Store>, path: &Path, access: &Access) -> Result<Arc<dyn Store>, VolumeError> {
    let text = access.text(path)?.map_err(|source| VolumeError::Io { path: path.to_owned(), source })?;
    let origin = path.display().to_string();
    Ok(Arc::new(IndexedStore::new(store, StoreIndex::decode(&origin, &text)?, &origin)?))
}
