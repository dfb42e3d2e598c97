//! Raw files: samples without a header, whose layout the caller states.

use std::path::Path;

use glam::{DVec3, UVec3};

use super::access::{Access, ReadOptions};
use super::error::volume::invalid;
use super::samples::{SIZES, SampleType, Samples, Stream, dims_of};
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
        let values = stream.samples::<f32>(&samples, false)?;
        let volume = Self::from_values(&path.display().to_string(), dims, DVec3::ONE, values)?;
        Ok(Self { encoding: Some(Encoding { format: FORMAT, sample_type: kind, channels: 1, times: 1 }), ..volume })
    }
}
