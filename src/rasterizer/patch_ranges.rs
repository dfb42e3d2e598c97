//! The patches that the tile rasterizer draws, band by band of the compositing buffer.

use std::ops::Range;

use wgpu::Limits;

use super::request::FrameRequest;
use crate::gpu::layout::PatchRange;
use crate::lists::patch_bins;
use crate::settings::window::Region;

/// A dispatch of the patches of a band.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Dispatch {
    /// The band's index.
    pub(super) band: usize,
    /// The offset of its patches among the uniforms.
    pub(super) offset: u32,
    /// The number of its patches.
    pub(super) patches: u32,
}

/// The patches of every band that a window has pixels of, as uniforms, and their dispatches.
pub(super) fn patch_ranges(limits: &Limits, request: &FrameRequest) -> (Vec<u8>, Vec<Dispatch>) {
    let stride = range_stride(limits);
    let (mut bytes, mut dispatches) = (Vec::new(), Vec::new());
    let [columns, _] = patch_bins::grid(request.view.size);
    for (band, of) in request.bands.iter().enumerate() {
        let rows = patch_rows(&(of.first_row..of.first_row + of.rows), &request.window.region);
        if rows.is_empty() {
            continue;
        }
        let [first_patch, end_patch] = [rows.start, rows.end].map(|row| row * columns);
        let row_step = step_around(rows.end - rows.start);
        let range = PatchRange { first_row: of.first_row, first_patch, end_patch, row_step };
        dispatches.push(Dispatch { band, offset: bytes.len() as u32, patches: end_patch - first_patch });
        bytes.extend_from_slice(bytemuck::bytes_of(&range));
        bytes.resize(bytes.len().next_multiple_of(stride), 0);
    }
    (bytes, dispatches)
}

/// The stride between bands' patches in bytes.
pub(super) fn range_stride(limits: &Limits) -> usize {
    size_of::<PatchRange>().next_multiple_of(limits.min_uniform_buffer_offset_alignment as usize)
}

/// The rows of patches of a band of rows of pixels, whose first begins a patch, that have pixels of a region.
fn patch_rows(band: &Range<u32>, region: &Region) -> Range<u32> {
    let height = patch_bins::PATCH[1];
    let (first, end) = (band.start.max(region.y), band.end.min(region.y + region.height));
    first / height..end.div_ceil(height)
}

/// The first step, from the golden section of a number of rows on, that comes to all of them before it comes to one again: rows that any number of steps in
/// succession comes to are spread over all.
fn step_around(rows: u32) -> u32 {
    let golden = rows * 89 / 144;
    (golden.max(1)..=rows).find(|&step| common_factor(step, rows) == 1).unwrap_or(1)
}

fn common_factor(a: u32, b: u32) -> u32 {
    if b == 0 { a } else { common_factor(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_come_to_every_row_and_halves_are_spread() {
        for rows in 1..1000 {
            let step = step_around(rows);
            let order: Vec<u32> = (0..rows).map(|at| at * step % rows).collect();
            let mut sorted = order.clone();
            sorted.sort_unstable();
            assert!(sorted.into_iter().eq(0..rows), "{rows} rows by {step}");
            let upper = order[..rows as usize / 2].iter().filter(|&&row| row < rows / 2).count() as u32;
            assert!(rows < 8 || upper.abs_diff(rows / 4) <= 1 + rows / 16, "{rows} rows by {step}: {upper}");
        }
    }

    #[test]
    fn rows_are_those_with_pixels_of_the_region() {
        let region = |y, height| Region { x: 3, y, width: 7, height };
        let height = patch_bins::PATCH[1];
        let band = 4 * height..12 * height;
        for y in 0..16 * height {
            for end in y + 1..16 * height {
                let has_pixels = |row: &u32| (row * height..(row + 1) * height).any(|pixel| (y..end).contains(&pixel));
                let expected: Vec<u32> = (4..12).filter(has_pixels).collect();
                assert!(patch_rows(&band, &region(y, end - y)).eq(expected), "{y}..{end}");
            }
        }
    }
}
