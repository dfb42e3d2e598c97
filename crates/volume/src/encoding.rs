//! How a file stores a volume.

use super::sample_type::SampleType;

/// How a file stores a volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Encoding {
    /// The format's name: `NRRD`, `NIfTI`, `raw`.
    pub format: &'static str,
    /// The type of its samples, before slope and intercept are applied.
    pub sample_type: SampleType,
    /// The number of channels in the file, of which the volume may be one.
    pub channels: u32,
    /// The number of times in the file, of which the volume is one.
    pub times: u32,
}
