//! Raw files: samples without a header, so that somebody else has to say what they are.

use std::path::Path;

use glam::{DVec3, UVec3};

use super::samples::{SIZES, SampleType, Samples, Stream, dims_of};
use super::source::{Source, invalid};
use super::{Volume, VolumeError};

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

/// The types by their names in scenes.
pub(crate) const TYPES: [(&str, SampleType); 10] = [
    ("int8", SampleType::I8),
    ("uint8", SampleType::U8),
    ("int16", SampleType::I16),
    ("uint16", SampleType::U16),
    ("int32", SampleType::I32),
    ("uint32", SampleType::U32),
    ("int64", SampleType::I64),
    ("uint64", SampleType::U64),
    ("float32", SampleType::F32),
    ("float64", SampleType::F64),
];

impl Volume {
    /// Reads a file of samples without a header, whatever its name. Spacing is 1.
    ///
    /// # Errors
    /// If the file cannot be read, a dimension is 0, there are more than `u32::MAX` voxels, the file does not end where the samples
    /// do, or a value is not finite (the error names the voxel).
    pub fn open_raw(path: &Path, layout: &RawLayout) -> Result<Self, VolumeError> {
        let &RawLayout { dims, sample_type: kind, big_endian, offset } = layout;
        if dims_of(dims.to_array()).is_none() {
            return Err(invalid(path, "sizes", dims, SIZES));
        }
        let mut stream = Stream::raw(Source::open(path)?)?;
        stream.skip(offset)?;
        let values = stream.samples(&Samples { kind, dims, big_endian, rescale: None, z_fastest: false }, false)?;
        Self::new(&path.display().to_string(), dims, DVec3::ONE, values)
    }
}
