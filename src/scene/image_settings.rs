//! The settings of the image.

/// The image's size and background.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImageSettings {
    /// Pixels per row, at least 1. The renderer checks the device's texture limit.
    pub width: u32,
    /// The number of rows, at least 1. The renderer checks the device's texture limit.
    pub height: u32,
    /// Straight-alpha, display-referred RGBA in [0, 1].
    pub background: [f64; 4],
}

impl ImageSettings {
    /// Whether the background is nearer to white than to black.
    pub(super) fn is_light(&self) -> bool {
        let [red, green, blue, alpha] = self.background;
        // Rec. 709.
        (0.2126 * red + 0.7152 * green + 0.0722 * blue) * alpha > 0.5
    }
}

/// A background with straight alpha, premultiplied (SPEC §5).
pub(crate) fn premultiplied([red, green, blue, alpha]: [f64; 4]) -> [f32; 4] {
    [red * alpha, green * alpha, blue * alpha, alpha].map(|channel| channel as f32)
}

impl Default for ImageSettings {
    fn default() -> Self {
        Self { width: 512, height: 512, background: [0.0, 0.0, 0.0, 1.0] }
    }
}
