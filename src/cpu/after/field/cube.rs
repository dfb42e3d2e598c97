//! The field at a point inside the volume, of kernels that reach no more than the 4×4×4 voxels around it: sixteen of them at a time, a plane of
//! x and y, so that the volume is read in runs of four.

use fearless_simd::prelude::*;
use fearless_simd::{f32x4, f32x8, f32x16, u8x64};
use glam::UVec3;

use super::Field;
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

/// The voxels around eight neighbouring points of a plane, and the kernels there: `g = in_plane·along`, cut off at the radius. They are computed for all
/// points before any is used, so that processors need not wait for one to begin with the next, and kept, because gradients need those of values.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(in crate::cpu::after) struct Weights {
    /// g by point and z.
    planes: [[[f32; SIDE * SIDE]; SIDE]; LANES],
    in_plane: [[f32; SIDE * SIDE]; LANES],
    /// The squares of δ along x and y.
    squared: [[f32; SIDE * SIDE]; LANES],
    /// By z: the Gaussian of δ, and the square of its other components at the kernel's radius.
    along: [[f32; SIDE]; LANES],
    limits: [[f32; SIDE]; LANES],
    /// N.
    totals: [f32; LANES],
    cubes: Eight,
    /// The first point's pixel in its tile.
    at: [usize; 2],
    /// The bits of the points whose weights are known.
    known: u32,
}

impl Weights {
    /// Memory for weights, none of which is known.
    pub(in crate::cpu::after) fn new() -> Self {
        let (in_plane, along) = ([[0.0; SIDE * SIDE]; LANES], [[0.0; SIDE]; LANES]);
        Self {
            planes: [[[0.0; SIDE * SIDE]; SIDE]; LANES],
            in_plane,
            squared: in_plane,
            along,
            limits: along,
            totals: [0.0; LANES],
            cubes: Eight::NONE,
            at: [0; 2],
            known: 0,
        }
    }

    /// Makes all weights unknown.
    pub(in crate::cpu::after) fn clear(&mut self) {
        self.known = 0;
    }

    /// Whether those of a pixel and its neighbours that have a bit are known.
    pub(super) fn are_known(&self, at: [usize; 2], lanes: u32) -> bool {
        self.at == at && lanes & !self.known == 0
    }

    /// Computes those of the points that have a bit, and returns `Σ (c - base)·g` of each as four numbers to be added. Not finite if a hole is near.
    #[inline(always)]
    pub(super) fn find<S: Simd>(
        &mut self,
        simd: S,
        field: &Field<'_>,
        cubes: Eight,
        at: [usize; 2],
        lanes: u32,
    ) -> [[f32; SIDE]; LANES] {
        let Self { planes, in_plane, squared, along, limits, .. } = self;
        for lane in bits(lanes.into()) {
            let lane = lane as usize;
            let [x, y] = offsets(simd, &cubes, lane);
            let of = x * x + y * y;
            gaussian(simd, of * field.exponent).store_array(&mut in_plane[lane]);
            of.store_array(&mut squared[lane]);
        }
        // Four points at a time.
        let by_four = along.as_chunks_mut::<SIDE>().0.iter_mut().zip(limits.as_chunks_mut::<SIDE>().0);
        for ((along, limits), rest) in by_four.zip(cubes.rest[2].as_chunks::<SIDE>().0) {
            let [a, b, c, d] = rest.map(|z| f32x4::splat(simd, z));
            let offset = a.combine(b).combine(c.combine(d)) - f32x16::load_array(simd, OFFSETS[0]);
            let squared = offset * offset;
            gaussian(simd, squared * field.exponent).store_slice(along.as_flattened_mut());
            (f32x16::splat(simd, field.radius_squared) - squared).store_slice(limits.as_flattened_mut());
        }
        let [step_y, step_z] = field.steps();
        let zero = f32x16::splat(simd, 0.0);
        let (mut totals, mut sums) = ([[0.0; SIDE]; LANES], [[0.0; SIDE]; LANES]);
        for lane in bits(lanes.into()) {
            let lane = lane as usize;
            let first = cubes.indices[lane] as usize;
            let (mut total, mut sum) = (zero, zero);
            for z in 0..SIDE {
                let squared = f32x16::load_array_ref(simd, &squared[lane]);
                let is_inside = squared.simd_lt(f32x16::splat(simd, limits[lane][z]));
                let in_plane = f32x16::load_array_ref(simd, &in_plane[lane]);
                let weight = is_inside.select(in_plane * along[lane][z], zero);
                weight.store_array(&mut planes[lane][z]);
                total += weight;
                let c = rows(simd, field.coefficients, first + z * step_z, step_y) - field.base;
                sum += weight * c;
            }
            quarters(total).store_array(&mut totals[lane]);
            quarters(sum).store_array(&mut sums[lane]);
        }
        sums_of(simd, &totals).store_array(&mut self.totals);
        (self.cubes, self.at, self.known) = (cubes, at, lanes);
        sums
    }

    /// N by point.
    #[inline(always)]
    pub(super) fn totals<S: Simd>(&self, simd: S) -> f32x8<S> {
        f32x8::load_array_ref(simd, &self.totals)
    }

    /// g of the voxels of one z around a point.
    #[inline(always)]
    fn plane<S: Simd>(&self, simd: S, lane: usize, z: usize) -> f32x16<S> {
        f32x16::load_array_ref(simd, &self.planes[lane][z])
    }

    /// g of a row of voxels along x.
    #[inline(always)]
    fn row<S: Simd>(&self, simd: S, lane: usize, row: usize) -> f32x4<S> {
        let (plane, first) = (&self.planes[lane][row / SIDE], row % SIDE * SIDE);
        f32x4::from_slice(simd, &plane[first..first + SIDE])
    }

    /// A point's cube.
    #[inline(always)]
    fn cube(&self, lane: usize) -> Cube {
        let Eight { cells: [x, y, z], indices, .. } = &self.cubes;
        let first = UVec3::new(x[lane] as u32, y[lane] as u32, z[lane] as u32);
        Cube { first, index: indices[lane] as usize }
    }
}

/// 4×4×4 voxels of a volume.
#[derive(Clone, Copy, Debug)]
struct Cube {
    /// The first voxel, and its index among those at hand.
    first: UVec3,
    index: usize,
}

/// δ along x and y of sixteen voxels around one of eight points.
#[inline(always)]
fn offsets<S: Simd>(simd: S, Eight { rest, .. }: &Eight, lane: usize) -> [f32x16<S>; 2] {
    let of = |axis: usize| f32x16::splat(simd, rest[axis][lane]) - f32x16::load_array(simd, OFFSETS[axis]);
    [of(0), of(1)]
}

impl Field<'_> {
    /// `2·Σ d·g` of a point. Not finite if a hole is near.
    #[inline(always)]
    pub(super) fn cube_differences<S: Simd>(&self, simd: S, weights: &Weights, lane: usize) -> f32x4<S> {
        match self.differences {
            #[cfg(not(target_arch = "wasm32"))]
            Some(Differences::Small(all)) => self.kept_differences(simd, weights, lane, all),
            Some(Differences::Any(all)) => self.kept_differences(simd, weights, lane, all),
            None => self.new_differences(simd, weights, lane),
        }
    }

    /// The same of differences that are kept: x, y and z of a row's four voxels side by side.
    #[inline(always)]
    fn kept_differences<S: Simd, T: Sample>(&self, simd: S, weights: &Weights, lane: usize, all: &[T]) -> f32x4<S> {
        let mut sums = f32x16::splat(simd, 0.0);
        for (row, index) in self.rows_of(&weights.cube(lane)).into_iter().enumerate() {
            let weight = by_difference(simd, weights.row(simd, lane, row));
            sums += weight * four_differences(simd, all, index);
        }
        of_voxels(simd, sums)
    }

    /// The same sums of the same numbers, where differences are not kept.
    #[inline(always)]
    fn new_differences<S: Simd>(&self, simd: S, weights: &Weights, lane: usize) -> f32x4<S> {
        let cube = weights.cube(lane);
        let (values, dims, [step_y, step_z]) = (self.volume.values(), self.extent.dims, self.steps());
        let is_inside = cube.first.cmpgt(UVec3::ZERO).all() && (cube.first + SIDE as u32).cmplt(dims).all();
        let neighbours = Neighbours::of(values, dims, [1, step_y, step_z]);
        let zero = f32x4::splat(simd, 0.0);
        let four = |at: usize| f32x4::load_array(simd, values.run(at));
        let [mut x, mut y, mut z] = [zero; 3];
        for (row, index) in self.rows_of(&cube).into_iter().enumerate() {
            let weight = weights.row(simd, lane, row);
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
        let [a, b, c, d] = transposed([x, y, z, zero]);
        (a + c) + (b + d)
    }

    /// The indices of the first voxels of a cube's rows along x.
    #[inline(always)]
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

    /// `Σ (c - f)·g·δ / N` of one of eight points, given `1 / N`, as [`Self::row_moments`] computes it.
    #[inline(always)]
    pub(super) fn cube_moments<S: Simd>(&self, simd: S, weights: &Weights, lane: usize, per_weight: f32) -> [f32; 3] {
        let [step_y, step_z] = self.steps();
        let first = weights.cube(lane).index;
        // The voxel nearest to the point.
        let near = [0, 1, 2].map(|axis: usize| {
            let rest: f32 = weights.cubes.rest[axis][lane];
            (rest + 0.5).floor().clamp(0.0, SIDE as f32 - 1.0)
        });
        let [x, y, z] = near.map(|steps| steps as usize);
        let nearest = self.coefficients.at(first + x + y * step_y + z * step_z);
        let to = |axis: usize| f32x16::splat(simd, near[axis]) - f32x16::load_array(simd, OFFSETS[axis]);
        let [to_x, to_y] = [to(0), to(1)];
        let zero = f32x16::splat(simd, 0.0);
        let (mut moments, mut offsets, mut sum) = ([zero; 3], [zero; 3], zero);
        for plane in 0..SIDE {
            let c = rows(simd, self.coefficients, first + plane * step_z, step_y) - nearest;
            let weight = weights.plane(simd, lane, plane);
            let weighted = weight * (c * self.scale);
            sum += weighted;
            for (axis, to) in [to_x, to_y, f32x16::splat(simd, near[2] - plane as f32)].into_iter().enumerate() {
                moments[axis] += weighted * to;
                offsets[axis] += weight * to;
            }
        }
        let mean = sum_of(sum) * per_weight;
        [0, 1, 2].map(|axis: usize| (sum_of(moments[axis]) - mean * sum_of(offsets[axis])) * per_weight)
    }

    /// Steps in memory along y and z.
    #[inline(always)]
    fn steps(&self) -> [usize; 2] {
        let [x, y, _] = self.volume.dims().to_array().map(|n| n as usize);
        [x, x * y]
    }
}

/// The number of each of a row's four voxels for each of their three differences.
#[inline(always)]
fn by_difference<S: Simd>(simd: S, four: f32x4<S>) -> f32x16<S> {
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
    let eight = four.combine(four);
    eight.combine(eight).swizzle_dyn_within_blocks(u8x64::load_array_ref(simd, &BYTES))
}

/// The differences of four voxels along x, given the index of the first one, and four numbers more.
#[inline(always)]
fn four_differences<S: Simd, T: Sample>(simd: S, all: &[T], index: usize) -> f32x16<S> {
    let mut numbers = [0.0; 16];
    numbers
        .iter_mut()
        .zip(&all[3 * index..3 * index + 16])
        .for_each(|(number, difference)| *number = difference.to_f32());
    f32x16::load_array(simd, numbers)
}

/// The Gaussian by its exponent of 2.
#[inline(always)]
fn gaussian<S: Simd, V: SimdFloat<S, Element = f32>>(simd: S, exponent: V) -> V {
    exp2(simd, exponent.max(V::splat(simd, -126.0)))
}

/// Four rows of four voxels, given the index of the first one and the step from row to row.
#[inline(always)]
fn rows<S: Simd>(simd: S, all: ValueSlice<'_>, at: usize, step: usize) -> f32x16<S> {
    f32x16::load_array(simd, for_type!(ValueSlice, all, all => side_by_side(all, at, step)))
}

/// Their numbers, side by side before they are converted, so that one instruction converts as many as there are lanes.
#[inline(always)]
fn side_by_side<T: Sample>(all: &[T], at: usize, step: usize) -> [f32; SIDE * SIDE] {
    let row = |at: usize| {
        let row = &all[at..at + SIDE];
        [row[0], row[1], row[2], row[3]]
    };
    let [[a, b, c, d], [e, f, g, h]] = [row(at), row(at + step)];
    let [[i, j, k, l], [m, n, o, p]] = [row(at + 2 * step), row(at + 3 * step)];
    [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p].map(T::to_f32)
}

/// The sums of four voxels' x, y and z, which lie side by side, and some number.
#[inline(always)]
fn of_voxels<S: Simd>(simd: S, numbers: f32x16<S>) -> f32x4<S> {
    let numbers = numbers.to_array();
    let voxel = |at: usize| f32x4::from_slice(simd, &numbers[3 * at..3 * at + 4]);
    (voxel(0) + voxel(2)) + (voxel(1) + voxel(3))
}

/// Four sums of four of sixteen numbers each.
#[inline(always)]
fn quarters<S: Simd>(numbers: f32x16<S>) -> f32x4<S> {
    let (low, high) = numbers.split();
    let (low, high) = (low + high).split();
    low + high
}

/// The sum of sixteen numbers, in the same order on every machine.
#[inline(always)]
fn sum_of<S: Simd>(numbers: f32x16<S>) -> f32 {
    let [a, b, c, d] = quarters(numbers).to_array();
    (a + c) + (b + d)
}

/// The sums of four numbers for each of eight points, in that order.
#[inline(always)]
pub(super) fn sums_of<S: Simd>(simd: S, [a, b, c, d, e, f, g, h]: &[[f32; SIDE]; LANES]) -> f32x8<S> {
    let [first, second, third, fourth] = columns(simd, [a, b, c, d, e, f, g, h]);
    (first + third) + (second + fourth)
}
