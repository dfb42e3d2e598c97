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

/// Composites what one sheet, or one voxel alone, has at a pixel.
pub fn composite_pixel(acc: &mut DVec4, sheet: DVec4, compositing: Compositing, order: Order) {
    let scale = match compositing {
        Compositing::Linear => 1.0 / sheet.w.max(1.0),
        Compositing::Exponential if sheet.w > 0.0 => -(-sheet.w).exp_m1() / sheet.w,
        Compositing::Exponential | Compositing::Xray => 1.0,
    };
    let sheet = sheet * scale;
    *acc = match (compositing, order) {
        (Compositing::Xray, _) => *acc + sheet,
        (_, Order::FrontToBack) => *acc + (1.0 - acc.w) * sheet,
        (_, Order::BackToFront) => sheet + (1.0 - sheet.w) * *acc,
    };
}
