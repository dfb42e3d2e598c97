//! The colours that a channel's file states, as a transfer function's.

use glam::DVec3;

use crate::settings::transfer_function::Ramp;
use crate::volume::ChannelDisplay;

/// The colours over values; `None` without any. Of several colours without a window it is the last one.
pub(crate) fn color(display: &ChannelDisplay) -> Option<Ramp<DVec3>> {
    let last = *display.colors.last()?;
    let spread = |[low, high]: [f64; 2]| {
        let steps = (display.colors.len() - 1) as f64;
        let place = |at: usize| low + (high - low) * (at as f64 / steps);
        Ramp::new((0..).map(place).zip(display.colors.iter().copied()).collect()).ok()
    };
    let ramp = display.window.filter(|_| display.colors.len() > 1).and_then(spread);
    Some(ramp.unwrap_or_else(|| Ramp::through(vec![(0.0, last)])))
}
