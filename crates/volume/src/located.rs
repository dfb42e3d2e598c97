//! Where readers find samples, noted for files that are read by boxes.

use std::path::PathBuf;
use std::sync::Mutex;

use super::samples::Samples;
use super::series::Series;

/// Where the samples of a file are.
#[derive(Clone, Debug)]
pub(super) struct Located {
    pub(super) path: PathBuf,
    /// The byte of the first sample.
    pub(super) at: u64,
    pub(super) samples: Samples,
    pub(super) series: Series,
}

/// The places of samples, which readers note instead of reading them.
pub(super) type Notes = Mutex<Vec<Located>>;
