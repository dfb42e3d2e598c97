//! Plates: the backgrounds of what is drawn over images.

use sheetsplat::image::Image;

use crate::canvas::filled;

/// Pixels between a plate's edges and its content.
pub(super) const PADDING: u32 = 6;

/// A premultiplied background on which text is readable over any image.
const PLATE: [f32; 4] = [0.0, 0.0, 0.0, 0.75];

/// An empty plate around content of a size.
pub(super) fn plate_for([width, height]: [u32; 2]) -> Image {
    filled([width.saturating_add(2 * PADDING), height.saturating_add(2 * PADDING)], PLATE)
}
