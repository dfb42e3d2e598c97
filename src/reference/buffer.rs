//! Images in f64.

use glam::DVec4;

use crate::image::Image;

/// An f64 image of premultiplied RGBA, with row 0 at the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Buffer {
    /// Pixels per row.
    pub width: usize,
    /// The pixels, row by row.
    pub pixels: Vec<DVec4>,
}

impl Buffer {
    /// A buffer of zeros.
    pub fn new(width: u32, height: u32) -> Self {
        Self { width: width as usize, pixels: vec![DVec4::ZERO; width as usize * height as usize] }
    }

    /// Converts the buffer to an f32 image.
    pub fn into_image(self) -> Image {
        Image {
            width: self.width as u32,
            height: (self.pixels.len() / self.width) as u32,
            pixels: self.pixels.iter().map(|pixel| pixel.as_vec4().to_array()).collect(),
        }
    }
}
