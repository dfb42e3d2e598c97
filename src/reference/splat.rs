//! Buckets and sheet buffers, SPEC §5; the twin of `bucket.rs` and `shaders/splat.wgsl`.

use std::collections::BTreeMap;

use glam::{DVec2, DVec4};
use rayon::prelude::*;

use super::{Buffer, Geometry, Splat};
use crate::kernel::Kernel;

/// The bucket of every slab that a kernel touches, front to back.
pub fn buckets(splats: &[Splat], geometry: &Geometry, kernel: &Kernel) -> BTreeMap<i32, Vec<Splat>> {
    let mut buckets = BTreeMap::<i32, Vec<Splat>>::new();
    for splat in splats {
        let mut k = ((splat.depth - kernel.radius()) / geometry.slab_width).floor() as i32;
        while f64::from(k) * geometry.slab_width < splat.depth + kernel.radius() {
            buckets.entry(k).or_default().push(*splat);
            k += 1;
        }
    }
    buckets
}

/// The sheet buffer of slab `k`: every pixel centre within every footprint, closed form.
pub fn sheet(bucket: &[Splat], k: i32, geometry: &Geometry, kernel: &Kernel) -> Buffer {
    const ROWS: usize = 16;
    let (width, height) = (geometry.size.x as usize, geometry.size.y as usize);
    let mut sheet = Buffer::new(width as u32, height as u32);
    let half_box = geometry.half_box(kernel.radius());

    sheet.pixels.par_chunks_mut(width * ROWS).enumerate().for_each(|(band, pixels)| {
        let first_row = (band * ROWS) as f64;
        let end_row = (first_row + ROWS as f64).min(height as f64);
        for splat in bucket {
            let t0 = f64::from(k) * geometry.slab_width - splat.depth;
            // Pixel centres are at half-integers.
            let low = (splat.center - half_box - 0.5).ceil().max(DVec2::new(0.0, first_row));
            let high = (splat.center + half_box - 0.5).floor().min(DVec2::new(width as f64, end_row) - 1.0);
            for y in low.y as i64..=high.y as i64 {
                for x in low.x as i64..=high.x as i64 {
                    let offset = DVec2::new(x as f64, y as f64) + 0.5 - splat.center;
                    let footprint = geometry.footprint_from_pixels * offset;
                    let section = kernel.section(footprint.length_squared(), t0, t0 + geometry.slab_width);
                    pixels[(y as usize - band * ROWS) * width + x as usize] += splat.amount * section;
                }
            }
        }
    });
    sheet
}

/// The sum over a sheet buffer's pixels.
pub fn total(sheet: &Buffer) -> DVec4 {
    sheet.pixels.iter().sum()
}
