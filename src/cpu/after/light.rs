//! The light that light sheets leave at points of pixels' rays (SPEC §14).

use fearless_simd::f32x8;
use fearless_simd::prelude::*;
use glam::DVec4;

use super::classify::Looks;
use super::frame::Frame;
use super::planes::{Plane, Points};
use crate::cpu::count::bits;
use crate::cpu::vector::LANES;
use crate::light::{Left, LightStack, Lights};

impl Frame<'_> {
    /// A and S of some of eight pixels at a share of the way between a slab's planes; 1 of others.
    #[inline(always)]
    pub(super) fn left_between<S: Simd>(
        &self,
        simd: S,
        lanes: u32,
        (looks, planes): (&Looks<'_>, &[Plane; 2]),
        [column, row]: [usize; 2],
        share: f32x8<S>,
    ) -> [f32x8<S>; 2] {
        let Some(lights) = &self.lights else { return [f32x8::splat(simd, 1.0); 2] };
        let [near, far] = planes.each_ref().map(|plane| plane.points.as_ref().map(|(points, _)| points));
        let (Some(near), Some(far)) = (near, far) else {
            // A plane at the eye has no points, but the slab behind it has light.
            let (first, shares) = (f64::from(planes[0].number), share.to_array());
            return self.left(simd, lanes, looks, [column, row], |lane| first + f64::from(shares[lane]));
        };
        let left = look_up(lights, lanes, [near, far], [column, row], &share.to_array());
        [f32x8::load_array(simd, left[0]), f32x8::load_array(simd, left[1])]
    }

    /// A and S of some of eight pixels, given the places of their points among slabs; 1 of others.
    #[inline(always)]
    pub(super) fn left<S: Simd>(
        &self,
        simd: S,
        lanes: u32,
        looks: &Looks<'_>,
        [column, row]: [usize; 2],
        slab: impl Fn(usize) -> f64,
    ) -> [f32x8<S>; 2] {
        let mut left = [[1.0; LANES]; 2];
        if let Some(lights) = &self.lights {
            for lane in bits(lanes.into()).map(|lane| lane as usize) {
                let pixel = [looks.origin[0] + column + lane, looks.origin[1] + row];
                let Left { ambient, direct } = lights.left(self.voxel_at(pixel, slab(lane)));
                (left[0][lane], left[1][lane]) = (ambient, direct);
            }
        }
        [f32x8::load_array(simd, left[0]), f32x8::load_array(simd, left[1])]
    }
}

/// A and S of some of eight pixels between their points on two planes. Places among light sheets are linear in the pixel and in the share of the way.
// Not inlined, so that it is compiled once for all instruction sets.
#[inline(never)]
fn look_up(
    lights: &Lights,
    lanes: u32,
    [near, far]: [&Points; 2],
    [column, row]: [usize; 2],
    shares: &[f32; LANES],
) -> [[f32; LANES]; 2] {
    let mut left = [[1.0; LANES]; 2];
    let (first, last) = (near.of(column, row), far.of(column, row));
    let (way, turn) = (last - first, far.right - near.right);
    for (left, stack) in left.iter_mut().zip([&lights.occlusion, &lights.shadow]) {
        let Some(LightStack { amount, sheets, rows }) = stack else { continue };
        let mut places = [[0.0; LANES]; 3];
        for (places, row) in places.iter_mut().zip(rows) {
            let of = |vector: DVec4| row.dot(vector) as f32;
            let (start, right) = (of(first.extend(1.0)), of(near.right.extend(0.0)));
            let (along, turned) = (of(way.extend(0.0)), of(turn.extend(0.0)));
            for (lane, (place, share)) in places.iter_mut().zip(shares).enumerate() {
                *place = start + right * lane as f32 + share * (along + turned * lane as f32);
            }
        }
        for lane in bits(lanes.into()).map(|lane| lane as usize) {
            left[lane] = 1.0 - amount * (1.0 - sheets.at_place(places.map(|axis| axis[lane])));
        }
    }
    left
}
