//! Early splat elimination as the paper's simpler tests put it (§6), sheet by sheet: what the GPU's culling is held against.

use glam::DVec2;

use super::{Buffer, Geometry, Splat};

/// When a voxel is culled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Test {
    /// When the pixel that its centre falls on is opaque (Fig. 11a). Loses voxels that are partly visible.
    Center,
    /// When all pixels of its footprint's box are opaque (Fig. 10). Exact.
    Box,
}

/// Which pixels are opaque, as sums over rectangles (a summed-area table of the mask). Pixels off the image are opaque.
#[derive(Clone, Debug)]
pub struct OpaqueMask {
    size: [usize; 2],
    /// `sums[y][x]`: transparent pixels above row y and left of column x.
    sums: Vec<u32>,
}

impl OpaqueMask {
    /// The mask of a compositing buffer: alpha at least `threshold`.
    pub fn new(acc: &Buffer, threshold: f64) -> Self {
        let size = [acc.width, acc.pixels.len() / acc.width];
        let stride = size[0] + 1;
        let mut sums = vec![0; stride * (size[1] + 1)];
        for y in 0..size[1] {
            let mut row = 0;
            for x in 0..size[0] {
                row += u32::from(acc.pixels[y * size[0] + x].w < threshold);
                sums[(y + 1) * stride + x + 1] = sums[y * stride + x + 1] + row;
            }
        }
        Self { size, sums }
    }

    /// Whether every pixel whose centre lies in the box is opaque.
    pub fn covers(&self, center: DVec2, half_box: DVec2) -> bool {
        let clamp = |at: f64, axis: usize| at.clamp(0.0, self.size[axis] as f64) as usize;
        let low = (center - half_box - 0.5).ceil();
        let end = (center + half_box - 0.5).floor() + 1.0;
        let (x0, y0, x1, y1) = (clamp(low.x, 0), clamp(low.y, 1), clamp(end.x, 0), clamp(end.y, 1));
        let sum = |x: usize, y: usize| self.sums[y * (self.size[0] + 1) + x];
        x0 >= x1 || y0 >= y1 || sum(x1, y1) + sum(x0, y0) == sum(x0, y1) + sum(x1, y0)
    }

    /// The splats of a bucket that pass a test.
    pub fn visible(&self, bucket: &[Splat], test: Test, geometry: &Geometry, support: f64) -> Vec<Splat> {
        let half_box = match test {
            // The one pixel that the centre falls on.
            Test::Center => DVec2::splat(0.5),
            Test::Box => geometry.half_box(support),
        };
        let center = |splat: &Splat| match test {
            Test::Center => splat.center.floor() + 0.5,
            Test::Box => splat.center,
        };
        bucket.iter().filter(|splat| !self.covers(center(splat), half_box)).copied().collect()
    }
}
