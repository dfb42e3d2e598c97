//! Sheet buffers (SPEC §5): the f64 evaluation of `shaders/splat.wgsl`.

use glam::{DVec2, DVec4};

use super::{Buffer, Geometry, Section, Splat};
use crate::kernel::Kernel;
use crate::parallel::prelude::*;

/// The sheet buffer of sheet `k`: every footprint at every pixel centre in it, in closed form.
pub fn sheet(splats: &[Splat], k: i32, geometry: &Geometry, kernel: &Kernel) -> Buffer {
    let sections: Vec<Section> = splats.iter().filter_map(|splat| geometry.section(splat, k, kernel)).collect();
    let mut sheet = Buffer::new(geometry.size.x as u32, geometry.size.y as u32);
    draw(&sections, kernel, &mut sheet, |pixel, amount| *pixel += amount);
    sheet
}

/// Calls `blend` with the amount of every section at every pixel, section by section.
pub fn draw(sections: &[Section], kernel: &Kernel, buffer: &mut Buffer, blend: impl Fn(&mut DVec4, DVec4) + Sync) {
    const ROWS: usize = 16;
    let width = buffer.width;
    let last = DVec2::new(width as f64, (buffer.pixels.len() / width) as f64) - 1.0;
    // The sections that reach into each band of rows.
    let mut bands = vec![Vec::new(); buffer.pixels.len().div_ceil(width * ROWS)];
    for (section, index) in sections.iter().zip(0_u32..) {
        let (low, high) = section.pixels(kernel.radius());
        let (low, high) = (low.max(DVec2::ZERO), high.min(last));
        if low.cmple(high).all() {
            (low.y as usize / ROWS..=high.y as usize / ROWS).for_each(|band| bands[band].push(index));
        }
    }
    buffer.pixels.par_chunks_mut(width * ROWS).zip(&bands).enumerate().for_each(|(band, (pixels, indices))| {
        let first_row = band * ROWS;
        let last_row = first_row + pixels.len() / width - 1;
        for section in indices.iter().map(|&index| &sections[index as usize]) {
            let (low, high) = section.pixels(kernel.radius());
            let (low_x, high_x) = (low.x.max(0.0) as usize, high.x.min(last.x) as usize);
            let (low_y, high_y) = (first_row.max(low.y.max(0.0) as usize), last_row.min(high.y.min(last.y) as usize));
            for (y, x) in (low_y..=high_y).flat_map(|y| (low_x..=high_x).map(move |x| (y, x))) {
                let offset = DVec2::new(x as f64, y as f64) + 0.5 - section.center;
                let rho_squared = (section.footprint.from_pixels * offset).length_squared();
                if rho_squared >= section.rim {
                    continue;
                }
                let amount = kernel.section(rho_squared, section.t0, section.t1);
                blend(&mut pixels[(y - first_row) * width + x], section.amount * amount);
            }
        }
    });
}

/// The sum over a sheet buffer's pixels.
pub fn total(sheet: &Buffer) -> DVec4 {
    sheet.pixels.iter().sum()
}
