//! The field at any point, of any kernel: near the volume's borders and holes, of wide kernels, and where the low-pass rule widens them. Rows of
//! voxels along x, eight voxels at a time.

use fearless_simd::prelude::*;
use fearless_simd::{f32x4, f32x8};
use glam::{DVec3, UVec3};

use super::{Field, MIN_WEIGHT};
use crate::cpu::after::colors::Color;
use crate::cpu::after::extent::Extent;
use crate::cpu::after::low_pass::LowPass;
use crate::cpu::vector::{LANES, exp2, iota};
use crate::volume::ValueSlice;

/// Slack around the ends of rows for rounding in f64, in voxels: every voxel is tested again.
const SLACK: f64 = 1e-6;

/// By how much |δ|² exceeds the radius' square along a row that is left out: more than f32 rounds.
const BEYOND: f64 = 1e-3;

/// Voxels of a row that a point's kernel may reach.
#[derive(Clone, Copy, Debug)]
struct Row {
    /// The first one.
    first: UVec3,
    /// Its index among the voxels at hand.
    index: usize,
    count: usize,
    /// δ of the first one, and the step from one to the next.
    offset: [f32; 3],
    step: [f32; 3],
}

/// The weight and the sums of a point.
struct Sums<S: Simd> {
    weights: f32x8<S>,
    sums: [f32x8<S>; 3],
}

impl Row {
    /// g of eight voxels, from one on; 0 outside the row.
    #[inline(always)]
    fn lanes<S: Simd>(&self, simd: S, field: &Field<'_>, from: usize) -> f32x8<S> {
        let number = iota(simd) + from as f32;
        let offset = |axis: usize| number * self.step[axis] + self.offset[axis];
        let [x, y, z] = [offset(0), offset(1), offset(2)];
        let squared = x * x + y * y + z * z;
        let is_inside = squared.simd_lt(f32x8::splat(simd, field.radius_squared))
            & number.simd_lt(f32x8::splat(simd, self.count as f32));
        let gaussian = exp2(simd, (squared * field.exponent).max(f32x8::splat(simd, -126.0)));
        is_inside.select(gaussian, f32x8::splat(simd, 0.0))
    }

    /// Where its eights begin.
    fn eights(&self) -> impl Iterator<Item = usize> {
        (0..self.count).step_by(LANES)
    }
}

impl Field<'_> {
    /// f at a point, as a number; NaN where there is no value.
    #[inline(never)]
    pub(super) fn row_value<S: Simd>(&self, simd: S, at: DVec3, low_pass: &LowPass) -> f32 {
        simd.vectorize(
            #[inline(always)]
            || {
                if self.coefficients.at(self.nearest(at)).is_nan() {
                    return f32::NAN;
                }
                let zero = f32x8::splat(simd, 0.0);
                let (mut weights, mut sum) = (zero, zero);
                self.each_row(
                    at,
                    low_pass,
                    #[inline(always)]
                    |row| {
                        for from in row.eights() {
                            let lanes = row.lanes(simd, self, from);
                            let c = load(simd, self.coefficients, row.index + from);
                            let is_present = c.simd_eq(c);
                            let weight = is_present.select(lanes, zero);
                            weights += weight;
                            sum += weight * is_present.select((c - self.base) * self.scale, zero);
                        }
                    },
                );
                let weight = sum_of(weights);
                if weight >= MIN_WEIGHT { sum_of(sum) / weight } else { f32::NAN }
            },
        )
    }

    /// The colour and A at a point that has a value, in [0, 1]; black without colours.
    #[inline(never)]
    pub(in crate::cpu::after) fn color<S: Simd>(&self, simd: S, (at, low_pass): (DVec3, &LowPass)) -> Color {
        let Some(colors) = self.colors else { return [0.0; 4] };
        simd.vectorize(
            #[inline(always)]
            || {
                let (mut weights, mut sums) = (0.0, f32x4::splat(simd, 0.0));
                self.each_row(
                    at,
                    low_pass,
                    #[inline(always)]
                    |row| {
                        for from in row.eights() {
                            let of_lanes = row.lanes(simd, self, from).to_array();
                            let voxels = row.index + from..row.index + row.count;
                            for (index, weight) in voxels.zip(of_lanes) {
                                if weight > 0.0 && !self.coefficients.at(index).is_nan() {
                                    weights += weight;
                                    sums += f32x4::load_array(simd, colors.at(index)) * weight;
                                }
                            }
                        }
                    },
                );
                (sums * (1.0 / weights)).to_array().map(|number: f32| number.clamp(0.0, 1.0))
            },
        )
    }

    /// `Σ (c - f)·g·δ / N`, which does not change where δ is counted from another point, for `Σ (c - f)·g` is 0: here from the nearest voxel, and c
    /// from that voxel's. So no term is much larger than the sum, however narrow the kernel, and where all c are equal the sum is 0.
    #[inline(never)]
    pub(super) fn row_moments<S: Simd>(&self, simd: S, at: DVec3, low_pass: &LowPass) -> [f32; 3] {
        simd.vectorize(
            #[inline(always)]
            || {
                let zero = f32x8::splat(simd, 0.0);
                let near = self.nearest_voxel(at);
                let nearest = self.coefficients.at(self.extent.index(near));
                let (mut weights, mut sum, mut moments, mut offsets) = (zero, zero, [zero; 3], [zero; 3]);
                self.each_row(
                    at,
                    low_pass,
                    #[inline(always)]
                    |row| {
                        let to_first = low_pass.lowered * (near.as_dvec3() - row.first.as_dvec3());
                        let to_first = to_first.to_array().map(|component| component as f32);
                        for from in row.eights() {
                            let c = load(simd, self.coefficients, row.index + from);
                            let is_present = c.simd_eq(c);
                            let weight = is_present.select(row.lanes(simd, self, from), zero);
                            let weighted = weight * is_present.select((c - nearest) * self.scale, zero);
                            let number = iota(simd) + from as f32;
                            weights += weight;
                            sum += weighted;
                            for axis in 0..3 {
                                let offset = number * row.step[axis] + to_first[axis];
                                moments[axis] += weighted * offset;
                                offsets[axis] += weight * offset;
                            }
                        }
                    },
                );
                let per_weight = 1.0 / sum_of(weights);
                let mean = sum_of(sum) * per_weight;
                [0, 1, 2].map(|axis: usize| (sum_of(moments[axis]) - mean * sum_of(offsets[axis])) * per_weight)
            },
        )
    }

    /// `Σ d·g / N`.
    #[inline(never)]
    pub(super) fn row_differences<S: Simd>(&self, simd: S, at: DVec3, low_pass: &LowPass) -> [f32; 3] {
        simd.vectorize(
            #[inline(always)]
            || {
                let zero = f32x8::splat(simd, 0.0);
                let mut sums = Sums { weights: zero, sums: [zero; 3] };
                self.each_row(
                    at,
                    low_pass,
                    #[inline(always)]
                    |row| {
                        for from in row.eights() {
                            let lanes = row.lanes(simd, self, from);
                            let c = load(simd, self.coefficients, row.index + from);
                            let weight = c.simd_eq(c).select(lanes, zero);
                            let differences = self.differences(simd, &row, from, weight);
                            sums.add(weight, differences);
                        }
                    },
                );
                let [x, y, z] = sums.means();
                let [per_x, per_y, per_z] = self.per_spacing;
                [x * per_x, y * per_y, z * per_z]
            },
        )
    }

    /// d of eight voxels of a row, times the spacing, 0 where their weights are.
    #[inline(always)]
    fn differences<S: Simd>(&self, simd: S, row: &Row, from: usize, weights: f32x8<S>) -> [f32x8<S>; 3] {
        let zero = f32x8::splat(simd, 0.0);
        let is_weighted = weights.simd_gt(zero);
        if is_weighted.to_bitmask() == 0 {
            return [zero; 3];
        }
        let (Extent { dims, low, held }, values) = (self.extent, self.volume.values());
        let first = row.first.with_x(row.first.x + from as u32);
        let last = first.with_x(row.first.x + (from + LANES).min(row.count) as u32 - 1);
        if first.cmpgt(UVec3::ZERO).all() && (last + 1).cmplt(dims).all() {
            let at = row.index + from;
            let half = f32x8::splat(simd, self.scale * 0.5);
            let (nx, ny) = (held.x as usize, held.y as usize);
            let [x, y, z] = [1, nx, nx * ny];
            let [x, y, z] = [
                across(simd, values, at, x, half),
                across(simd, values, at, y, half),
                across(simd, values, at, z, half),
            ];
            let is_known = x.simd_eq(x) & y.simd_eq(y) & z.simd_eq(z);
            // Otherwise a hole is near.
            if is_weighted.to_bitmask() & !is_known.to_bitmask() == 0 {
                return [is_weighted.select(x, zero), is_weighted.select(y, zero), is_weighted.select(z, zero)];
            }
        }
        let mut differences = [[0.0; LANES]; 3];
        let bits = is_weighted.to_bitmask();
        for lane in (0..LANES).filter(|lane| bits >> lane & 1 == 1) {
            let gradient = self.volume.gradient(first.with_x(first.x + lane as u32) - low) * self.volume.spacing();
            let numbers = gradient * self.numbers.scale;
            (0..3).for_each(|axis| differences[axis][lane] = numbers[axis] as f32);
        }
        let [x, y, z] = &differences;
        [f32x8::load_array_ref(simd, x), f32x8::load_array_ref(simd, y), f32x8::load_array_ref(simd, z)]
    }

    /// Calls a function with each row whose voxels may be within the radius.
    // A loop, because the closures of iterators would not be compiled for the instruction set.
    #[inline(always)]
    fn each_row(&self, at: DVec3, low_pass: &LowPass, mut then: impl FnMut(Row)) {
        let (extent, radius) = (self.extent, self.radius);
        let dims = extent.dims;
        let low = (at - low_pass.half_box).ceil().max(DVec3::ZERO).as_uvec3();
        let end = ((at + low_pass.half_box).floor() + 1.0).clamp(DVec3::ZERO, dims.as_dvec3()).as_uvec3();
        let (lowered, step) = (low_pass.lowered, -low_pass.lowered.x_axis);
        for z in low.z..end.z {
            for y in low.y..end.y {
                // |δ| is less than the radius between the roots of a quadratic function of x.
                let offset = lowered * (at - DVec3::new(0.0, y.into(), z.into()));
                let (a, b) = (step.length_squared(), offset.dot(step));
                let discriminant = b * b - a * (offset.length_squared() - radius * radius);
                // Most rows of the box around a kernel that is wide along two directions, and narrow along the third, are far from it.
                if discriminant < -BEYOND * a {
                    continue;
                }
                let root = discriminant.max(0.0).sqrt();
                let first = (((-b - root) / a - SLACK).ceil().max(0.0) as u32).max(low.x);
                let end = (((-b + root) / a + SLACK).floor() + 1.0).clamp(0.0, f64::from(end.x)) as u32;
                if first < end {
                    then(Row {
                        first: UVec3::new(first, y, z),
                        index: extent.index(UVec3::new(first, y, z)),
                        count: (end - first) as usize,
                        offset: (offset + step * f64::from(first)).to_array().map(|component| component as f32),
                        step: step.to_array().map(|component| component as f32),
                    });
                }
            }
        }
    }

    /// The voxel nearest to a point.
    fn nearest_voxel(&self, at: DVec3) -> UVec3 {
        let last = self.extent.dims.as_dvec3() - 1.0;
        // Cast, which rounds towards 0.
        (at + 0.5).clamp(DVec3::ZERO, last).as_uvec3()
    }

    /// Its index.
    fn nearest(&self, at: DVec3) -> usize {
        self.extent.index(self.nearest_voxel(at))
    }
}

impl<S: Simd> Sums<S> {
    #[inline(always)]
    fn add(&mut self, weights: f32x8<S>, numbers: [f32x8<S>; 3]) {
        self.weights += weights;
        for (sum, number) in self.sums.iter_mut().zip(numbers) {
            *sum += weights * number;
        }
    }

    #[inline(always)]
    fn means(&self) -> [f32; 3] {
        let per_weight = 1.0 / sum_of(self.weights);
        let [x, y, z] = self.sums;
        [sum_of(x) * per_weight, sum_of(y) * per_weight, sum_of(z) * per_weight]
    }
}

/// The differences of eight voxels, from one on, over a step in memory to either side, times a factor.
// No closure, which would not be compiled for the instruction set.
#[inline(always)]
fn across<S: Simd>(simd: S, values: ValueSlice<'_>, at: usize, step: usize, factor: f32x8<S>) -> f32x8<S> {
    load(simd, values, at + step) * factor - load(simd, values, at - step) * factor
}

/// Eight numbers, from one on; NaN beyond the last one.
#[inline(always)]
fn load<S: Simd>(simd: S, all: ValueSlice<'_>, at: usize) -> f32x8<S> {
    let count = all.len();
    if at + LANES <= count {
        return f32x8::load_array(simd, all.run(at));
    }
    let mut eight = [f32::NAN; LANES];
    eight.iter_mut().zip(all.slice(at.min(count)..count)).for_each(|(number, c)| *number = c);
    f32x8::load_array(simd, eight)
}

/// The sum of eight numbers, in the same order on every machine.
#[inline(always)]
fn sum_of<S: Simd>(numbers: f32x8<S>) -> f32 {
    let (low, high) = numbers.split();
    let [a, b, c, d] = (low + high).to_array();
    (a + c) + (b + d)
}
