//! How a file says that a channel is shown.

use glam::DVec3;

use super::Volume;
use crate::settings::transfer_function::Ramp;

/// A channel's colours and its window, as far as its file states them.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct ChannelDisplay {
    /// Red, green and blue in [0, 1]: one colour, or several that are spread evenly over the window; empty if the file states none.
    pub colors: Vec<DVec3>,
    /// The values that are shown darkest and brightest.
    pub window: Option<[f64; 2]>,
}

impl ChannelDisplay {
    /// The colours over values; `None` without any. Of several colours without a window it is the last one.
    pub(crate) fn color(&self) -> Option<Ramp<DVec3>> {
        let last = *self.colors.last()?;
        let spread = |[low, high]: [f64; 2]| {
            let steps = (self.colors.len() - 1) as f64;
            let place = |at: usize| low + (high - low) * (at as f64 / steps);
            Ramp::new((0..).map(place).zip(self.colors.iter().copied()).collect()).ok()
        };
        let ramp = self.window.filter(|_| self.colors.len() > 1).and_then(spread);
        Some(ramp.unwrap_or_else(|| Ramp::through(vec![(0.0, last)])))
    }
}

impl Volume {
    /// How the file says that the channel is shown; `None` if it says nothing.
    pub fn display(&self) -> Option<&ChannelDisplay> {
        self.display.as_ref()
    }

    /// The same volume with another way to show its first channel.
    pub fn with_display(mut self, display: Option<ChannelDisplay>) -> Self {
        self.display = display;
        self
    }
}
