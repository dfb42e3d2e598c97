//! Drawing rectangles and text into images.

use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};
use sheetsplat::image::Image;

/// The distance between lines of text in pixels.
pub(crate) const LINE: u32 = TEXT.val() as u32;

/// The brightness of text.
const INK: f32 = 0.9;

const WEIGHT: FontWeight = FontWeight::Regular;
const TEXT: RasterHeight = RasterHeight::Size16;

/// An image of one premultiplied colour.
pub(crate) fn filled([width, height]: [u32; 2], color: [f32; 4]) -> Image {
    Image { width, height, pixels: vec![color; width as usize * height as usize] }
}

/// The width of a line in pixels.
pub(crate) fn text_width(line: &str) -> u32 {
    u32::try_from(line.chars().count().saturating_mul(get_raster_width(WEIGHT, TEXT))).unwrap_or(u32::MAX)
}

/// Writes a line with its upper left corner at a pixel.
pub(crate) fn write(image: &mut Image, [left, top]: [u32; 2], line: &str) {
    // The font covers Latin-1.
    let raster = |character| get_raster(character, WEIGHT, TEXT).or_else(|| get_raster('?', WEIGHT, TEXT));
    for (character, place) in line.chars().filter_map(raster).zip(0..) {
        for (row, y) in character.rows().zip(0..) {
            for (&coverage, x) in row.iter().zip(0..) {
                let alpha = f32::from(coverage) / 255.0;
                let ink = INK * alpha;
                over(image, [left + place * character.width() as u32 + x, top + y], [ink, ink, ink, alpha]);
            }
        }
    }
}

/// Fills a rectangle with the text's brightness.
pub(crate) fn rule(image: &mut Image, corner: [u32; 2], size: [u32; 2]) {
    lay(image, corner, &filled(size, [INK, INK, INK, 1.0]));
}

/// Draws an image over another one, with its upper left corner at a pixel.
pub(crate) fn lay(image: &mut Image, [left, top]: [u32; 2], above: &Image) {
    for (pixel, at) in above.pixels.iter().zip(0..) {
        over(image, [left + at % above.width, top + at / above.width], *pixel);
    }
}

/// Composites a premultiplied colour over a pixel.
fn over(image: &mut Image, [x, y]: [u32; 2], color: [f32; 4]) {
    let pixel = &mut image.pixels[y as usize * image.width as usize + x as usize];
    for (below, above) in pixel.iter_mut().zip(color) {
        *below = above + *below * (1.0 - color[3]);
    }
}
