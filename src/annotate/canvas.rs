//! Drawing rectangles and images into images.

use crate::image::Image;

/// An image of one premultiplied colour.
pub fn filled([width, height]: [u32; 2], color: [f32; 4]) -> Image {
    Image { width, height, pixels: vec![color; width as usize * height as usize] }
}

/// A transparent image.
pub(super) fn empty(size: [u32; 2]) -> Image {
    filled(size, [0.0; 4])
}

/// Draws an image over another one, with its upper left corner at a pixel. The part outside is left out.
pub fn lay(image: &mut Image, [left, top]: [u32; 2], above: &Image) {
    for (pixel, at) in above.pixels.iter().zip(0..) {
        over(image, [left + at % above.width, top + at / above.width], *pixel);
    }
}

/// Composites a premultiplied colour over a pixel, if the image has it.
pub(super) fn over(image: &mut Image, [x, y]: [u32; 2], color: [f32; 4]) {
    if x >= image.width || y >= image.height {
        return;
    }
    let pixel = &mut image.pixels[y as usize * image.width as usize + x as usize];
    for (below, above) in pixel.iter_mut().zip(color) {
        *below = above + *below * (1.0 - color[3]);
    }
}

/// The image turned by a quarter, so that text runs upwards.
pub(super) fn turned(image: &Image) -> Image {
    let [width, height] = [image.height, image.width];
    let pixel = |x: u32, y: u32| image.pixels[(x * image.width + image.width - 1 - y) as usize];
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| pixel(x, y))).collect();
    Image { width, height, pixels }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quarter_turn_puts_the_end_on_top() {
        let pixel = |number: u8| [f32::from(number); 4];
        let image = Image { width: 3, height: 2, pixels: (0..6).map(pixel).collect() };
        let turned = turned(&image);
        assert_eq!([turned.width, turned.height], [2, 3]);
        assert_eq!(turned.pixels, [2, 5, 1, 4, 0, 3].map(pixel));
    }
}
