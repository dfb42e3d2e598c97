//! How a file says that a channel is shown.

use glam::DVec3;

/// A channel's colours and its window, as far as its file states them.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct ChannelDisplay {
    /// Red, green and blue in [0, 1]: one colour, or several that are spread evenly over the window; empty if the file states none.
    pub colors: Vec<DVec3>,
    /// The values that are shown darkest and brightest.
    pub window: Option<[f64; 2]>,
}
