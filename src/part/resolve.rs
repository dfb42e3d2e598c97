//! The compositing buffer over the background (SPEC §5), as in `shaders/resolve.wgsl`.

use crate::scene::image_settings::premultiplied;
use crate::settings::closing::Closing;
use crate::settings::splatting::{Classification, Compositing, Splatting};

/// Turns pixels of compositing buffers into pixels of images.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Resolver {
    compositing: Compositing,
    closing: Option<Closing>,
    /// Premultiplied.
    background: [f32; 4],
}

impl Resolver {
    /// The background has straight alpha.
    pub(crate) fn new(splatting: &Splatting, classification: Classification, background: [f64; 4]) -> Self {
        let compositing = splatting.compositing.finished_as(classification);
        let closing = Closing::of(splatting);
        Self { compositing, closing, background: premultiplied(background) }
    }

    /// A pixel over the background, premultiplied like its argument.
    pub(crate) fn pixel(&self, acc: [f32; 4]) -> [f32; 4] {
        let image = match self.compositing {
            Compositing::Xray | Compositing::Average => acc.map(|channel| channel.min(1.0)),
            Compositing::Minimum if acc[3] > 0.0 => [acc[0], acc[1], acc[2], 2.0 - acc[3]],
            Compositing::Surface if acc[3] < 1.0 => [0.0; 4],
            _ => self.closing.map_or(acc, |closing| closing.pixel(acc)),
        };
        std::array::from_fn(|channel| image[channel] + (1.0 - image[3]) * self.background[channel])
    }
}
