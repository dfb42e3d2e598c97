//! Voxels splatted onto slab planes (SPEC §9): `g = exp(-falloff·|δ|²)` where `|δ| < radius`, a pixel at a time, and all planes of a voxel at
//! once. Each pixel's additions come in the order in which voxels do, whatever the vectors' width.

use std::f64::consts::LOG2_E;
use fearless_simd::f32x8;
use fearless_simd::prelude::*;

use super::place::{Place, PlaneMap, Placement};
use super::planes::CHANNELS;
use crate::cpu::cull::{OpenMask, Pixels};
use crate::cpu::reached::Reached;
use crate::cpu::sheets::{self, RING, Ring, SECTIONS, slot_of};
use crate::cpu::splat::order_from;
use crate::cpu::vector::{LANES, exp2};
use crate::settings::shading::Gradient;

/// A voxel on the planes of a tile: up to [`SECTIONS`] of them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Splat {
    /// Which voxel: its brick's number and its place there.
    pub(super) voxel: [u32; 2],
    pub(super) place: Place,
    /// Without an eye its pixel coordinates, the centre of the tile's first pixel at 0, 0, and the pixels that it may reach.
    pub(super) center: [f32; 2],
    pub(super) pixels: Option<Pixels>,
    /// c.
    pub(super) number: f32,
    /// d, for [`Gradient::Differences`].
    pub(super) gradient: [f32; 3],
    /// The first plane that is still to be drawn, and the end.
    pub(super) planes: [i32; 2],
    /// Planes that have been drawn, in units of [`SECTIONS`].
    pub(super) drawn: u32,
}

/// How a kernel lies on a plane, in f32: the offset (a, b) is `(a·dx, b·dx)`, dx being the pixel's offset from the centre.
#[derive(Clone, Copy, Debug)]
struct Footprint {
    center: [f32; 2],
    a: [f32; 2],
    b: [f32; 2],
}

/// How a kernel lies along the planes' normal, by slot.
#[derive(Clone, Copy, Debug)]
struct Along<S: Simd> {
    /// To the planes, grid units.
    t: f32x8<S>,
    /// Their Gaussian.
    gaussian: f32x8<S>,
    /// ρ² from which on the kernel is cut off; 0 in slots without a plane.
    limit: f32x8<S>,
}

/// What all splats of a frame have in common.
#[derive(Clone, Debug)]
pub(super) struct Splatter {
    /// From ρ² to the exponent of 2 of the Gaussian.
    exponent: f32,
    radius_squared: f32,
    /// Grid units along the normal from plane to plane.
    per_plane: f32,
    gradient: Gradient,
    is_perspective: bool,
}

impl Splatter {
    pub(super) fn new(placement: &Placement, falloff: f64, gradient: Gradient) -> Self {
        Self {
            exponent: (-falloff * LOG2_E) as f32,
            radius_squared: (placement.view.radius * placement.view.radius) as f32,
            per_plane: placement.per_plane as f32,
            gradient,
            is_perspective: placement.view.perspective.is_some(),
        }
    }

    /// The number of sums for every pixel of a plane.
    pub(super) fn channels(&self) -> usize {
        match self.gradient {
            Gradient::Differences => 5,
            Gradient::Kernel => CHANNELS,
        }
    }

    /// Adds a voxel's next planes to a tile's; whether any open pixel is in their boxes.
    #[inline(always)]
    pub(super) fn draw<S: Simd>(
        &self,
        simd: S,
        (placement, origin): (&Placement, [usize; 2]),
        splat: &Splat,
        open: &OpenMask,
        (reached, ring): (&mut Reached, &mut Ring),
    ) -> bool {
        let [first, end] = splat.planes;
        let count = ((end - first) as usize).min(SECTIONS);
        let slot = slot_of(first);
        let axes = |map: &PlaneMap| [map.a, map.b].map(|axis| [axis.x as f32, axis.y as f32]);
        let [a, b] = axes(placement.map(first));
        let mut footprints = [Footprint { center: splat.center, a, b }; RING];
        let mut pixels = splat.pixels;
        if self.is_perspective {
            pixels = None;
            for (at, plane) in (first..).take(count).enumerate() {
                let map = placement.map(plane);
                let pixel = placement.center(splat.place, placement.to_plane(splat.place, plane), map);
                let center = [pixel.x - origin[0] as f64 - 0.5, pixel.y - origin[1] as f64 - 0.5].map(|at| at as f32);
                let half_box = [map.half_box.x as f32, map.half_box.y as f32];
                let [a, b] = axes(map);
                footprints[(slot + at) % RING] = Footprint { center, a, b };
                pixels = Pixels::around(pixels, Pixels::within(center, half_box));
            }
        }
        let Some(pixels) = pixels.filter(|pixels| open.sees(pixels)) else { return false };
        let order = order_from(simd, slot);
        let t = order * self.per_plane + placement.to_plane(splat.place, first) as f32;
        let limit = f32x8::splat(simd, self.radius_squared) - t * t;
        let has_plane = order.simd_lt(f32x8::splat(simd, count as f32));
        let limit = has_plane.select(limit, f32x8::splat(simd, 0.0));
        let along = Along { t, gaussian: self.gaussian(simd, t * t), limit };
        match self.is_perspective {
            false => self.draw_flat(simd, splat, (&footprints[0], &along), (&pixels, open), (reached, ring)),
            true => self.draw_local(simd, splat, (&footprints, &along), (&pixels, open), (reached, ring)),
        }
        ring.mark(pixels.columns, pixels.rows, slot, count);
        true
    }

    /// Adds a voxel to planes that share its footprint.
    #[inline(always)]
    fn draw_flat<S: Simd>(
        &self,
        simd: S,
        splat: &Splat,
        (footprint, along): (&Footprint, &Along<S>),
        (pixels, open): (&Pixels, &OpenMask),
        (reached, ring): (&mut Reached, &mut Ring),
    ) {
        let Footprint { center, a, b } = *footprint;
        let limit = f32x8::splat(simd, along.limit.reduce_max());
        reached.list(
            simd,
            center,
            pixels,
            open,
            #[inline(always)]
            move |dx, dy| {
                let (a, b) = (dx * a[0] + dy * a[1], dx * b[0] + dy * b[1]);
                let rho_squared = a * a + b * b;
                (rho_squared.simd_lt(limit), [rho_squared, a, b])
            },
        );
        let Along { t, gaussian, limit } = *along;
        let zero = f32x8::splat(simd, 0.0);
        let [rho_squared, a, b] = &*reached.numbers;
        // Eight pixels at a time, as the compiler then keeps their Gaussians in a vector.
        let mut in_planes = [0.0; LANES];
        let mut sums = Sums::new(simd, self.gradient, splat, ring);
        for (at, &pixel) in reached.pixels[..reached.count].iter().enumerate() {
            if at % LANES == 0 {
                let rho_squared = f32x8::from_slice(simd, &rho_squared[at..at + LANES]);
                in_planes = self.gaussian(simd, rho_squared).to_array();
            }
            let is_inside = f32x8::splat(simd, rho_squared[at]).simd_lt(limit);
            let weights = is_inside.select(gaussian * in_planes[at % LANES], zero);
            let offsets = [f32x8::splat(simd, a[at]), f32x8::splat(simd, b[at]), t];
            sums.add(simd, weights, offsets, pixel);
        }
    }

    /// Adds a voxel to planes on each of which its footprint is another, by slot.
    #[inline(always)]
    fn draw_local<S: Simd>(
        &self,
        simd: S,
        splat: &Splat,
        (footprints, along): (&[Footprint; RING], &Along<S>),
        (pixels, open): (&Pixels, &OpenMask),
        (reached, ring): (&mut Reached, &mut Ring),
    ) {
        let mut rows = [[0.0; RING]; 6];
        for (slot, Footprint { center, a, b }) in footprints.iter().enumerate() {
            let numbers = [center[0], center[1], a[0], a[1], b[0], b[1]];
            for (row, number) in rows.iter_mut().zip(numbers) {
                row[slot] = number;
            }
        }
        let [x, y, ax, ay, bx, by] = rows;
        let (x, y) = (f32x8::load_array(simd, x), f32x8::load_array(simd, y));
        let (ax, ay) = (f32x8::load_array(simd, ax), f32x8::load_array(simd, ay));
        let (bx, by) = (f32x8::load_array(simd, bx), f32x8::load_array(simd, by));
        reached.list(
            simd,
            [0.0; 2],
            pixels,
            open,
            #[inline(always)]
            move |x, y| (x.simd_eq(x), [x, f32x8::splat(simd, y)]),
        );
        let Along { t, gaussian, limit } = *along;
        let zero = f32x8::splat(simd, 0.0);
        let [columns, rows, _] = &*reached.numbers;
        let mut sums = Sums::new(simd, self.gradient, splat, ring);
        for ((&pixel, &column), &row) in reached.pixels[..reached.count].iter().zip(columns).zip(rows) {
            let (dx, dy) = (column - x, row - y);
            let (a, b) = (dx * ax + dy * ay, dx * bx + dy * by);
            let rho_squared = a * a + b * b;
            let weights = self.gaussian(simd, rho_squared) * gaussian;
            sums.add(simd, rho_squared.simd_lt(limit).select(weights, zero), [a, b, t], pixel);
        }
    }

    #[inline(always)]
    fn gaussian<S: Simd>(&self, simd: S, squared: f32x8<S>) -> f32x8<S> {
        exp2(simd, (squared * self.exponent).max(f32x8::splat(simd, -126.0)))
    }
}

/// The sums that a voxel is added to, and its numbers.
enum Sums<'a, S: Simd> {
    /// c and d.
    Differences(&'a mut [[sheets::Sums; 5]], [f32x8<S>; 4]),
    /// c.
    Kernel(&'a mut [[sheets::Sums; CHANNELS]], f32x8<S>),
}

impl<'a, S: Simd> Sums<'a, S> {
    #[inline(always)]
    fn new(simd: S, gradient: Gradient, splat: &Splat, ring: &'a mut Ring) -> Self {
        let number = |number: f32| f32x8::splat(simd, number);
        let (c, [x, y, z]) = (number(splat.number), splat.gradient);
        match gradient {
            Gradient::Differences => Self::Differences(ring.pixels(), [c, number(x), number(y), number(z)]),
            Gradient::Kernel => Self::Kernel(ring.pixels(), c),
        }
    }

    /// Adds the voxel to a pixel on all open planes, given its weights and the offsets there.
    #[inline(always)]
    fn add(&mut self, simd: S, weights: f32x8<S>, [a, b, t]: [f32x8<S>; 3], pixel: u32) {
        match self {
            Self::Differences(sums, numbers) => {
                let [n, rest @ ..] = &mut sums[pixel as usize];
                add(simd, n, weights);
                for at in 0..4 {
                    add(simd, &mut rest[at], weights * numbers[at]);
                }
            }
            Self::Kernel(sums, c) => {
                let [n, f, sa, sb, st, ca, cb, ct] = &mut sums[pixel as usize];
                let (a, b, t) = (weights * a, weights * b, weights * t);
                add(simd, n, weights);
                add(simd, f, weights * *c);
                add(simd, sa, a);
                add(simd, sb, b);
                add(simd, st, t);
                add(simd, ca, a * *c);
                add(simd, cb, b * *c);
                add(simd, ct, t * *c);
            }
        }
    }
}

/// Adds to a pixel's sums for all open planes.
#[inline(always)]
fn add<S: Simd>(simd: S, sheets::Sums(sums): &mut sheets::Sums, numbers: f32x8<S>) {
    (f32x8::load_array_ref(simd, sums) + numbers).store_slice(sums);
}
