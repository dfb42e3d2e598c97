//! Raw files: samples without a header, so that somebody else has to say what they are.

use std::path::Path;

use glam::{DVec3, UVec3};

use super::samples::{SIZES, SampleType, Samples, Stream, dims_of};
use super::source::{Source, invalid};
use super::{Encoding, Volume, VolumeError};

/// What a raw file has no header to say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RawLayout {
    /// Voxels along x, y and z; x is fastest.
    pub dims: UVec3,
    /// The type of the samples.
    pub sample_type: SampleType,
    /// Whether a sample's most significant byte comes first.
    pub big_endian: bool,
    /// Bytes before the first sample.
    pub offset: u64,
}

impl Volume {
    /// Reads a file of samples without a header, whatever its name. Spacing is 1.
    ///
    /// # Errors
    /// If the file cannot be read, a dimension is 0, there are more than `u32::MAX` voxels, the file does not end where the samples
    /// do, or no value is finite.
    pub fn open_raw(path: &Path, layout: &RawLayout) -> Result<Self, VolumeError> {
        let &RawLayout { dims, sample_type: kind, big_endian, offset } = layout;
        if dims_of(dims.to_array()).is_none() {
            return Err(invalid(path, "sizes", dims, SIZES));
        }
        let mut stream = Stream::raw(Source::open(path)?)?;
        stream.skip(offset)?;
        let values = stream.samples(&Samples { kind, dims, big_endian, rescale: None, z_fastest: false }, false)?;
        let volume = Self::new(&path.display().to_string(), dims, DVec3::ONE, values)?;
        Ok(Self { encoding: Some(Encoding { format: "raw", sample_type: kind }), ..volume })
    }
}
