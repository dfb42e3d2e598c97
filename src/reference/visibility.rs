//! Early splat elimination by the paper's tests (§6), sheet by sheet, with which the GPU's culling is compared.

use glam::{DMat2, DVec2};

use super::cut::Cuts;
use super::{Buffer, Section};
use crate::lists::quad_plan::TILE;

/// The test by which a voxel is culled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Test {
    /// The pixel that contains its centre is opaque (Fig. 11a). This loses voxels that are partly visible.
    Center,
    /// All pixels of its footprint's box are opaque (Fig. 10). This is exact.
    Box,
    /// All pixels of the parallelogram around its footprint are opaque (Fig. 13). This is exact and never tests more pixels than the box; for
    /// spacing 1:1:1 it tests the same pixels.
    Parallelogram,
}

/// A mask of opaque pixels as a summed-area table. Pixels off the image are opaque.
#[derive(Clone, Debug)]
pub struct OpaqueMask {
    size: [usize; 2],
    /// `sums[y][x]`: the number of transparent pixels above row y and left of column x.
    sums: Vec<u32>,
}

impl OpaqueMask {
    /// The mask of a compositing buffer: pixels with alpha at least `threshold`, or in which everything from this sheet on is hidden.
    pub fn new(acc: &Buffer, threshold: f64, cuts: Option<(&Cuts, i32)>) -> Self {
        let is_cut = |pixel: usize| cuts.is_some_and(|(cuts, sheet)| cuts.ends_before(pixel, sheet));
        let size = [acc.width, acc.pixels.len() / acc.width];
        let stride = size[0] + 1;
        let mut sums = vec![0; stride * (size[1] + 1)];
        for y in 0..size[1] {
            let mut row = 0;
            for x in 0..size[0] {
                let pixel = y * size[0] + x;
                row += u32::from(acc.pixels[pixel].w < threshold && !is_cut(pixel));
                sums[(y + 1) * stride + x + 1] = sums[y * stride + x + 1] + row;
            }
        }
        Self { size, sums }
    }

    /// Whether every pixel with its centre in the box is opaque.
    pub fn covers(&self, center: DVec2, half_box: DVec2) -> bool {
        let clamp = |at: f64, axis: usize| at.clamp(0.0, self.size[axis] as f64) as usize;
        let low = (center - half_box - 0.5).ceil();
        let end = (center + half_box - 0.5).floor() + 1.0;
        let (x0, y0, x1, y1) = (clamp(low.x, 0), clamp(low.y, 1), clamp(end.x, 0), clamp(end.y, 1));
        let sum = |x: usize, y: usize| self.sums[y * (self.size[0] + 1) + x];
        x0 >= x1 || y0 >= y1 || sum(x1, y1) + sum(x0, y0) == sum(x0, y1) + sum(x1, y0)
    }

    /// Whether every pixel is opaque whose centre lies in the parallelogram that `sheared` maps to a square with this half side.
    pub fn covers_parallelogram(&self, center: DVec2, sheared: DMat2, half_side: f64) -> bool {
        // Row by row, between the slanted sides. `sheared` maps rows to its first axis.
        let half_height = half_side / sheared.y_axis.y.abs();
        let rows = (center.y - half_height - 0.5).ceil() as i64..=(center.y + half_height - 0.5).floor() as i64;
        rows.into_iter().all(|y| {
            let middle = center.x - (y as f64 + 0.5 - center.y) * sheared.y_axis.x / sheared.x_axis.x;
            self.covers(DVec2::new(middle, y as f64 + 0.5), DVec2::new(half_side / sheared.x_axis.x, 0.25))
        })
    }

    /// The sections of a sheet that pass a test. In perspective every section is tested with its own box, which a box per slab must contain.
    pub fn visible(&self, sections: &[Section], test: Test, support: f64) -> Vec<Section> {
        let is_hidden = |section: &Section| match test {
            // The single pixel that contains the centre.
            Test::Center => self.covers(section.center.floor() + 0.5, DVec2::splat(0.5)),
            Test::Box => self.covers(section.center, section.footprint.half_box(support)),
            Test::Parallelogram => {
                self.covers_parallelogram(section.center, section.footprint.sheared_from_pixels(), support)
            }
        };
        sections.iter().filter(|section| !is_hidden(section)).copied().collect()
    }
}

/// The pixels that are composited and convolved by the paper's different bounds (§6), summed over the sheets.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Areas {
    /// The bounding box of the voxels' centres, enlarged by the reach of the largest footprint.
    pub bounding_box: u64,
    /// The tiles that footprints' boxes overlap.
    pub tiles: u64,
    /// The overlapped tiles that have received at least as many splats as a tile needs to become opaque: the counters' threshold, below which
    /// no convolution is needed.
    pub counted_tiles: u64,
    /// The number of splats in every tile so far.
    counters: Vec<u32>,
    /// The maximum number of pixels in a footprint's box so far.
    largest_box: f64,
}

impl Areas {
    /// Adds those of another image.
    pub(super) fn join(&mut self, other: &Self) {
        self.bounding_box += other.bounding_box;
        self.tiles += other.tiles;
        self.counted_tiles += other.counted_tiles;
    }

    /// Adds the areas of a sheet with these sections, in an image of this size.
    pub fn add(&mut self, sections: &[Section], size: DVec2, support: f64) {
        let tile = f64::from(TILE);
        let columns = (size.x / tile).ceil() as usize;
        self.counters.resize(columns * (size.y / tile).ceil() as usize, 0);
        let half_box = |section: &Section| section.footprint.half_box(support);
        let largest = sections.iter().map(half_box).reduce(DVec2::max).unwrap_or(DVec2::ZERO);
        // The pixels whose centres lie between two points, as first and end.
        let pixels = |low: DVec2, high: DVec2| {
            let first = (low - 0.5).ceil().clamp(DVec2::ZERO, size);
            (first, ((high - 0.5).floor() + 1.0).clamp(first, size))
        };
        let centers = sections.iter().map(|section| (section.center, section.center));
        if let Some((low, high)) = centers.reduce(|(low, high), (at, _)| (low.min(at), high.max(at))) {
            let (first, end) = pixels(low - largest, high + largest);
            self.bounding_box += (end - first).element_product() as u64;
        }
        let mut touched = vec![false; self.counters.len()];
        for section in sections {
            let (first, end) = pixels(section.center - half_box(section), section.center + half_box(section));
            if (end - first).min_element() < 1.0 {
                continue;
            }
            let (first, last) = ((first / tile).floor(), ((end - 1.0) / tile).floor());
            for y in first.y as usize..=last.y as usize {
                for x in first.x as usize..=last.x as usize {
                    touched[y * columns + x] = true;
                    self.counters[y * columns + x] += 1;
                }
            }
        }
        // A splat cannot make more pixels opaque than its box contains.
        self.largest_box = self.largest_box.max((2.0 * largest.x + 1.0) * (2.0 * largest.y + 1.0));
        let least = (tile * tile / self.largest_box).ceil();
        for (at, _) in touched.iter().enumerate().filter(|(_, touched)| **touched) {
            let corner = DVec2::new((at % columns) as f64, (at / columns) as f64) * tile;
            let area = (corner + tile).min(size) - corner;
            self.tiles += area.element_product() as u64;
            if f64::from(self.counters[at]) >= least {
                self.counted_tiles += area.element_product() as u64;
            }
        }
    }
}
