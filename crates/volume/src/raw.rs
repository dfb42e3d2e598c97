//! Raw files: samples without a header, whose layout the caller states.

use std::path::Path;
use std::sync::Arc;

use glam::{DVec3, UVec3};

use super::access::{Access, ReadOptions};
use super::error::volume::invalid;
use super::grid::{SIZES, dims_of};
use super::located::Located;
use super::sample_type::SampleType;
use super::samples::Samples;
use super::seek::FileStore;
use super::series::Series;
use super::store::{Store, StoreFacts};
use super::stream::Stream;
use super::{Encoding, Volume, VolumeError};

/// The format's name.
pub(super) const FORMAT: &str = "raw";

/// The layout of a raw file, which has no header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RawLayout {
    /// The number of voxels along x, y and z; x is fastest.
    pub dims: UVec3,
    /// The type of the samples.
    pub sample_type: SampleType,
    /// Whether the most significant byte of a sample comes first.
    pub big_endian: bool,
    /// Bytes before the first sample.
    pub offset: u64,
}

impl Volume {
    /// Reads a file of samples without a header, whatever its name. The spacing is 1.
    ///
    /// # Errors
    /// If the file cannot be read, a dimension is 0, there are more than `u32::MAX` voxels, the file does not end where the samples end,
    /// they need more memory than [`ReadOptions::memory`] allows by default, or no value is finite.
    pub fn open_raw(path: &Path, layout: &RawLayout) -> Result<Self, VolumeError> {
        Self::open_raw_with(path, layout, &ReadOptions::default())
    }

    /// Like [`Self::open_raw`], with a folder that the file must lie in and a memory limit.
    ///
    /// # Errors
    /// As for [`Self::open_raw`], and if the file lies outside the folder.
    pub fn open_raw_with(path: &Path, layout: &RawLayout, options: &ReadOptions) -> Result<Self, VolumeError> {
        Self::read_raw(path, layout, &Access::new(options)?)
    }

    #[doc(hidden)]
    pub fn read_raw(path: &Path, layout: &RawLayout, access: &Access) -> Result<Self, VolumeError> {
        let &RawLayout { dims, sample_type: kind, big_endian, offset } = layout;
        if dims_of(dims.to_array()).is_none() {
            return Err(invalid(path, "sizes", dims, SIZES));
        }
        let mut stream = Stream::raw(access.open(path)?)?;
        stream.skip(offset)?;
        let samples = Samples { kind, dims, big_endian, rescale: None, z_fastest: false };
        let values = stream.samples(&samples, false)?.into_values();
        access.take_rounding().warn(path, kind, values.as_slice());
        let origin = path.display().to_string();
        Self::from_values(&origin, dims, DVec3::ONE, values)?.stating(&origin, facts(kind))
    }
}

fn facts(kind: SampleType) -> StoreFacts {
    let encoding = Encoding { format: FORMAT, sample_type: kind, channels: 1, times: 1 };
    StoreFacts {
        encoding: Some(encoding),
        assumed_axes: Some("x is the fastest, then y, then z"),
        ..StoreFacts::default()
    }
}

/// Opens a file of samples without a header to be read by boxes.
///
/// # Errors
/// If the file cannot be read, or is shorter than its layout says.
pub fn open_raw_store(path: &Path, layout: &RawLayout, options: &ReadOptions) -> Result<Arc<dyn Store>, VolumeError> {
    raw_store(path, layout, &Access::new(options)?)
}

/// As [`open_raw_store`].
pub fn raw_store(path: &Path, layout: &RawLayout, access: &Access) -> Result<Arc<dyn Store>, VolumeError> {
    let &RawLayout { dims, sample_type: kind, big_endian, offset: at } = layout;
    let samples = Samples { kind, dims, big_endian, rescale: None, z_fastest: false };
    dims_of(dims.to_array()).ok_or_else(|| invalid(path, "sizes", dims, SIZES))?;
    let mut file = access.open(path)?;
    file.skip(at)?;
    let left = file.left()?;
    if left != samples.bytes() {
        return Err(samples.mismatch(path, left));
    }
    let located = Located { path: path.to_owned(), at, samples, series: Series::default() };
    located.series.check(path, access.selection())?;
    Ok(Arc::new(FileStore::new(located, 0..1, DVec3::ONE, facts(kind), access)?))
}
