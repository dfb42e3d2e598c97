//! Sizes and colours of words, by the image's size and background.

use super::canvas::{empty, filled, lay, over};
use super::text;
use crate::image::Image;

/// The font's height in shares of the image's shorter side, and the least that can be read, in pixels.
const SHARE: f32 = 1.0 / 30.0;
const LEAST: f32 = 8.0;

/// A background at least as bright as this gets black ink: there both inks' contrasts are equal (WCAG 2: 0.179 of linear light, by squares 0.2).
const BRIGHT: f64 = 0.2;

/// The font's height in pixels for an image of a size.
pub fn em(size: [u32; 2]) -> f32 {
    (size[0].min(size[1]) as f32 * SHARE).max(LEAST)
}

/// How words are drawn into an image.
#[derive(Clone, Debug)]
pub(super) struct Style {
    /// The font's height in pixels.
    pub(super) em: f32,
    pub(super) ink: [f32; 3],
    /// The colour around the ink where what lies behind the image is unknown.
    halo: Option<[f32; 3]>,
}

impl Style {
    pub(super) fn of(size: [u32; 2], [red, green, blue, alpha]: [f64; 4]) -> Self {
        let luminance = 0.2126 * red * red + 0.7152 * green * green + 0.0722 * blue * blue;
        let is_open = alpha < 1.0;
        let ink = if is_open || luminance > BRIGHT { [0.0; 3] } else { [1.0; 3] };
        Self { em: em(size), ink, halo: is_open.then_some([1.0; 3]) }
    }

    /// A length in heights of the font as pixels, at least 1.
    pub(super) fn pixels(&self, ems: f32) -> u32 {
        ((self.em * ems).round() as u32).max(1)
    }

    /// The distance between words and what is beside them.
    pub(super) fn pad(&self) -> u32 {
        self.pixels(0.5)
    }

    /// The thickness of lines.
    pub(super) fn stroke(&self) -> u32 {
        self.pixels(1.0 / 14.0)
    }

    pub(super) fn line(&self) -> u32 {
        text::line(self.em)
    }

    pub(super) fn width(&self, words: &str) -> u32 {
        text::width(words, self.em)
    }

    pub(super) fn write(&self, image: &mut Image, corner: [u32; 2], words: &str) {
        text::write(image, corner, words, self.em, self.ink);
    }

    /// A line of text as an image.
    pub(super) fn words(&self, words: &str) -> Image {
        let mut image = empty([self.width(words).max(1), self.line()]);
        self.write(&mut image, [0, 0], words);
        image
    }

    /// Fills a rectangle with ink.
    pub(super) fn rule(&self, image: &mut Image, corner: [u32; 2], size: [u32; 2]) {
        let [red, green, blue] = self.ink;
        lay(image, corner, &filled(size, [red, green, blue, 1.0]));
    }

    /// Draws a layer of words over an image of the same size; over one that lets through what lies behind it, with a halo.
    pub(super) fn finish(&self, image: &mut Image, layer: &Image) {
        if let Some([red, green, blue]) = self.halo {
            for (alpha, at) in self.spread(layer).into_iter().zip(0..) {
                if alpha > 0.0 {
                    over(
                        image,
                        [at % layer.width, at / layer.width],
                        [red * alpha, green * alpha, blue * alpha, alpha],
                    );
                }
            }
        }
        lay(image, [0, 0], layer);
    }

    /// The greatest alpha of the layer within the halo's radius of each pixel.
    fn spread(&self, layer: &Image) -> Vec<f32> {
        let radius = i64::from(self.pixels(0.1));
        let [width, height] = [layer.width, layer.height].map(i64::from);
        let mut spread = vec![0.0_f32; layer.pixels.len()];
        for (pixel, at) in layer.pixels.iter().zip(0..).filter(|(pixel, _)| pixel[3] > 0.0) {
            let [x, y] = [at % width, at / width];
            for (dx, dy) in (-radius..=radius).flat_map(|dy| (-radius..=radius).map(move |dx| (dx, dy))) {
                let [near_x, near_y] = [x + dx, y + dy];
                if dx * dx + dy * dy <= radius * radius && (0..width).contains(&near_x) && (0..height).contains(&near_y)
                {
                    let reached = &mut spread[(near_y * width + near_x) as usize];
                    *reached = reached.max(pixel[3]);
                }
            }
        }
        spread
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_grow_with_the_shorter_side_and_stay_readable() {
        let expected =
            [([64, 128], 8.0), ([256, 512], 256.0 / 30.0), ([1024, 2048], 1024.0 / 30.0), ([1600, 900], 30.0)];
        for (size, expected) in expected {
            assert!((em(size) - expected).abs() < 1e-4, "{size:?}: {}", em(size));
        }
    }

    #[test]
    fn ink_differs_from_its_background() {
        let ink = |background| Style::of([64, 64], background).ink[0];
        assert_eq!([[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0], [0.4, 0.4, 0.4, 1.0]].map(ink), [1.0; 3]);
        assert_eq!([[1.0, 1.0, 1.0, 1.0], [1.0, 1.0, 0.0, 1.0], [0.5, 0.5, 0.5, 1.0], [0.0; 4]].map(ink), [0.0; 4]);
    }
}
