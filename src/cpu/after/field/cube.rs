//! The field at a point inside the volume, of kernels that reach no more than the 4×4×4 voxels around it: sixteen of them at a time, a plane of
//! x and y, so that the volume is read in runs of four.

use fearless_simd::prelude::*;
use fearless_simd::{f32x4, f32x8, f32x16, u8x64};
use glam::UVec3;

use super::{Cube, Field};
use crate::cpu::after::differences::{Differences, Neighbours};
use crate::cpu::after::planes::Eight;
use crate::cpu::count::bits;
use crate::cpu::vector::{LANES, columns, exp2, transposed};
use crate::volume::{Sample, ValueSlice, for_type};

/// Voxels along a side.
pub(super) const SIDE: usize = 4;

/// From the first voxel to the others, along x and along y.
const OFFSETS: [[f32; SIDE * SIDE]; 2] = [
    [0.0, 1.0, 2.0, 3.0, 0.0, 1.0, 2.0, 3.0, 0.0, 1.0, 2.0, 3.0, 0.0, 1.0, 2.0, 3.0],
    [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 2.0, 3.0, 3.0, 3.0, 3.0],
];

/// The kernels around eight points: `g = in_plane·along`, cut off at the radius. They are computed for all points before any is used, so that processors
/// need not wait for one to begin with the next.
#[repr(align(64))]
pub(super) struct Weights {
    in_plane: [[f32; SIDE * SIDE]; LANES],
    /// The squares of δ along x and y.
    squared: [[f32; SIDE * SIDE]; LANES],
    /// By z: δ, its Gaussian, and the square of the other components of δ at the kernel's radius.
    z: [[f32; SIDE]; LANES],
    along: [[f32; SIDE]; LANES],
    limit: [[f32; SIDE]; LANES],
}

impl Weights {
    /// Those of the points that have a bit.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn new<S: Simd>(simd: S, field: &Field<'_>, cubes: &Eight, lanes: u32) -> Self {
        let none = [[0.0; SIDE]; LANES];
        let in_plane = [[0.0; SIDE * SIDE]; LANES];
        let mut weights = Self { in_plane, squared: in_plane, z: none, along: none, limit: none };
        for lane in bits(lanes.into()) {
            let lane = lane as usize;
            let [x, y] = offsets(simd, cubes, lane);
            let squared = x * x + y * y;
            gaussian(simd, squared * field.exponent).store_array(&mut weights.in_plane[lane]);
            squared.store_array(&mut weights.squared[lane]);
        }
        let Self { z, along, limit, .. } = &mut weights;
        // Four points at a time.
        let z = z.as_chunks_mut::<SIDE>().0.iter_mut();
        let by_four = z.zip(along.as_chunks_mut::<SIDE>().0).zip(limit.as_chunks_mut::<SIDE>().0);
        for (((z, along), limit), rest) in by_four.zip(cubes.rest[2].as_chunks::<SIDE>().0) {
            let [a, b, c, d] = rest.map(|z| f32x4::splat(simd, z));
            let offset = a.combine(b).combine(c.combine(d)) - f32x16::load_array(simd, OFFSETS[0]);
            let squared = offset * offset;
            offset.store_slice(z.as_flattened_mut());
            gaussian(simd, squared * field.exponent).store_slice(along.as_flattened_mut());
            (f32x16::splat(simd, field.radius_squared) - squared).store_slice(limit.as_flattened_mut());
        }
        weights
    }

    /// g of the voxels of one z around a point.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn at<S: Simd>(&self, simd: S, lane: usize, z: usize) -> f32x16<S> {
        let squared = f32x16::load_array_ref(simd, &self.squared[lane]);
        let is_inside = squared.simd_lt(f32x16::splat(simd, self.limit[lane][z]));
        let in_plane = f32x16::load_array_ref(simd, &self.in_plane[lane]);
        is_inside.select(in_plane * self.along[lane][z], f32x16::splat(simd, 0.0))
    }
}

/// δ along x and y of sixteen voxels around one of eight points.
#[cfg_attr(not(debug_assertions), inline(always))]
fn offsets<S: Simd>(simd: S, Eight { rest, .. }: &Eight, lane: usize) -> [f32x16<S>; 2] {
    let of = |axis: usize| f32x16::splat(simd, rest[axis][lane]) - f32x16::load_array(simd, OFFSETS[axis]);
    [of(0), of(1)]
}

/// The kernels around a point, for each row of voxels along x: `g = along·across`, cut off at the radius.
pub(super) struct RowWeights {
    /// The Gaussian of δ along x, and its square.
    along: [f32; SIDE],
    squared: [f32; SIDE],
    /// By row: the Gaussian of the other components, and the square of the component along x at the kernel's radius.
    across: [f32; SIDE * SIDE],
    limits: [f32; SIDE * SIDE],
}

impl RowWeights {
    pub(super) const NONE: Self =
        Self { along: [0.0; SIDE], squared: [0.0; SIDE], across: [0.0; SIDE * SIDE], limits: [0.0; SIDE * SIDE] };

    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn new<S: Simd>(simd: S, field: &Field<'_>, [x, y, z]: [f32; 3]) -> Self {
        /// The voxels of an axis, for each of three axes.
        const VOXELS: [f32; 4 * SIDE] =
            [0.0, 1.0, 2.0, 3.0, 0.0, 1.0, 2.0, 3.0, 0.0, 1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 0.0];
        let (x, y, z) = (f32x4::splat(simd, x), f32x4::splat(simd, y), f32x4::splat(simd, z));
        let offset = x.combine(y).combine(z.combine(z)) - f32x16::load_array(simd, VOXELS);
        let squared = offset * offset;
        let (of_xy, of_z) = gaussian(simd, squared * field.exponent).split();
        let (xy_squared, z_squared) = squared.split();
        let ((of_x, of_y), (of_z, _)) = (of_xy.split(), of_z.split());
        let ((x_squared, y_squared), (z_squared, _)) = (xy_squared.split(), z_squared.split());
        let (of_z, left) = (of_z.to_array(), (f32x4::splat(simd, field.radius_squared) - z_squared).to_array());
        let (along, squared) = (of_x.to_array(), x_squared.to_array());
        let mut rows = Self { along, squared, across: [0.0; SIDE * SIDE], limits: [0.0; SIDE * SIDE] };
        let (across, limits) = (rows.across.as_chunks_mut::<SIDE>().0, rows.limits.as_chunks_mut::<SIDE>().0);
        for z in 0..SIDE {
            (of_y * of_z[z]).store_array(&mut across[z]);
            (f32x4::splat(simd, left[z]) - y_squared).store_array(&mut limits[z]);
        }
        rows
    }
}

impl Field<'_> {
    /// N and `Σ (c - base)·g` of one of eight points, each as four numbers to be added. Not finite if a hole is near.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn cube_sums<S: Simd>(&self, simd: S, cubes: &Eight, weights: &Weights, lane: usize) -> [f32x4<S>; 2] {
        let [step_y, step_z] = self.steps();
        let first = cubes.indices[lane] as usize;
        let zero = f32x16::splat(simd, 0.0);
        let (mut total, mut sum) = (zero, zero);
        for z in 0..SIDE {
            let weight = weights.at(simd, lane, z);
            let c = rows(simd, self.coefficients, first + z * step_z, step_y) - self.base;
            total += weight;
            sum += weight * c;
        }
        [quarters(total), quarters(sum)]
    }

    /// `2·Σ d·g` of a point, and N. Not finite if a hole is near.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn cube_differences<S: Simd>(&self, simd: S, cube: &Cube, rows: &RowWeights) -> f32x4<S> {
        match self.differences {
            #[cfg(not(target_arch = "wasm32"))]
            Some(Differences::Small(all)) => self.kept_differences(simd, cube, rows, all),
            Some(Differences::Any(all)) => self.kept_differences(simd, cube, rows, all),
            None => self.new_differences(simd, cube, rows),
        }
    }

    /// The same of differences that are kept: x, y and z of a row's four voxels side by side.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn kept_differences<S: Simd, T: Sample>(&self, simd: S, cube: &Cube, rows: &RowWeights, all: &[T]) -> f32x4<S> {
        let (along, squared) = (by_difference(simd, rows.along), by_difference(simd, rows.squared));
        let zero = f32x16::splat(simd, 0.0);
        let (mut total, mut sums) = (zero, zero);
        for (row, index) in self.rows_of(cube).into_iter().enumerate() {
            let is_inside = squared.simd_lt(f32x16::splat(simd, rows.limits[row]));
            let weight = is_inside.select(along * rows.across[row], zero);
            total += weight;
            sums += weight * four_differences(simd, all, index);
        }
        let [x, y, z, _] = of_voxels(simd, sums);
        let [total, ..] = of_voxels(simd, total);
        f32x4::load_array(simd, [x, y, z, total])
    }

    /// The same sums of the same numbers, where differences are not kept.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn new_differences<S: Simd>(&self, simd: S, cube: &Cube, rows: &RowWeights) -> f32x4<S> {
        let (values, dims, [step_y, step_z]) = (self.volume.values(), self.extent.dims, self.steps());
        let is_inside = cube.first.cmpgt(UVec3::ZERO).all() && (cube.first + SIDE as u32).cmplt(dims).all();
        let neighbours = Neighbours::of(values, dims, [1, step_y, step_z]);
        let (along, squared) = (f32x4::load_array(simd, rows.along), f32x4::load_array(simd, rows.squared));
        let zero = f32x4::splat(simd, 0.0);
        let four = |at: usize| f32x4::load_array(simd, values.run(at));
        let [mut total, mut x, mut y, mut z] = [zero; 4];
        for (row, index) in self.rows_of(cube).into_iter().enumerate() {
            let is_near = squared.simd_lt(f32x4::splat(simd, rows.limits[row]));
            let weight = is_near.select(along * rows.across[row], zero);
            total += weight;
            if is_inside {
                x += weight * (four(index + 1) - four(index - 1));
                y += weight * (four(index + step_y) - four(index - step_y));
                z += weight * (four(index + step_z) - four(index - step_z));
            } else {
                let first = cube.first + UVec3::new(0, (row % SIDE) as u32, (row / SIDE) as u32);
                let voxel = |x: usize| neighbours.at(index + x, first.with_x(first.x + x as u32));
                let [a, b, c, d] = [voxel(0), voxel(1), voxel(2), voxel(3)];
                x += weight * f32x4::load_array(simd, [a[0], b[0], c[0], d[0]]);
                y += weight * f32x4::load_array(simd, [a[1], b[1], c[1], d[1]]);
                z += weight * f32x4::load_array(simd, [a[2], b[2], c[2], d[2]]);
            }
        }
        let [a, b, c, d] = transposed([x, y, z, total]);
        (a + c) + (b + d)
    }

    /// The indices of the first voxels of a cube's rows along x.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn rows_of(&self, cube: &Cube) -> [usize; SIDE * SIDE] {
        let [step_y, step_z] = self.steps();
        let mut rows = [0; SIDE * SIDE];
        let mut of_plane = cube.index;
        for plane in rows.as_chunks_mut::<SIDE>().0 {
            *plane = [of_plane, of_plane + step_y, of_plane + 2 * step_y, of_plane + 3 * step_y];
            of_plane += step_z;
        }
        rows
    }

    /// `Σ (c - f)·g·δ / N`, given f.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn cube_moments<S: Simd>(
        &self,
        simd: S,
        cubes: &Eight,
        weights: &Weights,
        lane: usize,
        number: f32,
    ) -> [f32; 3] {
        let [step_y, step_z] = self.steps();
        let first = cubes.indices[lane] as usize;
        let [to_x, to_y] = offsets(simd, cubes, lane);
        let zero = f32x16::splat(simd, 0.0);
        let (mut total, mut x, mut y, mut z) = (zero, zero, zero, zero);
        for plane in 0..SIDE {
            let weight = weights.at(simd, lane, plane);
            total += weight;
            let c = rows(simd, self.coefficients, first + plane * step_z, step_y) - self.base;
            let weighted = weight * (c * self.scale - number);
            x += weighted * to_x;
            y += weighted * to_y;
            z += weighted * weights.z[lane][plane];
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

/// The number of each of a row's four voxels for each of their three differences.
#[cfg_attr(not(debug_assertions), inline(always))]
fn by_difference<S: Simd>(simd: S, of_voxels: [f32; SIDE]) -> f32x16<S> {
    const BYTES: [u8; 64] = {
        let mut bytes = [0; 64];
        let mut at = 0;
        while at < 64 {
            let voxel = if at / 12 < SIDE { at / 12 } else { SIDE - 1 };
            bytes[at] = (voxel * 4 + at % 4) as u8;
            at += 1;
        }
        bytes
    };
    let four = f32x4::load_array(simd, of_voxels);
    let eight = four.combine(four);
    eight.combine(eight).swizzle_dyn_within_blocks(u8x64::load_array_ref(simd, &BYTES))
}

/// The differences of four voxels along x, given the index of the first one, and four numbers more.
#[cfg_attr(not(debug_assertions), inline(always))]
fn four_differences<S: Simd, T: Sample>(simd: S, all: &[T], index: usize) -> f32x16<S> {
    let mut numbers = [0.0; 16];
    numbers
        .iter_mut()
        .zip(&all[3 * index..3 * index + 16])
        .for_each(|(number, difference)| *number = difference.to_f32());
    f32x16::load_array(simd, numbers)
}

/// The Gaussian by its exponent of 2.
#[cfg_attr(not(debug_assertions), inline(always))]
fn gaussian<S: Simd, V: SimdFloat<S, Element = f32>>(simd: S, exponent: V) -> V {
    exp2(simd, exponent.max(V::splat(simd, -126.0)))
}

/// Four rows of four voxels, given the index of the first one and the step from row to row.
#[cfg_attr(not(debug_assertions), inline(always))]
fn rows<S: Simd>(simd: S, all: ValueSlice<'_>, at: usize, step: usize) -> f32x16<S> {
    f32x16::load_array(simd, for_type!(ValueSlice, all, all => side_by_side(all, at, step)))
}

/// Their numbers, side by side before they are converted, so that one instruction converts as many as there are lanes.
#[cfg_attr(not(debug_assertions), inline(always))]
fn side_by_side<T: Sample>(all: &[T], at: usize, step: usize) -> [f32; SIDE * SIDE] {
    let row = |at: usize| {
        let row = &all[at..at + SIDE];
        [row[0], row[1], row[2], row[3]]
    };
    let [[a, b, c, d], [e, f, g, h]] = [row(at), row(at + step)];
    let [[i, j, k, l], [m, n, o, p]] = [row(at + 2 * step), row(at + 3 * step)];
    [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p].map(T::to_f32)
}

/// The sums of four voxels' x, y and z, which lie side by side.
#[cfg_attr(not(debug_assertions), inline(always))]
fn of_voxels<S: Simd>(simd: S, numbers: f32x16<S>) -> [f32; 4] {
    let numbers = numbers.to_array();
    let voxel = |at: usize| f32x4::from_slice(simd, &numbers[3 * at..3 * at + 4]);
    ((voxel(0) + voxel(2)) + (voxel(1) + voxel(3))).to_array()
}

/// Four sums of four of sixteen numbers each.
#[cfg_attr(not(debug_assertions), inline(always))]
fn quarters<S: Simd>(numbers: f32x16<S>) -> f32x4<S> {
    let (low, high) = numbers.split();
    let (low, high) = (low + high).split();
    low + high
}

/// The sum of sixteen numbers, in the same order on every machine.
#[cfg_attr(not(debug_assertions), inline(always))]
fn sum_of<S: Simd>(numbers: f32x16<S>) -> f32 {
    let [a, b, c, d] = quarters(numbers).to_array();
    (a + c) + (b + d)
}

/// The sums of four numbers for each of eight points, in that order.
#[cfg_attr(not(debug_assertions), inline(always))]
pub(super) fn sums_of<S: Simd>(simd: S, [a, b, c, d, e, f, g, h]: &[[f32; SIDE]; LANES]) -> f32x8<S> {
    let [first, second, third, fourth] = columns(simd, [a, b, c, d, e, f, g, h]);
    (first + third) + (second + fourth)
}
