//! The field between two planes, classified and shaded there (SPEC §9): it gives the sheet of a slab, eight pixels at a time.

use fearless_simd::f32x8;
use fearless_simd::prelude::*;
use glam::DVec3;

use super::frame::Frame;
use super::planes::{CHANNELS, Planes, STRIDE};
use crate::cpu::cull::{OpenMask, columns_between};
use crate::cpu::cut::TileRays;
use crate::cpu::sheets::{Buffers, COLUMNS, slot_of};
use crate::cpu::vector::LANES;
use crate::settings::shading::Gradient;
use crate::settings::splatting::Compositing;

/// The minimum sum of weights of a point that has a value.
const MIN_WEIGHT: f32 = 1e-3;

/// The field of eight pixels on a plane.
#[derive(Clone, Copy)]
pub(super) struct Sample<S: Simd> {
    sums: [f32x8<S>; CHANNELS],
    /// f, as a number.
    pub(super) value: f32x8<S>,
    /// 1/N.
    per_weight: f32x8<S>,
    /// The pixels that have a value.
    pub(super) has_value: u32,
}

/// The field of eight pixels in a slab.
pub(super) struct Slab<S: Simd> {
    /// k.
    pub(super) number: i32,
    /// The pixels that may show something.
    pub(super) lanes: u32,
    /// f0 and f1, as numbers.
    pub(super) values: [f32x8<S>; 2],
    /// ∇f there, numbers per world unit.
    pub(super) gradients: [[f32x8<S>; 3]; 2],
}

/// The rays of a tile's pixels, as slabs are seen along them.
pub(super) struct Looks<'a> {
    pub(super) origin: [usize; 2],
    pub(super) rays: &'a TileRays,
    /// The stretches of rays that count, as in `rays`.
    pub(super) shown: &'a [[[f32; COLUMNS]; 2]],
    /// To the eye, by row and component, where pixels differ.
    pub(super) to_eye: Option<&'a [[[f32; COLUMNS]; 3]]>,
}

impl<'a> Looks<'a> {
    /// The rays of a tile, given its first pixel; `to_eye` is empty if all pixels share one direction.
    pub(super) fn new(origin: [usize; 2], rays: &'a TileRays, to_eye: &'a [[[f32; COLUMNS]; 3]]) -> Self {
        let to_eye = (!to_eye.is_empty()).then_some(to_eye);
        Self { origin, rays, shown: rays.shown.as_deref().unwrap_or_default(), to_eye }
    }

    /// The stretches of eight pixels' rays that count.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn stretch<S: Simd>(&self, simd: S, [column, row]: [usize; 2]) -> [f32x8<S>; 2] {
        self.shown[row].each_ref().map(|ends| f32x8::from_slice(simd, &ends[column..column + LANES]))
    }

    /// Directions to the eye of eight pixels.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn to_eye<S: Simd>(&self, simd: S, frame: &Frame<'_>, [column, row]: [usize; 2]) -> [f32x8<S>; 3] {
        std::array::from_fn(|axis| match self.to_eye {
            None => f32x8::splat(simd, frame.to_eye[axis]),
            Some(rows) => f32x8::from_slice(simd, &rows[row][axis][column..column + LANES]),
        })
    }

    /// The middles of the stretches of eight rays in a slab, in slabs.
    fn middles(&self, slab: i32, [column, row]: [usize; 2]) -> [f64; LANES] {
        let begin = self.rays.begin(slab);
        let [starts, ends] = &self.shown[row];
        let middle = |at: usize| self.rays.slab((starts[at].max(begin) + ends[at].min(begin + 1.0)) / 2.0);
        std::array::from_fn(|lane| middle(column + lane))
    }
}

impl Frame<'_> {
    /// Classifies the slab between a plane and the next one, into the sheet. The length of rays is left out.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn classify<S: Simd>(
        &self,
        simd: S,
        slab: i32,
        looks: &Looks<'_>,
        planes: &Planes,
        open: &mut OpenMask,
        buffers: &mut Buffers,
    ) {
        let [near, far] = [slab, slab + 1].map(slot_of);
        let mut rows = planes.written[near] | planes.written[far];
        while rows != 0 {
            let row = rows.trailing_zeros() as usize;
            rows &= rows - 1;
            let bits = open.row(row);
            for column in (0..COLUMNS).step_by(LANES) {
                let lanes = (bits & columns_between(column, column + LANES - 1)) >> column;
                if lanes == 0 {
                    continue;
                }
                let at = [looks.origin[0] + column, looks.origin[1] + row];
                let sums = [near, far].map(|slot| &planes.rows[row][slot]);
                let Some(slab) = self.slab(simd, slab, (at, column, lanes), sums) else { continue };
                if self.compositing == Compositing::Surface {
                    let found = self.find_surfaces(simd, &slab, looks, [column, row], buffers);
                    open.close(row, found << column);
                } else if self.sheet(simd, &slab, looks, [column, row], &mut buffers.sheet.rows[row]) {
                    buffers.sheet.written |= 1 << row;
                }
            }
        }
        if self.compositing == Compositing::Surface {
            open.join();
        }
    }

    /// The field of eight pixels in a slab; `None` if none of its values has an opacity.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn slab<S: Simd>(
        &self,
        simd: S,
        number: i32,
        (at, column, lanes): ([usize; 2], usize, u32),
        [near, far]: [&[[f32; STRIDE]; CHANNELS]; 2],
    ) -> Option<Slab<S>> {
        let splat = |number: f32| f32x8::splat(simd, number);
        let near = self.sample(simd, near, column, (at, number));
        let far = self.sample(simd, far, column, (at, number + 1));
        let lanes = lanes & (near.has_value | far.has_value);
        if lanes == 0 {
            return None;
        }
        let [has_near, has_far] = [near.has_value, far.has_value].map(|bits| mask(simd, bits));
        let f0 = has_near.select(near.value, far.value);
        let f1 = has_far.select(far.value, near.value);
        let [low, high] = self.integrals.shown;
        let may_show = f0.max(f1).simd_ge(splat(low)) & f0.min(f1).simd_le(splat(high));
        let lanes = lanes & may_show.to_bitmask() as u32;
        if lanes == 0 {
            return None;
        }
        let [first, second] = [self.gradient(simd, &near), self.gradient(simd, &far)];
        let gradients = [
            std::array::from_fn(|axis| has_near.select(first[axis], second[axis])),
            std::array::from_fn(|axis| has_far.select(second[axis], first[axis])),
        ];
        Some(Slab { number, lanes, values: [f0, f1], gradients })
    }

    /// The sheet of eight pixels; whether any of them shows something.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn sheet<S: Simd>(
        &self,
        simd: S,
        slab: &Slab<S>,
        looks: &Looks<'_>,
        [column, row]: [usize; 2],
        sheet: &mut [[f32; COLUMNS]; 4],
    ) -> bool {
        let at = [looks.origin[0] + column, looks.origin[1] + row];
        let middles = self.labels.then(|| looks.middles(slab.number, [column, row]));
        let label = |lane: usize| middles.and_then(|middles| self.label(at, lane, middles[lane]));
        let values = slab.values.map(f32x8::to_array);
        let means = self.integrals.means(simd, slab.lanes, values, |lane| self.integrals.table(label(lane)));
        let zero = f32x8::splat(simd, 0.0);
        if means.amount.simd_gt(zero).to_bitmask() == 0 {
            return false;
        }
        let (mut amount, mut color) = (means.amount, means.color);
        if self.needs_gradients {
            let [near, far] = slab.gradients;
            let gradient = std::array::from_fn(|axis| near[axis] + (far[axis] - near[axis]) * means.share);
            color = self.shaded(simd, color, gradient, looks.to_eye(simd, self, [column, row]));
            if self.has_gradient_opacity {
                let length = self.length(gradient).to_array();
                let factors: [f32; LANES] = std::array::from_fn(|lane| {
                    let ramp = self.transfer.tables(label(lane)).gradient_opacity;
                    ramp.map_or(1.0, |ramp| ramp.at(f64::from(length[lane])) as f32)
                });
                amount *= f32x8::load_array(simd, factors);
            }
        }
        let amount = mask(simd, slab.lanes).select(amount, zero);
        let [red, green, blue] = color.map(|channel| channel * amount);
        for (channel, pixels) in sheet.iter_mut().zip([red, green, blue, amount]) {
            pixels.store_slice(&mut channel[column..column + LANES]);
        }
        true
    }

    /// Colours shaded by gradients.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn shaded<S: Simd>(
        &self,
        simd: S,
        color: [f32x8<S>; 3],
        gradient: [f32x8<S>; 3],
        to_eye: [f32x8<S>; 3],
    ) -> [f32x8<S>; 3] {
        let splat = |number: f32| f32x8::splat(simd, number);
        let [x, y, z] = gradient;
        let length = (x * x + y * y + z * z).sqrt();
        let is_flat = length.simd_lt(splat(self.min_gradient));
        let per_length = is_flat.select(splat(0.0), splat(-1.0) / is_flat.select(splat(1.0), length));
        self.shader.color(simd, color, gradient.map(|component| component * per_length), to_eye)
    }

    /// The length of gradients, values per world unit.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn length<S: Simd>(&self, [x, y, z]: [f32x8<S>; 3]) -> f32x8<S> {
        (x * x + y * y + z * z).sqrt() * self.per_number
    }

    /// The field of eight pixels on a plane.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn sample<S: Simd>(
        &self,
        simd: S,
        plane: &[[f32; STRIDE]; CHANNELS],
        column: usize,
        (at, number): ([usize; 2], i32),
    ) -> Sample<S> {
        let load = |channel: &[f32; STRIDE]| f32x8::from_slice(simd, &channel[column..column + LANES]);
        let [n, f, x, y, z, ca, cb, ct] = plane;
        let sums = [load(n), load(f), load(x), load(y), load(z), load(ca), load(cb), load(ct)];
        let has_value = sums[0].simd_ge(f32x8::splat(simd, MIN_WEIGHT));
        let one = f32x8::splat(simd, 1.0);
        let per_weight = one / has_value.select(sums[0], one);
        let mut has_value = has_value.to_bitmask() as u32;
        if self.volume.holes() > 0 {
            for lane in 0..LANES {
                if has_value >> lane & 1 == 1 && self.is_hole([at[0] + lane, at[1]], number) {
                    has_value &= !(1 << lane);
                }
            }
        }
        Sample { sums, value: sums[1] * per_weight, per_weight, has_value }
    }

    /// ∇f in numbers per world unit.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn gradient<S: Simd>(&self, simd: S, sample: &Sample<S>) -> [f32x8<S>; 3] {
        let Sample { sums, value, per_weight, .. } = sample;
        match self.gradient {
            Gradient::Differences => [2, 3, 4].map(|channel| sums[channel] * *per_weight),
            Gradient::Kernel => {
                let along = [0, 1, 2].map(|axis| (sums[5 + axis] - *value * sums[2 + axis]) * *per_weight);
                let [a, b, t] = along;
                let is_noise = (a * a + b * b + t * t).simd_lt(f32x8::splat(simd, self.min_moment));
                let along = along.map(|component| is_noise.select(f32x8::splat(simd, 0.0), component));
                self.world_from_plane.map(|row| {
                    let splat = |at: usize| f32x8::splat(simd, row[at]);
                    along[0] * splat(0) + along[1] * splat(1) + along[2] * splat(2)
                })
            }
        }
    }

    /// The label of the voxel whose cell contains a point of a pixel's ray, given by its position among slabs.
    pub(super) fn label(&self, [x, y]: [usize; 2], lane: usize, slab: f64) -> Option<u16> {
        self.volume.label(self.cell([x + lane, y], slab))
    }

    /// Whether the voxel nearest to where a pixel's ray meets a plane is a hole.
    fn is_hole(&self, pixel: [usize; 2], plane: i32) -> bool {
        self.volume.values()[self.cell(pixel, plane.into()) as usize].is_nan()
    }

    /// A place on a pixel's ray, in voxels.
    pub(super) fn voxel_at(&self, pixel: [usize; 2], slab: f64) -> DVec3 {
        let (grid, ray) = (self.volume.grid(), self.rays.rays.of(pixel));
        ray.at(ray.depth(slab)) / grid.aspect() + grid.center()
    }

    /// The value of a number.
    pub(super) fn value(&self, number: f32) -> f64 {
        let numbers = &self.coefficients.numbers;
        numbers.base + f64::from(number) / numbers.scale
    }

    /// The voxel nearest to a place on a pixel's ray.
    fn cell(&self, pixel: [usize; 2], slab: f64) -> u32 {
        let (grid, at) = (self.volume.grid(), self.voxel_at(pixel, slab));
        let last = grid.dims.as_dvec3() - 1.0;
        // Cast, which rounds towards 0.
        grid.index_of((at + 0.5).clamp(DVec3::ZERO, last).as_uvec3())
    }
}

/// Lanes by bits.
#[cfg_attr(not(debug_assertions), inline(always))]
pub(super) fn mask<S: Simd>(simd: S, bits: u32) -> fearless_simd::mask32x8<S> {
    fearless_simd::mask32x8::from_bitmask(simd, bits.into())
}
