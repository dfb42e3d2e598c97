//! Bounds of the means of coefficients at the points of a cell, tighter than the least and the greatest coefficient.
//!
//! Without its cut at the radius, a kernel is a product of one along each axis. There a point has weights for four voxels, of which the outer two have at
//! most a share of all, so that its mean is at most the inner two's greater one, and that share of what an outer one has more. Of such bounds along one axis
//! the means along the next have a bound, too. The voxels that the cut leaves out move a mean by no more than their share of its weight.

use glam::DVec3;

use crate::after::normalization::Normalization;
use crate::parallel::prelude::*;
use crate::volume::{Grid, Sample, ValueSlice, for_type};

/// Slices that one thread bounds at a time.
const DEPTH: usize = 16;

/// The greatest share of a mean's weight that may be cut off.
const MOST_CUT: f64 = 0.05;

/// What the kernels of a frame allow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bounds {
    /// The greatest share of the outer two of four voxels along an axis.
    outer: f32,
    /// By how much the cut may raise a mean, in ranges of all coefficients.
    cut: f32,
}

/// Rows of bounds, of which the first and the last two have no meaning, since they lack voxels.
type Rows = Vec<f32>;

impl Bounds {
    /// For kernels of a radius and falloff, whose widest has half a box; `None` where they reach too far, not far enough, or are not cut far enough out.
    pub(super) fn of(half_box: DVec3, (radius, falloff): (f64, f64)) -> Option<Self> {
        // Kernels that the low-pass rule does not widen, which reach four voxels along an axis, and all corners of a cell from all of its points.
        let is_narrow = half_box.abs_diff_eq(DVec3::splat(radius), 1e-9) && (3.0_f64.sqrt()..=2.0).contains(&radius);
        let weight = |distance: f64| libm::exp(-falloff * distance * distance);
        // The share is the greatest at a cell's corners.
        let (inner, outer) = (1.0 + weight(1.0), weight(1.0) + weight(2.0));
        // The corners' weights alone are the least at a corner or in the middle; 56 others may be cut off.
        let least = inner.min(2.0 * weight(0.5)).powi(3);
        let cut = 56.0 * weight(radius) / least;
        (is_narrow && cut <= MOST_CUT)
            .then(|| Self { outer: (outer / (inner + outer)) as f32, cut: (cut / (1.0 - cut)) as f32 })
    }

    /// Clears a flag of the cells, but for those at the volume's borders, whose numbers times `sign`, 1 or -1, are all less than `least`. There are no holes.
    pub(super) fn clear(
        &self,
        (bits, flag): (&mut [u8], u8),
        (grid, coefficients, numbers): (&Grid, ValueSlice<'_>, &Normalization),
        (sign, least): (f32, f32),
    ) {
        let [nx, ny, nz] = grid.dims.to_array().map(|n| n as usize);
        if nx.min(ny).min(nz) < 4 {
            return;
        }
        let least = least - self.cut * (numbers.range[1] - numbers.range[0]);
        let slice = nx * ny;
        bits.par_chunks_mut(DEPTH * slice).enumerate().for_each_init(Ring::default, |ring, (chunk, bits)| {
            let first = chunk * DEPTH;
            let cells = first.max(1)..(first + bits.len() / slice).min(nz - 2);
            for z in cells.clone() {
                let missing = if z == cells.start { z - 1..z + 3 } else { z + 2..z + 3 };
                for z in missing {
                    let values = coefficients.slice(z * slice..(z + 1) * slice);
                    self.bound_slice(values, numbers, sign, nx, ring.at(z));
                }
                let Ring { slices, .. } = ring;
                let of = |z: usize| &slices[z % 4][..];
                let bits = &mut bits[(z - first) * slice..][..slice];
                for y in 1..ny - 2 {
                    let rows = [z - 1, z, z + 1, z + 2].map(|z| &of(z)[y * nx..(y + 1) * nx]);
                    let bits = &mut bits[y * nx + 1..(y + 1) * nx - 2];
                    for (x, bits) in (1..).zip(bits) {
                        let bound = self.bound(rows.map(|row| row[x]));
                        *bits &= !(flag * u8::from(bound < least));
                    }
                }
            }
        });
    }

    /// The bounds of means along x and y in a slice.
    fn bound_slice(
        &self,
        values: ValueSlice<'_>,
        numbers: &Normalization,
        sign: f32,
        nx: usize,
        (along_x, all): (&mut Rows, &mut Rows),
    ) {
        let (base, scale) = (numbers.base as f32, sign * numbers.scale as f32);
        let count = values.len();
        along_x.resize(count, 0.0);
        all.resize(count, 0.0);
        let mut row_of = vec![0.0; nx];
        for_type!(ValueSlice, values, values => {
            for (row, bounds) in values.chunks_exact(nx).zip(along_x.chunks_exact_mut(nx)) {
                row_of.iter_mut().zip(row).for_each(|(number, value)| *number = (value.to_f32() - base) * scale);
                for (bound, four) in bounds[1..nx - 2].iter_mut().zip(row_of.windows(4)) {
                    *bound = self.bound([four[0], four[1], four[2], four[3]]);
                }
            }
        });
        for y in 1..count / nx - 2 {
            let rows = [y - 1, y, y + 1, y + 2].map(|y| &along_x[y * nx..(y + 1) * nx]);
            for (x, bound) in all[y * nx..(y + 1) * nx].iter_mut().enumerate() {
                *bound = self.bound(rows.map(|row| row[x]));
            }
        }
    }

    /// The greatest mean of four numbers at any point between the inner two.
    #[inline(always)]
    fn bound(&self, [a, b, c, d]: [f32; 4]) -> f32 {
        // As processors do it, without regard to NaN.
        let greater = |a: f32, b: f32| if a > b { a } else { b };
        let (inner, outer) = (greater(b, c), greater(a, d));
        greater(inner, inner + self.outer * (outer - inner))
    }
}

/// The bounds of four slices, in turn.
#[derive(Debug, Default)]
struct Ring {
    slices: [Rows; 4],
    along_x: Rows,
}

impl Ring {
    /// Where a slice's bounds belong, and room to find them.
    fn at(&mut self, z: usize) -> (&mut Rows, &mut Rows) {
        (&mut self.along_x, &mut self.slices[z % 4])
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use glam::UVec3;

    use super::*;

    /// No point's mean is greater than what the bits of its cell tell, and many cells tell more than their voxels' extremes do.
    #[test]
    fn no_mean_is_beyond_its_bound() {
        let grid = Grid::new(UVec3::new(14, 9, 40), DVec3::ONE);
        let mut state = 3_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as f64 / (1_u64 << 31) as f64
        };
        let values: Vec<f32> =
            (0..grid.dims.element_product()).map(|_| if random() < 0.1 { random() as f32 } else { 0.0 }).collect();
        let numbers = Normalization { base: 0.0, scale: 1.0, range: [0.0, 1.0] };
        for kernel in [(2.0, 2.0), (1.8, 2.5), (2.0, 1.8)] {
            let bounds = Bounds::of(DVec3::splat(kernel.0), kernel).unwrap();
            for (sign, least) in [(1.0, 0.3), (1.0, 0.05), (-1.0, -0.02)] {
                let mut bits = vec![3; values.len()];
                bounds.clear((&mut bits, 1), (&grid, (&values).into(), &numbers), (sign, least));
                let cleared = bits.iter().filter(|&&bits| bits == 2).count();
                assert!(cleared + bits.iter().filter(|&&bits| bits == 3).count() == values.len());
                assert!(cleared > 50 || sign < 0.0, "{kernel:?} {sign} {least}: {cleared}");
                for index in (0..values.len() as u32).filter(|&index| bits[index as usize] == 2) {
                    let cell = grid.voxel_at(index);
                    assert!(cell.cmpge(UVec3::ONE).all() && cell.cmple(grid.dims - 3).all());
                    for step in 0..343 {
                        let at = DVec3::new((step % 7).into(), (step / 7 % 7).into(), (step / 49).into()) / 6.0;
                        let (mut sum, mut weight) = (0.0, 0.0);
                        for near in 0..64 {
                            let offset = UVec3::new(near % 4, near / 4 % 4, near / 16);
                            let squared = (offset.as_dvec3() - 1.0 - at).length_squared();
                            if squared < kernel.0 * kernel.0 {
                                let own = (-kernel.1 * squared).exp();
                                sum += own * f64::from(values[grid.index_of(cell + offset - 1) as usize]);
                                weight += own;
                            }
                        }
                        assert!(f64::from(sign) * sum / weight < f64::from(least), "{kernel:?} {cell} {at}");
                    }
                }
            }
        }
    }

    #[test]
    fn other_kernels_have_no_bounds() {
        assert!(Bounds::of(DVec3::new(2.0, 2.1, 2.0), (2.0, 2.0)).is_none());
        assert!(Bounds::of(DVec3::splat(2.5), (2.5, 2.0)).is_none());
        assert!(Bounds::of(DVec3::splat(1.4), (1.4, 3.0)).is_none());
        assert!(Bounds::of(DVec3::splat(2.0), (2.0, 0.7)).is_none());
    }
}
