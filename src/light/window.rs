//! Round footprints (SPEC §5) as products of three tables: Gaussians of the distances along both axes of the image; the share of the ray's Gaussian that lies
//! in the kernel's ball, by the place within a pixel; and the share of that in a slab, which is taken to be that along the kernel's central ray. Kernels for
//! whose rims this would be wrong are drawn otherwise.

use super::profile::{least, nearest};
use super::section::Section;
use crate::kernel::Kernel;

/// The intervals of tables by distance.
const INTERVALS: usize = 256;

/// The places within a pixel along each axis for which there are shares.
const PLACES: usize = 32;

/// The least exponent at the radius of kernels that are drawn so: where the ray's chord is much shorter than through the middle, less than 2 % of the kernel
/// lies.
const LEAST_EXPONENT: f64 = 8.0;

/// A kernel's footprints in windows of W×W pixels.
#[derive(Clone, Debug)]
pub(super) struct Window<const W: usize> {
    /// By the distance of the first pixel's centre, less that of the nearest first pixel: the Gaussian at W pixels, and its slope per interval.
    across: Vec<[[f32; W]; 2]>,
    /// By the same distances downwards and then to the right, in [`PLACES`]: the share of the ray's Gaussian in the ball.
    shares: Vec<[[f32; W]; W]>,
    /// By t from 0 to the radius: the integral of the kernel along its central ray, and its slope per interval.
    along: Vec<[f32; 2]>,
    /// Intervals per grid unit of t.
    per_length: f32,
}

impl<const W: usize> Window<W> {
    /// Whether windows hold a kernel's footprints, with a pixel for a grid unit.
    pub(super) fn suits(kernel: &Kernel) -> bool {
        let radius = kernel.radius();
        2.0 * radius <= W as f64 && kernel.falloff() * radius * radius >= LEAST_EXPONENT
    }

    pub(super) fn new(kernel: &Kernel) -> Self {
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
        let step = kernel.radius() / INTERVALS as f64;
        let along = |at: usize| {
            let t = at as f64 * step;
            [kernel.cumulative(0.0, t), kernel.value(t) * step].map(|number| number as f32)
        };
        Self {
            across: (0..=INTERVALS).map(across).collect(),
            shares: (0..(PLACES + 1) * (PLACES + 1)).map(shares).collect(),
            along: (0..=INTERVALS).map(along).collect(),
            per_length: (INTERVALS as f64 / kernel.radius()) as f32,
        }
    }

    /// The integral from 0 to t.
    #[inline(always)]
    fn along(&self, t: f32) -> f32 {
        let at = least(t.abs() * self.per_length, INTERVALS as f32);
        let whole = nearest(at);
        let [integral, slope] = self.along[(whole as usize).min(INTERVALS)];
        (integral + slope * (at - whole as f32)).copysign(t)
    }

    /// The first pixel of a window around a place, the Gaussian at its pixels, and the place within the pixel.
    #[inline(always)]
    fn across(&self, place: f32) -> (i32, [f32; W], usize) {
        let first = nearest(place - (W as f32 / 2.0 - 0.5));
        let at = (place - first as f32 - (W as f32 / 2.0 - 1.0)) * INTERVALS as f32;
        let whole = nearest(at);
        let number = (whole.max(0) as usize).min(INTERVALS);
        let [mut gauss, slope] = self.across[number];
        let rest = at - whole as f32;
        gauss.iter_mut().zip(slope).for_each(|(gauss, slope)| *gauss += slope * rest);
        (first, gauss, (number * PLACES + INTERVALS / 2) / INTERVALS)
    }

    /// Adds a section to the sums of a band of rows, given its width and height, and with room for a window more at every side.
    #[inline(always)]
    pub(super) fn add(&self, section: &Section, [width, rows]: [usize; 2], sums: &mut [f32]) {
        let Section { center: [x, y], planes: [near, far], amount } = *section;
        let (top, down, place_down) = self.across(y);
        if top <= -(W as i32) || top >= rows as i32 {
            return;
        }
        let (left, right, place_right) = self.across(x);
        if left <= -(W as i32) || left >= width as i32 {
            return;
        }
        let amount = amount * (self.along(far) - self.along(near));
        let stride = width + 2 * W;
        let first = (top + W as i32) as usize * stride + (left + W as i32) as usize;
        let shares = &self.shares[place_down * (PLACES + 1) + place_right];
        for (row, (down, shares)) in sums[first..].chunks_mut(stride).zip(down.into_iter().zip(shares)) {
            let weight = amount * down;
            for (sum, (right, share)) in row[..W].iter_mut().zip(right.into_iter().zip(shares)) {
                *sum += right * share * weight;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_hold_kernels() {
        for (radius, falloff) in [(2.0, 2.0), (1.5, 5.0)] {
            let kernel = Kernel::new(radius, falloff);
            let window = Window::<4>::new(&kernel);
            let peak = kernel.section(0.0, -radius, radius);
            let mut worst: f64 = 0.0;
            for place in [4.0, 4.13, 4.5, 4.501, 4.77] {
                for planes in [[-0.9, 1.1], [-3.0, 3.0], [0.4, 2.4]] {
                    let (size, mut sums) = ([12, 9], vec![0.0; 20 * 17]);
                    window.add(&Section { center: [place, 5.3], planes, amount: 1.0 }, size, &mut sums);
                    for (at, &sum) in sums.iter().enumerate() {
                        let [column, row] = [at % 20, at / 20].map(|at| at as f64 - 4.0);
                        let square = (column - f64::from(place)).powi(2) + (row - 5.3).powi(2);
                        let exact = kernel.section(square, f64::from(planes[0]), f64::from(planes[1]));
                        worst = worst.max((f64::from(sum) - exact).abs() / peak);
                    }
                }
            }
            assert!(worst < 2e-4, "{radius} {falloff}: {worst:e}");
        }
    }
}
