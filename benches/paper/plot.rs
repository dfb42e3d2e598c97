//! Curves over angles as small pictures without text; captions describe the axes.

use image::{Rgb, RgbImage};

const SIZE: [u32; 2] = [480, 240];
const MARGIN: u32 = 12;
const BLACK: Rgb<u8> = Rgb([0, 0, 0]);
const GREY: Rgb<u8> = Rgb([220, 220, 220]);
/// The colours of the first and the second curve.
pub(crate) const COLORS: [Rgb<u8>; 2] = [Rgb([0, 90, 200]), Rgb([220, 60, 0])];

/// Two curves over a turn from 0° to 90°, with values from 0 at the bottom to `top`, and grid lines every 15° and at quarters of `top`.
pub(crate) fn curves(curves: [&[f64]; 2], top: f64) -> RgbImage {
    let mut picture = RgbImage::from_pixel(SIZE[0], SIZE[1], Rgb([255, 255, 255]));
    let [width, height] = SIZE.map(|side| f64::from(side - 2 * MARGIN));
    let place = |x: f64, y: f64| [f64::from(MARGIN) + x * width, f64::from(SIZE[1] - MARGIN) - y * height];
    for (color, lines) in [(GREY, [1..6, 1..5]), (BLACK, [0..1, 0..1])] {
        let [upright, level] = lines;
        upright
            .for_each(|i| line(&mut picture, [place(f64::from(i) / 6.0, 0.0), place(f64::from(i) / 6.0, 1.0)], color));
        level.for_each(|i| line(&mut picture, [place(0.0, f64::from(i) / 4.0), place(1.0, f64::from(i) / 4.0)], color));
    }
    for (curve, color) in curves.into_iter().zip(COLORS) {
        let point = |at: usize| place(at as f64 / (curve.len() - 1) as f64, curve[at] / top);
        (1..curve.len()).for_each(|at| line(&mut picture, [point(at - 1), point(at)], color));
    }
    picture
}

/// Draws a line that is two pixels wide.
fn line(picture: &mut RgbImage, [from, to]: [[f64; 2]; 2], color: Rgb<u8>) {
    let steps = (0..2).map(|i| (to[i] - from[i]).abs()).fold(1.0, f64::max).ceil();
    for step in 0..=steps as u32 {
        let [x, y] = [0, 1].map(|i| (from[i] + (to[i] - from[i]) * f64::from(step) / steps).round() as u32);
        for (x, y) in [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)] {
            if x < SIZE[0] && y < SIZE[1] {
                picture.put_pixel(x, y, color);
            }
        }
    }
}
