//! The field at a point inside the volume, of kernels that reach no more than the 4×4×4 voxels around it: sixteen of them at a time, a plane of
//! x and y, so that the volume is read in runs of four.

use fearless_simd::prelude::*;
use fearless_simd::{f32x4, f32x8, f32x16};

use super::{Cube, Field};
use crate::cpu::vector::exp2;

/// Voxels along a side.
pub(super) const SIDE: usize = 4;

/// From the first voxel to the others, along x and along y.
const OFFSETS: [[f32; SIDE * SIDE]; 2] = [
    [0.0, 1.0, 2.0, 3.0, 0.0, 1.0, 2.0, 3.0, 0.0, 1.0, 2.0, 3.0, 0.0, 1.0, 2.0, 3.0],
    [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 2.0, 3.0, 3.0, 3.0, 3.0],
];

/// The kernels around a point: `g = in_plane·along`, cut off at the radius.
struct Weights<S: Simd> {
    /// δ along x and y.
    offsets: [f32x16<S>; 2],
    squared: f32x16<S>,
    in_plane: f32x16<S>,
    /// By z: δ, its Gaussian, and the square of the other components of δ at the kernel's radius.
    z: [f32; SIDE],
    along: [f32; SIDE],
    limit: [f32; SIDE],
}

impl<S: Simd> Weights<S> {
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn new(simd: S, field: &Field<'_>, [x, y, z]: [f32; 3]) -> Self {
        let [to_x, to_y] = OFFSETS;
        let x = f32x16::splat(simd, x) - f32x16::load_array(simd, to_x);
        let y = f32x16::splat(simd, y) - f32x16::load_array(simd, to_y);
        let squared = x * x + y * y;
        let (low, high) = (squared * field.exponent).split();
        let in_plane = gaussian(simd, low).combine(gaussian(simd, high));
        let z = f32x8::splat(simd, z) - f32x8::load_array(simd, [0.0, 1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 0.0]);
        let z_squared = z * z;
        let first = |vector: f32x8<S>| {
            let [a, b, c, d, ..] = vector.to_array();
            [a, b, c, d]
        };
        Self {
            offsets: [x, y],
            squared,
            in_plane,
            z: first(z),
            along: first(gaussian(simd, z_squared * field.exponent)),
            limit: first(f32x8::splat(simd, field.radius_squared) - z_squared),
        }
    }

    /// g of the voxels of one z.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn at(&self, simd: S, z: usize) -> f32x16<S> {
        let is_inside = self.squared.simd_lt(f32x16::splat(simd, self.limit[z]));
        is_inside.select(self.in_plane * self.along[z], f32x16::splat(simd, 0.0))
    }
}

impl Field<'_> {
    /// N and `Σ c·g`. Not finite if a hole is near.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn cube_sums<S: Simd>(&self, simd: S, cube: &Cube) -> [f32; 2] {
        let weights = Weights::new(simd, self, cube.rest);
        let [step_y, step_z] = self.steps();
        let first = cube.index;
        let zero = f32x16::splat(simd, 0.0);
        let (mut total, mut sum) = (zero, zero);
        for z in 0..SIDE {
            let weight = weights.at(simd, z);
            let c = rows(simd, self.coefficients, first + z * step_z, step_y) - self.base;
            total += weight;
            sum += weight * c;
        }
        [sum_of(total), sum_of(sum) * self.scale]
    }

    /// `Σ d·g / N`, for voxels that have neighbours on either side.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn cube_differences<S: Simd>(&self, simd: S, cube: &Cube) -> [f32; 3] {
        let weights = Weights::new(simd, self, cube.rest);
        let ([step_y, step_z], values) = (self.steps(), self.volume.values());
        let first = cube.index;
        let zero = f32x16::splat(simd, 0.0);
        let (mut total, mut x, mut y, mut z) = (zero, zero, zero, zero);
        for plane in 0..SIDE {
            let at = first + plane * step_z;
            let weight = weights.at(simd, plane);
            total += weight;
            x += weight * (rows(simd, values, at + 1, step_y) - rows(simd, values, at - 1, step_y));
            y += weight * (rows(simd, values, at + step_y, step_y) - rows(simd, values, at - step_y, step_y));
            z += weight * (rows(simd, values, at + step_z, step_y) - rows(simd, values, at - step_z, step_y));
        }
        let per_weight = 0.5 * self.scale / sum_of(total);
        let [per_x, per_y, per_z] = self.per_spacing;
        [sum_of(x) * per_weight * per_x, sum_of(y) * per_weight * per_y, sum_of(z) * per_weight * per_z]
    }

    /// `Σ (c - f)·g·δ / N`, given f.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn cube_moments<S: Simd>(&self, simd: S, cube: &Cube, number: f32) -> [f32; 3] {
        let weights = Weights::new(simd, self, cube.rest);
        let [step_y, step_z] = self.steps();
        let first = cube.index;
        let zero = f32x16::splat(simd, 0.0);
        let (mut total, mut x, mut y, mut z) = (zero, zero, zero, zero);
        for plane in 0..SIDE {
            let weight = weights.at(simd, plane);
            total += weight;
            let c = rows(simd, self.coefficients, first + plane * step_z, step_y) - self.base;
            let weighted = weight * (c * self.scale - number);
            x += weighted * weights.offsets[0];
            y += weighted * weights.offsets[1];
            z += weighted * weights.z[plane];
        }
        let per_weight = 1.0 / sum_of(total);
        [sum_of(x) * per_weight, sum_of(y) * per_weight, sum_of(z) * per_weight]
    }

    /// Steps in memory along y and z.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn steps(&self) -> [usize; 2] {
        let [x, y, _] = self.volume.dims().to_array().map(|n| n as usize);
        [x, x * y]
    }
}

/// The Gaussian by its exponent of 2.
#[cfg_attr(not(debug_assertions), inline(always))]
fn gaussian<S: Simd>(simd: S, exponent: f32x8<S>) -> f32x8<S> {
    exp2(simd, exponent.max(f32x8::splat(simd, -126.0)))
}

/// Four rows of four voxels, given the index of the first one and the step from row to row.
#[cfg_attr(not(debug_assertions), inline(always))]
fn rows<S: Simd>(simd: S, all: &[f32], at: usize, step: usize) -> f32x16<S> {
    let row = |at: usize| &all[at..at + SIDE];
    let [a, b, c, d] = [row(at), row(at + step), row(at + 2 * step), row(at + 3 * step)];
    let low = f32x4::from_slice(simd, a).combine(f32x4::from_slice(simd, b));
    let high = f32x4::from_slice(simd, c).combine(f32x4::from_slice(simd, d));
    low.combine(high)
}

/// The sum of sixteen numbers, in the same order on every machine.
#[cfg_attr(not(debug_assertions), inline(always))]
fn sum_of<S: Simd>(numbers: f32x16<S>) -> f32 {
    let (low, high) = numbers.split();
    let (low, high) = (low + high).split();
    let [a, b, c, d] = (low + high).to_array();
    (a + c) + (b + d)
}
