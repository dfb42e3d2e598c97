//! When an image is drawn with half as many pixels a side: while the pointer moves something and whole ones take too long.

/// Milliseconds that a frame may take for the picture to follow the pointer.
const FLUENT_MS: f64 = 100.0;

/// What frames took.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Pace {
    /// The last frame of all pixels. The first one, which also compiles the renderer, counts as 0.
    whole_ms: Option<f64>,
}

impl Pace {
    /// Pixels of the window that a pixel of the next frame covers, a side.
    pub(super) fn pixel(self, interacting: bool) -> u32 {
        if interacting && self.whole_ms.is_some_and(|ms| ms > FLUENT_MS) { 2 } else { 1 }
    }

    /// A frame of such pixels was drawn.
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
