//! YUV4MPEG2, the uncompressed stream that video encoders read.

use std::io::{self, Write};

use clap::ValueEnum;
use sheetsplat::image::Image;

/// The chroma resolution.
#[derive(Clone, Copy, Debug, PartialEq, ValueEnum)]
pub(crate) enum Chroma {
    /// Two by two pixels share a colour.
    #[value(name = "420")]
    Halved,
    /// Every pixel has its own colour.
    #[value(name = "444")]
    Full,
}

/// BT.709's weights of red and blue in luma.
const RED: f32 = 0.2126;
const BLUE: f32 = 0.0722;

/// Writes frames as one plane of luma and two of chroma, 8 bits, BT.709 in limited range: 16 to 235, and 16 to 240 around 128.
pub(super) struct Y4m<W> {
    to: W,
    chroma: Chroma,
}

impl<W: Write> Y4m<W> {
    /// Writes the stream's header, which states the range but has no field for the matrix.
    pub(super) fn new(mut to: W, [width, height]: [u32; 2], fps: u16, chroma: Chroma) -> io::Result<Self> {
        // Chroma is the mean of two by two pixels, so it is sited between them, as in JPEG.
        let sampling = match chroma {
            Chroma::Halved => "420jpeg",
            Chroma::Full => "444",
        };
        writeln!(to, "YUV4MPEG2 W{width} H{height} F{fps}:1 Ip A1:1 C{sampling} XCOLORRANGE=LIMITED")?;
        Ok(Self { to, chroma })
    }

    /// Writes a frame. Premultiplied colours equal colours over black.
    pub(super) fn add(&mut self, image: &Image) -> io::Result<()> {
        let pixels: Vec<[f32; 3]> =
            image.pixels.iter().map(|&[r, g, b, _]| ycbcr([r, g, b].map(|channel| channel.clamp(0.0, 1.0)))).collect();
        let mut bytes: Vec<u8> = b"FRAME\n".to_vec();
        bytes.extend(pixels.iter().map(|&[y, ..]| byte(16.0 + 219.0 * y)));
        for plane in [1, 2] {
            match self.chroma {
                Chroma::Full => bytes.extend(pixels.iter().map(|pixel| byte(128.0 + 224.0 * pixel[plane]))),
                Chroma::Halved => {
                    let width = image.width as usize;
                    for rows in pixels.chunks(2 * width) {
                        let (upper, lower) = rows.split_at(width);
                        let squares = upper.chunks(2).zip(lower.chunks(2));
                        let sums = squares.map(|(a, b)| a.iter().chain(b).map(|pixel| pixel[plane]).sum::<f32>());
                        bytes.extend(sums.map(|sum| byte(128.0 + 224.0 / 4.0 * sum)));
                    }
                }
            }
        }
        self.to.write_all(&bytes)
    }
}

/// Luma in [0, 1], and the differences of blue and red from it in [-1/2, 1/2].
fn ycbcr([r, g, b]: [f32; 3]) -> [f32; 3] {
    let y = RED * r + (1.0 - RED - BLUE) * g + BLUE * b;
    [y, (b - y) / (2.0 * (1.0 - BLUE)), (r - y) / (2.0 * (1.0 - RED))]
}

fn byte(value: f32) -> u8 {
    value.round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The stream of one frame, without its header.
    fn planes(chroma: Chroma, width: u32, pixels: Vec<[f32; 4]>) -> Vec<u8> {
        let image = Image { width, height: pixels.len() as u32 / width, pixels };
        let mut bytes = Vec::new();
        let mut y4m = Y4m::new(&mut bytes, [image.width, image.height], 25, chroma).expect("a Vec takes all");
        y4m.add(&image).expect("a Vec takes all");
        let frame = bytes.windows(6).position(|window| window == b"FRAME\n").expect("a frame");
        bytes.split_off(frame + 6)
    }

    #[test]
    fn colors_are_bt_709_in_limited_range() {
        let colors = [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let pixels = colors.map(|[r, g, b]| [r, g, b, 1.0]).to_vec();
        // The standard's table of 100 % colour bars.
        let luma = [16, 235, 63, 173, 32];
        let blue = [128, 128, 102, 42, 240];
        let red = [128, 128, 240, 26, 118];
        assert_eq!(planes(Chroma::Full, 5, pixels), [luma, blue, red].concat());
    }

    #[test]
    fn halved_chroma_is_the_mean_of_two_by_two() {
        let [black, red, white] = [[0.0; 3], [1.0, 0.0, 0.0], [1.0; 3]].map(|[r, g, b]| [r, g, b, 1.0]);
        let pixels = vec![red, red, white, black, red, red, black, red];
        let bytes = planes(Chroma::Halved, 4, pixels);
        assert_eq!(bytes, [63, 63, 235, 16, 63, 63, 16, 63, 102, 122, 240, 156]);
    }

    #[test]
    fn what_is_too_bright_is_white() {
        assert_eq!(planes(Chroma::Full, 1, vec![[1.5, 2.0, 1.01, 1.0]]), [235, 128, 128]);
    }
}
