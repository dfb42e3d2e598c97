//! Compositing of one sheet (eq. 2, SPEC §5): the f64 evaluation of `shaders/composite.wgsl`.

use glam::DVec4;

use super::Buffer;
use crate::settings::splatting::{Compositing, Order};

/// Composites a sheet buffer into the compositing buffer.
pub fn composite(acc: &mut Buffer, sheet: &Buffer, compositing: Compositing, order: Order) {
    for (acc, &sheet) in acc.pixels.iter_mut().zip(&sheet.pixels) {
        composite_pixel(acc, sheet, compositing, order);
    }
}

/// Composites one sheet's content, or a single voxel's, at a pixel; for compositing by means, the sheet's mean.
///
/// For `Minimum` the compositing buffer stores 2 minus the opacity, and 0 while nothing has counted; for `Surface` it stores the mean of the
/// last sheet while that is below one half.
pub fn composite_pixel(acc: &mut DVec4, sheet: DVec4, compositing: Compositing, order: Order) {
    let scale = match compositing {
        Compositing::Linear => 1.0 / sheet.w.max(1.0),
        Compositing::Exponential if sheet.w > 0.0 => -(-sheet.w).exp_m1() / sheet.w,
        _ => 1.0,
    };
    let sheet = sheet * scale;
    // The nearer of equal ones is kept: after scaling, all above 1 are equal to the last bit.
    let kept = |acc: DVec4, color: DVec4, opacity: f64| {
        let passes = opacity > acc.w || opacity == acc.w && order == Order::BackToFront;
        if passes { (color / color.w.max(1.0)).truncate().extend(opacity) } else { acc }
    };
    *acc = match (compositing, order) {
        (Compositing::Xray | Compositing::Average, _) => *acc + sheet,
        (Compositing::Maximum, _) => kept(*acc, sheet, sheet.w.min(1.0)),
        (Compositing::Minimum, _) => kept(*acc, sheet, 2.0 - sheet.w.min(1.0)),
        (Compositing::Surface, _) if acc.w >= 1.0 => *acc,
        (Compositing::Surface, _) if sheet.w < 0.5 => sheet,
        (Compositing::Surface, _) => {
            let there = acc.lerp(sheet, crossing(*acc, sheet));
            (there.truncate() / there.w).extend(1.0)
        }
        (_, Order::FrontToBack) => *acc + (1.0 - acc.w) * sheet,
        (_, Order::BackToFront) => sheet + (1.0 - sheet.w) * *acc,
    };
}

/// The position between the middles of a slab and the next one where the opacity, interpolated linearly, is one half.
pub fn crossing(before: DVec4, mean: DVec4) -> f64 {
    (0.5 - before.w) / (mean.w - before.w)
}
