//! How a picture is finished where culling may have stopped its pixels (SPEC §6, closing).

use super::splatting::Splatting;

/// Fills the opacity that a pixel lacks beyond the threshold T with its own colour: entirely from T on, where it may stop in any slab, and less and less
/// down to `2T - 1`. The share would show as dark steps along slabs otherwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Closing {
    threshold: f32,
}

impl Closing {
    /// `None` where pixels stay as they are: nothing may be culled, or alpha is not an opacity that is composited. The order of compositing does not matter, so
    /// that it never changes the picture.
    pub(crate) fn of(splatting: &Splatting) -> Option<Self> {
        let Splatting { compositing, culling, opacity_threshold, .. } = *splatting;
        // Thresholds that f32 rounds to 1, or nearly to 0, have no ramp.
        let threshold = opacity_threshold.max(1e-30) as f32;
        (compositing.is_by_opacity() && culling && threshold < 1.0).then_some(Self { threshold })
    }

    /// The threshold T, above 0 and below 1.
    #[cfg(feature = "gpu")]
    pub(crate) fn threshold(self) -> f32 {
        self.threshold
    }

    /// A premultiplied pixel before the background, as in `shaders/shared/finished.wgsl`.
    pub(crate) fn pixel(self, [red, green, blue, alpha]: [f32; 4]) -> [f32; 4] {
        let least = (2.0 * self.threshold - 1.0).max(0.0);
        if alpha <= least {
            return [red, green, blue, alpha];
        }
        let share = ((alpha - least) / (self.threshold - least)).min(1.0);
        let closed = alpha + (1.0 - alpha) * (share * share);
        let scale = closed / alpha;
        [red * scale, green * scale, blue * scale, closed]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::splatting::Compositing;

    /// SPEC §6: nothing below `2T - 1`, everything from T on, and within `1 - T` of any picture that continues behind the pixel.
    #[test]
    fn pixels_are_closed_from_the_threshold_on() {
        for threshold in [1e-9, 0.2, 0.5, 0.6, 0.95, 0.999] {
            let closing = Closing::of(&Splatting { opacity_threshold: threshold, ..Splatting::default() });
            let pixel =
                |alpha: f32| closing.map_or([0.0; 4], |closing| closing.pixel([alpha, 0.5 * alpha, 0.0, alpha]));
            let least = (2.0 * threshold - 1.0).max(0.0);
            for step in 0..=1000 {
                let alpha = (f64::from(step) / 1000.0) as f32;
                let [red, green, blue, closed] = pixel(alpha);
                let share = ((f64::from(alpha) - least) / (threshold - least)).clamp(0.0, 1.0);
                let expected = f64::from(alpha) + (1.0 - f64::from(alpha)) * share * share;
                assert!((f64::from(closed) - expected).abs() < 1e-4, "{threshold} {alpha}: {closed} {expected}");
                assert!((red - closed).abs() < 1e-6 && (green - 0.5 * closed).abs() < 1e-6 && blue == 0.0);
                // Matter behind the pixel adds at most 1 - alpha, and culling hides it only from T on.
                assert!(f64::from(closed - alpha) <= 1.0 - threshold + 1e-6, "{threshold} {alpha}");
            }
            assert_eq!(pixel(0.0), [0.0; 4]);
        }
    }

    #[test]
    fn only_pictures_that_are_culled_are_closed() {
        let closes = |splatting: Splatting| Closing::of(&splatting).is_some();
        let default = Splatting::default();
        assert!(closes(default) && closes(Splatting { compositing: Compositing::Exponential, ..default }));
        assert!(!closes(Splatting { culling: false, ..default }));
        assert!(!closes(Splatting { opacity_threshold: 1.0, ..default }));
        for compositing in [Compositing::Xray, Compositing::Maximum, Compositing::Surface] {
            assert!(!closes(Splatting { compositing, ..default }));
        }
    }
}
