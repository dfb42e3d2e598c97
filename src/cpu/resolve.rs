//! Compositing over the background (SPEC §5), as in `shaders/resolve.wgsl`.

use super::sheets::{Buffers, COLUMNS};
use crate::settings::splatting::Compositing;

/// Turns compositing buffers into images.
#[derive(Clone, Copy, Debug)]
pub(super) struct Resolver {
    compositing: Compositing,
    /// Premultiplied.
    background: [f32; 4],
}

impl Resolver {
    /// The background has straight alpha.
    pub(super) fn new(compositing: Compositing, background: [f64; 4]) -> Self {
        let [r, g, b, a] = background;
        Self { compositing, background: [r * a, g * a, b * a, a].map(|channel| channel as f32) }
    }

    /// The pixels of a tile, row by row.
    pub(super) fn tile(&self, buffers: &Buffers) -> Vec<[f32; 4]> {
        let pixel = |row: &[[f32; COLUMNS]; 4], x: usize| self.pixel([row[0][x], row[1][x], row[2][x], row[3][x]]);
        buffers.acc.iter().flat_map(|row| (0..COLUMNS).map(move |x| pixel(row, x))).collect()
    }

    /// A pixel over the background, premultiplied like its argument.
    pub(super) fn pixel(&self, acc: [f32; 4]) -> [f32; 4] {
        let image = match self.compositing {
            Compositing::Xray | Compositing::Average => acc.map(|channel| channel.min(1.0)),
            Compositing::Minimum if acc[3] > 0.0 => [acc[0], acc[1], acc[2], 2.0 - acc[3]],
            Compositing::Surface if acc[3] < 1.0 => [0.0; 4],
            _ => acc,
        };
        std::array::from_fn(|channel| image[channel] + (1.0 - image[3]) * self.background[channel])
    }
}
