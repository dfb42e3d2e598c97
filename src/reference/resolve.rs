//! The compositing buffer over the background (SPEC §5): the f64 evaluation of `shaders/resolve.wgsl`.

use glam::{DVec3, DVec4};

use super::Buffer;
use crate::settings::splatting::Compositing;

/// Composites premultiplied pixels over a background with straight alpha.
pub fn resolve(acc: &Buffer, compositing: Compositing, background: [f64; 4]) -> Buffer {
    let [r, g, b, a] = background;
    let background = (DVec3::new(r, g, b) * a).extend(a);
    let over = |acc: &DVec4| {
        let image = match compositing {
            Compositing::Xray | Compositing::Average => acc.min(DVec4::ONE),
            Compositing::Minimum if acc.w > 0.0 => acc.truncate().extend(2.0 - acc.w),
            Compositing::Surface if acc.w < 1.0 => DVec4::ZERO,
            _ => *acc,
        };
        image + (1.0 - image.w) * background
    };
    Buffer { width: acc.width, pixels: acc.pixels.iter().map(over).collect() }
}
