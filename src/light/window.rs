//! Round footprints (SPEC §5) as products of three tables: Gaussians of the distances along both axes of the image; the share of the ray's Gaussian that lies
//! in the kernel's ball, by the place within a pixel; and the share of that in a slab, which is taken to be that along the kernel's central ray. Kernels for
//! whose rims this would be wrong are drawn otherwise.

use super::profile::nearest;
use crate::kernel::Kernel;

/// The intervals of tables by distance.
const INTERVALS: usize = 256;

/// The intervals of a slab in the table of sections.
const SECTIONS: usize = 256;

/// The places within a pixel along each axis for which there are shares.
const PLACES: usize = 32;

/// The least exponent at the radius of kernels that are drawn so: where the ray's chord is much shorter than through the middle, less than 2 % of the kernel
/// lies.
const LEAST_EXPONENT: f64 = 8.0;

/// A kernel's footprints in windows of W×W pixels, in slabs of one width.
#[derive(Clone, Debug)]
pub(super) struct Window<const W: usize> {
    /// By the distance of the first pixel's centre, less that of the nearest first pixel: the Gaussian at W pixels, and its slope per interval.
    across: Vec<[[f32; W]; 2]>,
    /// By the same distances downwards and then to the right, in [`PLACES`]: the share of the ray's Gaussian in the ball.
    shares: Vec<[[f32; W]; W]>,
    /// By a voxel's depth from that at which its kernel begins to reach a slab: the part of the kernel along its central ray that lies in the slab, and its
    /// slope per interval.
    sections: Vec<[f32; 2]>,
    /// A kernel's reach in slabs.
    reach: f32,
    /// Intervals of sections per slab.
    per_slab: f32,
}

impl<const W: usize> Window<W> {
    /// Whether windows hold a kernel's footprints, with a pixel for a grid unit.
    pub(super) fn suits(kernel: &Kernel) -> bool {
        let radius = kernel.radius();
        2.0 * radius <= W as f64 && kernel.falloff() * radius * radius >= LEAST_EXPONENT
    }

    /// The windows of a kernel in slabs of some width in grid units.
    pub(super) fn new(kernel: &Kernel, slab_width: f64) -> Self {
        let gauss = |length: f64| libm::exp(-kernel.falloff() * length * length);
        let slope = |length: f64| -2.0 * kernel.falloff() * length * gauss(length);
        // The first pixel's distance is between W/2 - 1 and W/2.
        let first = |at: usize, places: usize| W as f64 / 2.0 - 1.0 + at as f64 / places as f64;
        let across = |at: usize| {
            let length = |pixel: usize| pixel as f64 - first(at, INTERVALS);
            let per_interval = -1.0 / INTERVALS as f64;
            [
                std::array::from_fn(|pixel| gauss(length(pixel)) as f32),
                std::array::from_fn(|pixel| (slope(length(pixel)) * per_interval) as f32),
            ]
        };
        let whole = kernel.cumulative(0.0, kernel.radius());
        let share = |square: f64| (kernel.cumulative(0.0, kernel.half_chord(square)) / whole) as f32;
        let shares = |at: usize| {
            let [top, left] = [at / (PLACES + 1), at % (PLACES + 1)].map(|at| first(at, PLACES));
            let square = |row: usize, column: usize| (row as f64 - top).powi(2) + (column as f64 - left).powi(2);
            std::array::from_fn(|row| std::array::from_fn(|column| share(square(row, column))))
        };
        // Depths at which a slab from 0 to 1 is reached.
        let reach = kernel.radius() / slab_width;
        let intervals = (SECTIONS as f64 * (1.0 + 2.0 * reach)).ceil() as usize;
        let step = (1.0 + 2.0 * reach) / intervals as f64;
        let sections = |at: usize| {
            let depth = at as f64 * step - reach;
            let [near, far] = [-depth * slab_width, (1.0 - depth) * slab_width];
            let slope = (kernel.value(near.abs()) - kernel.value(far.abs())) * slab_width * step;
            [kernel.section(0.0, near, far) as f32, slope as f32]
        };
        Self {
            across: (0..=INTERVALS).map(across).collect(),
            shares: (0..(PLACES + 1) * (PLACES + 1)).map(shares).collect(),
            sections: (0..=intervals).map(sections).collect(),
            reach: reach as f32,
            per_slab: (1.0 / step) as f32,
        }
    }

    /// The first pixel along an axis of the window of a voxel at some place, and where it is in the table of Gaussians.
    #[inline(always)]
    pub(super) fn first(place: f32) -> (i32, f32) {
        let first = nearest(place - (W as f32 / 2.0 - 0.5));
        (first, (place - first as f32 - (W as f32 / 2.0 - 1.0)) * INTERVALS as f32)
    }

    /// The Gaussian at a window's pixels along an axis, and the place within the pixel.
    #[inline(always)]
    fn across(&self, at: f32) -> ([f32; W], usize) {
        let whole = nearest(at);
        let number = (whole.max(0) as usize).min(INTERVALS);
        let [mut gauss, slope] = self.across[number];
        let rest = at - whole as f32;
        gauss.iter_mut().zip(slope).for_each(|(gauss, slope)| *gauss += slope * rest);
        (gauss, (number * PLACES + INTERVALS / 2) / INTERVALS)
    }

    /// A voxel's footprint, less what its section in a slab takes of the ray, given its places across and downwards in the table of Gaussians.
    #[inline(always)]
    pub(super) fn footprint(&self, [right, down]: [f32; 2], amount: f32) -> [[f32; W]; W] {
        let (right, place_right) = self.across(right);
        let (down, place_down) = self.across(down);
        let mut footprint = self.shares[place_down * (PLACES + 1) + place_right];
        for (row, down) in footprint.iter_mut().zip(down) {
            let weight = amount * down;
            row.iter_mut().zip(right).for_each(|(share, right)| *share *= right * weight);
        }
        footprint
    }

    /// Where a voxel whose depth is given in slabs, from a slab's near plane on, is in the table of sections. The next slab's place is [`Self::slab`] less; a
    /// kernel has ended where places are not above 0.
    #[inline(always)]
    pub(super) fn depth(&self, depth: f32) -> f32 {
        (depth + self.reach) * self.per_slab
    }

    /// Intervals from slab to slab.
    #[inline(always)]
    pub(super) fn slab(&self) -> f32 {
        self.per_slab
    }

    /// The part of a kernel in a slab along its central ray, by its place above 0; `None` before the kernel begins to reach it.
    #[inline(always)]
    pub(super) fn section(&self, at: f32) -> Option<f32> {
        let whole = nearest(at);
        if at >= (self.sections.len() - 1) as f32 {
            return None;
        }
        let [section, slope] = self.sections[whole as usize];
        Some(section + slope * (at - whole as f32))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_hold_kernels() {
        const SLAB: f64 = 1.7;
        for (radius, falloff) in [(2.0, 2.0), (1.5, 5.0)] {
            let kernel = Kernel::new(radius, falloff);
            let window = Window::<4>::new(&kernel, SLAB);
            let peak = kernel.section(0.0, -radius, radius);
            let mut worst: f64 = 0.0;
            for place in [4.0, 4.13, 4.5, 4.501, 4.77] {
                for depth in [-0.8, -0.2, 0.0, 0.51, 1.3] {
                    let ((left, right), (top, down)) = (Window::<4>::first(place), Window::<4>::first(5.3));
                    let footprint = window.footprint([right, down], 1.0);
                    let at = window.depth(depth as f32);
                    let section = if at > 0.0 { window.section(at).unwrap_or(0.0) } else { 0.0 };
                    let mut sums = vec![0.0; 20 * 17];
                    for (row, y) in footprint.iter().zip(top + 4..) {
                        row.iter()
                            .zip(left + 4..)
                            .for_each(|(&pixel, x)| sums[(x + y * 20) as usize] = pixel * section);
                    }
                    for (at, &sum) in sums.iter().enumerate() {
                        let [column, row] = [at % 20, at / 20].map(|at| at as f64 - 4.0);
                        let square = (column - f64::from(place)).powi(2) + (row - 5.3).powi(2);
                        let exact = kernel.section(square, -depth * SLAB, (1.0 - depth) * SLAB);
                        worst = worst.max((f64::from(sum) - exact).abs() / peak);
                    }
                }
            }
            assert!(worst < 2e-4, "{radius} {falloff}: {worst:e}");
        }
    }
}
