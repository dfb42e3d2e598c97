//! Opening files of any format, whole or to be read by boxes.

use std::path::Path;
use std::sync::Arc;

use glam::DVec3;

use super::access::{Access, ReadOptions};
use super::error::volume::{VolumeError, invalid, refused};
use super::format;
use super::loaded::{Levels, Loaded};
use super::numbered::are_beyond_16_bits;
use super::store::{Store, StoreFacts};
use super::texel::COLOR_BYTES;
use super::values::Values;
use super::volume::Volume;
use super::voxels::Wanted;

impl Volume {
    /// Reads a volume file. Its first bytes determine the format, or else its extension: NRRD (`.nrrd`, `.nhdr`), and, each with the
    /// feature of its name, NIfTI (`.nii`, `.hdr`, `.img`, also with `.gz`), MGH (`.mgh`, `.mgz`), MetaImage (`.mha`, `.mhd`), NPY
    /// (`.npy`) and its archives (`.npz`: their only array, or the one named as in `file.npz:name`), TIFF (`.tif`, `.tiff`), DICOM
    /// (`.dcm`), VTK (`.vti`, `.vtr`, `.vtk`) and Zarr (folders, and archives `.zip` and `.ozx`). The path may also be a folder of slices: TIFF files of one page,
    /// or DICOM files, of whose series the largest is read, or that of [`ReadOptions::series`].
    ///
    /// # Errors
    /// If the file cannot be read, is of no format that is compiled in, does not hold what its header promises, or needs more memory
    /// than [`ReadOptions::memory`] allows by default.
    pub fn open(path: &Path) -> Result<Self, VolumeError> {
        Self::open_with(path, &ReadOptions::default())
    }

    /// Like [`Self::open`], with a folder that files must lie in and a memory limit.
    ///
    /// # Errors
    /// As for [`Self::open`], and if the file, or one that its header names, lies outside the folder.
    pub fn open_with(path: &Path, options: &ReadOptions) -> Result<Self, VolumeError> {
        Self::read(path, &Access::new(options)?)
    }

    #[doc(hidden)]
    pub fn read(path: &Path, access: &Access) -> Result<Self, VolumeError> {
        let (format, loaded) = format::read(path, &access.wanting(Wanted::Values))?;
        let first_channel = access.selection().channel.unwrap_or(0) as usize;
        let channels = first_channel..(loaded.series.channels as usize).max(first_channel + 1);
        let facts = |(at, channel): (usize, usize)| {
            let facts = loaded.facts(format, channel, at);
            StoreFacts { spacing: access.spacing().or(facts.spacing), ..facts }
        };
        let mut facts = channels.enumerate().map(facts).collect::<Vec<StoreFacts>>().into_iter();
        let is_left_handed = loaded.is_left_handed();
        let legend = loaded.legend(first_channel, 0);
        let Loaded { dims, kind: sample_type, spacing, series, levels, values, .. } = loaded;
        let mut values = values.into_values();
        let origin = path.display().to_string();
        let spacing = access.spacing().or(spacing).unwrap_or(DVec3::ONE);
        let rounding = access.take_rounding();
        let is_single = values.as_slice().len() == dims.element_product() as usize;
        // Pages, which are to be small, take large ids for values, and say that these are rounded.
        let may_be_ids =
            cfg!(not(target_arch = "wasm32")) && is_single && !series.is_color && are_beyond_16_bits(values.as_slice());
        if !may_be_ids {
            rounding.warn(path, sample_type, values.as_slice());
        }
        if series.is_color {
            let bytes = COLOR_BYTES * u64::from(dims.element_product());
            access.reserve(path, "data", format!("{dims} voxels with colours"), bytes)?;
            let volume = Self::from_components(&origin, dims, spacing, (values.as_slice(), sample_type))?;
            let facts = facts.next().unwrap_or_default();
            let facts = StoreFacts { palette: None, channel_name: None, display: None, ..facts };
            return Ok(volume.stating(&origin, facts)?.right_handed(is_left_handed));
        }
        // All channels' values, one after the other.
        let voxels = dims.element_product() as usize;
        let mut others = Vec::new();
        while values.as_slice().len() > voxels {
            others.push(values.split_off(values.as_slice().len() - voxels));
        }
        values.shrink_to_fit();
        let mut channel = |values: Values| {
            Self::from_values(&origin, dims, spacing, values)?.stating(&origin, facts.next().unwrap_or_default())
        };
        let mut first = channel(values)?;
        if may_be_ids {
            match first.labels_beyond_16_bits(path, &legend, access) {
                Some(labels) => first = first.with_numbered(labels),
                None => rounding.warn(path, sample_type, first.values()),
            }
        }
        let others = others.into_iter().rev().map(channel).collect::<Result<_, VolumeError>>()?;
        if let Some(Levels { dims, level, grid, reads }) = levels {
            let grid = access.spacing().map_or(grid, |spacing| grid.with_finest_spacing(spacing));
            grid.check().map_err(|error| refused(&origin, error))?;
            (first.grid, first.levels, first.level, first.reads) = (grid, dims, level, Some(reads));
        }
        Ok(first.with_channels(&origin, others)?.right_handed(is_left_handed))
    }
}

/// Opens a volume to be read by boxes: an OME-Zarr image or a Zarr array, or an uncompressed NRRD, NIfTI, MetaImage or NPY file. Of a file with several channels the options choose one; of several times they may.
///
/// # Errors
/// If the file cannot be read, is of no such format, holds several channels of which none is chosen, or needs more memory than
/// [`ReadOptions::memory`] allows for the chunks that are read at once.
pub fn open_store(path: &Path, options: &ReadOptions) -> Result<Arc<dyn Store>, VolumeError> {
    store(path, &Access::new(options)?)
}

/// As [`open_store`].
pub fn store(path: &Path, access: &Access) -> Result<Arc<dyn Store>, VolumeError> {
    let mut stores = stores(path, access)?;
    match (stores.len(), stores.pop()) {
        (1, Some(store)) => Ok(store),
        (count, _) => {
            let allowed = format!("the number of one of them, 0 to {}", count.saturating_sub(1));
            Err(invalid(path, "channels", count, allowed))
        }
    }
}

/// Opens the channels of a volume that are selected, each to be read by boxes; otherwise as [`open_store`].
pub fn stores(path: &Path, access: &Access) -> Result<Vec<Arc<dyn Store>>, VolumeError> {
    format::open_stores(path, access)
}
