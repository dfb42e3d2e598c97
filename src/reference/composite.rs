//! Compositing of one sheet, eq. 2 and SPEC §5; the twin of `shaders/composite.wgsl`.

use glam::DVec4;

use super::Buffer;
use crate::splatting::{Compositing, Order};

/// Composites a sheet buffer into the compositing buffer.
pub fn composite(acc: &mut Buffer, sheet: &Buffer, compositing: Compositing, order: Order) {
    for (acc, &sheet) in acc.pixels.iter_mut().zip(&sheet.pixels) {
        composite_pixel(acc, sheet, compositing, order);
    }
}

/// Composites what one sheet, or one voxel alone, has at a pixel; for compositing by means its mean.
///
/// For `Minimum` the compositing buffer keeps 2 less the opacity, and 0 where nothing counted; for `Surface` the mean of the last sheet
/// while that is below one half.
pub fn composite_pixel(acc: &mut DVec4, sheet: DVec4, compositing: Compositing, order: Order) {
    let scale = match compositing {
        Compositing::Linear => 1.0 / sheet.w.max(1.0),
        Compositing::Exponential if sheet.w > 0.0 => -(-sheet.w).exp_m1() / sheet.w,
        Compositing::Maximum | Compositing::Minimum => 1.0 / sheet.w.max(1.0),
        _ => 1.0,
    };
    let sheet = sheet * scale;
    // Of equal ones the nearer.
    let passes = |a: f64, b: f64| a > b || a == b && order == Order::BackToFront;
    *acc = match (compositing, order) {
        (Compositing::Xray | Compositing::Average, _) => *acc + sheet,
        (Compositing::Maximum, _) => {
            if passes(sheet.w, acc.w) {
                sheet
            } else {
                *acc
            }
        }
        (Compositing::Minimum, _) if passes(2.0 - sheet.w, acc.w) => sheet.truncate().extend(2.0 - sheet.w),
        (Compositing::Minimum, _) => *acc,
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

/// Where between the middles of a slab and of the next one their means' opacity is one half, if it grows evenly.
pub fn crossing(before: DVec4, mean: DVec4) -> f64 {
    (0.5 - before.w) / (mean.w - before.w)
}
