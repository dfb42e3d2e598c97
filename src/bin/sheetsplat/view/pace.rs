//! The choice of half resolution, for pictures that change with the pointer when whole ones take too long.

/// The maximum milliseconds of a frame with which the picture follows the pointer smoothly.
const FLUENT_MS: f64 = 100.0;

/// The measured time of frames.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Pace {
    /// The time of the last frame at full resolution. The first frame, which also compiles the renderer, counts as 0.
    whole_ms: Option<f64>,
}

impl Pace {
    /// The side, in pixels of the window, of a pixel in the next frame.
    pub(super) fn pixel(self, interacting: bool) -> u32 {
        if interacting && self.whole_ms.is_some_and(|ms| ms > FLUENT_MS) { 2 } else { 1 }
    }

    /// Notes the time of a frame with pixels of this side.
    pub(super) fn drawn(&mut self, pixel: u32, ms: f64) {
        if pixel == 1 {
            self.whole_ms = Some(self.whole_ms.map_or(0.0, |_| ms));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slow_frames_are_coarse_while_something_moves_and_fine_at_rest() {
        let mut pace = Pace::default();
        assert_eq!(pace.pixel(true), 1);
        pace.drawn(1, 900.0);
        assert_eq!(pace.pixel(true), 1, "the first frame compiles");
        pace.drawn(1, 400.0);
        assert_eq!((pace.pixel(true), pace.pixel(false)), (2, 1));
        pace.drawn(2, 80.0);
        assert_eq!(pace.pixel(true), 2, "whole frames would be slow again");
        pace.drawn(1, 50.0);
        assert_eq!(pace.pixel(true), 1);
    }
}
