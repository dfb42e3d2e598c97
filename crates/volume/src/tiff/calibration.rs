//! A file's statements about its pages.

use super::super::display::ChannelDisplay;
use super::stack::{Runs, Stack};

/// The voxel sizes, the expected number of slices, and the meaning of samples.
#[derive(Default)]
pub(super) struct Calibration {
    /// The spacing along x and y.
    pub(super) spacing: Option<[f64; 2]>,
    /// The spacing along z; ignored where x and y have none.
    pub(super) between_slices: Option<f64>,
    pub(super) unit: Option<String>,
    /// The order of the pages.
    pub(super) stack: Option<Stack>,
    /// Where pages are not in the stack's order.
    pub(super) runs: Runs,
    /// The other files of a set, by their names, with what their pages show.
    pub(super) others: Vec<(String, Runs)>,
    /// Whether all planes may follow the first page's directory without directories of their own.
    pub(super) is_contiguous: bool,
    pub(super) channel_names: Vec<String>,
    pub(super) displays: Vec<ChannelDisplay>,
    /// Slope and intercept.
    pub(super) rescale: Option<[f64; 2]>,
}
