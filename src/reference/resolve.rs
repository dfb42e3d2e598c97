//! The compositing buffer over the background (SPEC §5): the f64 evaluation of `shaders/resolve.wgsl`.

use glam::{DVec3, DVec4};

use super::Buffer;
use crate::settings::splatting::{Compositing, Splatting};

/// Composites premultiplied pixels, which are finished by some compositing and settings, over a background with straight alpha.
pub fn resolve(acc: &Buffer, (compositing, splatting): (Compositing, &Splatting), background: [f64; 4]) -> Buffer {
    let [r, g, b, a] = background;
    let background = (DVec3::new(r, g, b) * a).extend(a);
    let over = |acc: &DVec4| {
        let image = match compositing {
            Compositing::Xray | Compositing::Average => acc.min(DVec4::ONE),
            Compositing::Minimum if acc.w > 0.0 => acc.truncate().extend(2.0 - acc.w),
            Compositing::Surface if acc.w < 1.0 => DVec4::ZERO,
            _ => closed(*acc, splatting),
        };
        image + (1.0 - image.w) * background
    };
    Buffer { width: acc.width, pixels: acc.pixels.iter().map(over).collect() }
}

/// A pixel whose culling may have stopped it (SPEC §6, closing).
fn closed(acc: DVec4, splatting: &Splatting) -> DVec4 {
    let Splatting { compositing, culling, opacity_threshold: threshold, .. } = *splatting;
    if !compositing.is_by_opacity() || !culling || threshold == 1.0 || acc.w <= 0.0 {
        return acc;
    }
    let least = (2.0 * threshold - 1.0).max(0.0);
    let x = ((acc.w - least) / (threshold - least)).clamp(0.0, 1.0);
    let alpha = acc.w + (1.0 - acc.w) * x * x;
    (acc.truncate() * alpha / acc.w).extend(alpha)
}
