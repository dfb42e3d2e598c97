//! Voxels splatted onto slab planes (SPEC §9): `g = exp(-falloff·|δ|²)` where `|δ| < radius`, eight pixels at a time, and all planes of a voxel
//! for them. Each pixel's additions come in the order in which voxels do, whatever the vectors' width.

use std::f64::consts::LOG2_E;
use std::ops::Range;

use fearless_simd::f32x8;
use fearless_simd::prelude::*;
use glam::DVec2;

use super::place::{Place, Placement};
use super::planes::{PlaneRow, Planes, STRIDE};
use crate::cpu::cull::{OpenMask, Pixels, columns_between};
use crate::cpu::sheets::{COLUMNS, RING, SECTIONS, slot_of};
use crate::cpu::vector::{LANES, exp2, iota};
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

/// The map of a plane in f32: the offset (a, b) is `(a·dx, b·dx)`, with dx the pixel's offset from the centre.
#[derive(Clone, Copy, Debug)]
struct Footprint {
    center: [f32; 2],
    a: [f32; 2],
    b: [f32; 2],
}

/// The positions of a kernel along the planes' normal, by plane.
#[derive(Clone, Copy, Debug)]
struct Along {
    /// To the planes, grid units.
    t: [f32; LANES],
    /// Their Gaussian.
    gaussian: [f32; LANES],
    /// ρ² from which on the kernel is cut off.
    limit: [f32; LANES],
}

/// Some planes of a splat, from the one of a slot on.
#[derive(Clone, Copy, Debug)]
struct OnPlanes<'a> {
    footprint: &'a Footprint,
    along: &'a Along,
    planes: [usize; 2],
    slot: usize,
}

/// The data that all splats of a frame share.
#[derive(Clone, Debug)]
pub(super) struct Splatter {
    /// From ρ² to the exponent of 2 of the Gaussian.
    exponent: f32,
    radius_squared: f32,
    /// Grid units along the normal from plane to plane.
    per_plane: f32,
    gradient: Gradient,
    is_perspective: bool,
    /// The part of ρ² that a row's offset alone makes sure of, by its square; 0 with an eye.
    row_metric: f32,
}

impl Splatter {
    pub(super) fn new(placement: &Placement, falloff: f64, gradient: Gradient) -> Self {
        let is_perspective = placement.view.perspective.is_some();
        let row_metric = if is_perspective {
            0.0
        } else {
            let map = placement.map(0);
            let (xx, xy) = (map.a.x * map.a.x + map.b.x * map.b.x, map.a.x * map.a.y + map.b.x * map.b.y);
            let yy = map.a.y * map.a.y + map.b.y * map.b.y;
            (yy - xy * xy / xx).max(0.0)
        };
        Self {
            exponent: (-falloff * LOG2_E) as f32,
            radius_squared: (placement.view.radius * placement.view.radius) as f32,
            per_plane: placement.per_plane as f32,
            gradient,
            is_perspective,
            // Slightly less, because f32 rounds.
            row_metric: ((1.0 - 1e-5) * row_metric) as f32,
        }
    }

    /// Adds a voxel's next planes to a tile's; whether any open pixel is in their boxes.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn draw<S: Simd>(
        &self,
        simd: S,
        (placement, origin): (&Placement, [usize; 2]),
        splat: &Splat,
        open: &OpenMask,
        planes: &mut Planes,
    ) -> bool {
        let [first, end] = splat.planes;
        let count = ((end - first) as usize).min(SECTIONS);
        let t = iota(simd) * self.per_plane + placement.to_plane(splat.place, first) as f32;
        let squared = t * t;
        let along = Along {
            t: t.to_array(),
            gaussian: self.gaussian(simd, squared).to_array(),
            limit: (self.radius_squared - squared).to_array(),
        };
        let slot = slot_of(first);
        if !self.is_perspective {
            // All planes have the same footprint.
            return self.draw_planes(simd, (placement, origin), splat, (&along, slot, [0, count]), open, planes);
        }
        let mut is_seen = false;
        for at in 0..count {
            is_seen |= self.draw_planes(simd, (placement, origin), splat, (&along, slot, [at, at + 1]), open, planes);
        }
        is_seen
    }

    /// Adds a voxel to planes that share its footprint, given by their first and their end after the splat's first plane, which is in a slot.
    // Inlined, as vectors of a closure would be computed by calls.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn draw_planes<S: Simd>(
        &self,
        simd: S,
        (placement, origin): (&Placement, [usize; 2]),
        splat: &Splat,
        (along, slot, on): (&Along, usize, [usize; 2]),
        open: &OpenMask,
        planes: &mut Planes,
    ) -> bool {
        let plane = splat.planes[0] + on[0] as i32;
        let map = placement.map(plane);
        let in_f32 = |v: DVec2| [v.x as f32, v.y as f32];
        let (mut center, mut pixels) = (splat.center, splat.pixels);
        if self.is_perspective {
            let pixel = placement.center(splat.place, placement.to_plane(splat.place, plane), map);
            center = [pixel.x - origin[0] as f64 - 0.5, pixel.y - origin[1] as f64 - 0.5].map(|at| at as f32);
            pixels = Pixels::within(center, in_f32(map.half_box));
        }
        let Some(pixels) = pixels.filter(|pixels| open.sees(pixels)) else { return false };
        let footprint = Footprint { center, a: in_f32(map.a), b: in_f32(map.b) };
        let on_planes = OnPlanes { footprint: &footprint, along, planes: on, slot };
        let written = self.draw_box(simd, splat, &on_planes, &pixels, open, planes);
        for at in on[0]..on[1] {
            planes.written[(slot + at) % RING] |= written;
        }
        true
    }

    /// Adds a voxel to the open pixels of a box on planes that share their footprint; the rows that hold anything now.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn draw_box<S: Simd>(
        &self,
        simd: S,
        splat: &Splat,
        on_planes: &OnPlanes<'_>,
        pixels: &Pixels,
        open: &OpenMask,
        planes: &mut Planes,
    ) -> u64 {
        let Pixels { columns: [left, right], rows: [first, last] } = *pixels;
        let mut written = 0;
        for row in first..=last {
            let open = open.row(row);
            let target = &mut planes.rows[row];
            let mut column = left;
            while column <= right {
                let end = (column + LANES - 1).min(COLUMNS - 1);
                if open & columns_between(column, end) != 0 {
                    written |= 1 << row;
                    match self.gradient {
                        Gradient::Differences => {
                            self.draw_differences(simd, splat, on_planes, [column, row], target);
                        }
                        Gradient::Kernel => self.draw_offsets(simd, splat, on_planes, [column, row], target),
                    }
                }
                column += LANES;
            }
        }
        written
    }

    /// Offsets along the planes' axes, and ρ², of eight pixels.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn offsets<S: Simd>(&self, simd: S, footprint: &Footprint, [column, row]: [usize; 2]) -> [f32x8<S>; 3] {
        let Footprint { center, a, b } = footprint;
        let dy = row as f32 - center[1];
        let dx = iota(simd) + (column as f32 - center[0]);
        let (a, b) = (dx * a[0] + dy * a[1], dx * b[0] + dy * b[1]);
        [a, b, a * a + b * b]
    }

    #[cfg_attr(not(debug_assertions), inline(always))]
    fn gaussian<S: Simd>(&self, simd: S, squared: f32x8<S>) -> f32x8<S> {
        exp2(simd, (squared * self.exponent).max(f32x8::splat(simd, -126.0)))
    }

    /// The planes from the first to the last that a row may reach.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn reached(&self, on_planes: &OnPlanes<'_>, row: usize) -> Range<usize> {
        let OnPlanes { footprint, along, planes: [mut first, mut end], .. } = *on_planes;
        if !self.is_perspective {
            let dy = row as f32 - footprint.center[1];
            let nearest = self.row_metric * dy * dy;
            while first < end && along.limit[first % LANES] <= nearest {
                first += 1;
            }
            while first < end && along.limit[(end - 1) % LANES] <= nearest {
                end -= 1;
            }
        }
        first..end
    }

    #[cfg_attr(not(debug_assertions), inline(always))]
    fn draw_differences<S: Simd>(
        &self,
        simd: S,
        splat: &Splat,
        on_planes: &OnPlanes<'_>,
        at: [usize; 2],
        target: &mut PlaneRow,
    ) {
        let [_, _, rho_squared] = self.offsets(simd, on_planes.footprint, at);
        let in_plane = self.gaussian(simd, rho_squared);
        let (zero, along) = (f32x8::splat(simd, 0.0), on_planes.along);
        let [dx, dy, dz] = splat.gradient;
        for plane in self.reached(on_planes, at[1]) {
            let is_inside = rho_squared.simd_lt(f32x8::splat(simd, along.limit[plane % LANES]));
            let weights = is_inside.select(in_plane * along.gaussian[plane % LANES], zero).to_array();
            let plane = &mut target[(on_planes.slot + plane) % RING];
            let column = at[0].min(COLUMNS);
            for (channel, factor) in plane.iter_mut().zip([1.0, splat.number, dx, dy, dz]) {
                add(channel, column, |lane| weights[lane] * factor);
            }
        }
    }

    #[cfg_attr(not(debug_assertions), inline(always))]
    fn draw_offsets<S: Simd>(
        &self,
        simd: S,
        splat: &Splat,
        on_planes: &OnPlanes<'_>,
        at: [usize; 2],
        target: &mut PlaneRow,
    ) {
        let [a, b, rho_squared] = self.offsets(simd, on_planes.footprint, at);
        let in_plane = self.gaussian(simd, rho_squared);
        let (zero, along) = (f32x8::splat(simd, 0.0), on_planes.along);
        for plane in self.reached(on_planes, at[1]) {
            let is_inside = rho_squared.simd_lt(f32x8::splat(simd, along.limit[plane % LANES]));
            let weights = is_inside.select(in_plane * along.gaussian[plane % LANES], zero);
            let offsets = [weights * a, weights * b, weights * along.t[plane % LANES]].map(f32x8::to_array);
            let weights = weights.to_array();
            let [n, f, a, b, t, ca, cb, ct] = &mut target[(on_planes.slot + plane) % RING];
            let (column, c) = (at[0].min(COLUMNS), splat.number);
            add(n, column, |lane| weights[lane]);
            add(f, column, |lane| weights[lane] * c);
            for ((plain, times_c), offsets) in [(a, ca), (b, cb), (t, ct)].into_iter().zip(offsets) {
                add(plain, column, |lane| offsets[lane]);
                add(times_c, column, |lane| offsets[lane] * c);
            }
        }
    }
}

/// Adds to eight pixels of a row. Numbers one by one, which the compiler makes vectors of: loading one by `f32x8` goes through a copy on the
/// stack.
#[cfg_attr(not(debug_assertions), inline(always))]
fn add(row: &mut [f32; STRIDE], column: usize, number: impl Fn(usize) -> f32) {
    if let Some(pixels) = row[column..].first_chunk_mut::<LANES>() {
        for (lane, pixel) in pixels.iter_mut().enumerate() {
            *pixel += number(lane);
        }
    }
}
