//! The chunks of a store that a slab needs: those with a voxel near enough to a point of an open pixel's ray on one of the slab's planes.

use std::sync::Arc;

use glam::{DVec3, UVec3};

use super::extent::RIM;
use super::frame::Frame;
use super::low_pass::LowPass;
use super::planes::Points;
use super::tile::pixels_of;
use crate::cpu::cull::{OpenMask, Pixels, columns_between};
use crate::cpu::stream::Stream;

/// Voxels around boxes for rounding in f32.
const SLACK: f64 = 0.02;

/// A slab of a tile's open pixels.
pub(super) struct Needs<'a> {
    frame: &'a Frame<'a>,
    stream: &'a Arc<Stream>,
    open: &'a OpenMask,
    slab: i32,
    /// The tile's first pixel.
    origin: [usize; 2],
    planes: [Option<(Points, LowPass)>; 2],
    half_box: DVec3,
}

impl<'a> Needs<'a> {
    pub(super) fn new(
        frame: &'a Frame<'a>,
        stream: &'a Arc<Stream>,
        slab: i32,
        origin: [usize; 2],
        open: &'a OpenMask,
    ) -> Self {
        let planes = [slab, slab + 1].map(|plane| frame.points(plane, origin));
        let half_box = frame.placement.geometry.widest_half_box(&frame.placement.view);
        Self { frame, stream, open, slab, origin, planes, half_box }
    }

    /// Whether the slab needs voxels of a chunk, given by its number.
    pub(super) fn chunk(&self, number: u32) -> bool {
        let Self { frame, stream, open, slab, origin, half_box, .. } = self;
        let chunk = stream.bounds(number);
        let (on_screen, within) = frame.placement.bounds(self.around(chunk, *half_box + RIM));
        let Some(pixels) = within.contains(slab).then(|| pixels_of(*origin, on_screen)).flatten() else {
            return false;
        };
        if !(open.sees(&pixels) && self.reaches(chunk, &pixels)) {
            return false;
        }
        // As bricks in memory are left out: no value between those within two kernels and a slab may have an opacity.
        if stream.is_unread(number) {
            return true;
        }
        let (low, end) = self.around(chunk, *half_box * 2.0 + frame.placement.slab_step() + RIM);
        !stream.range((low, end - low)).is_some_and(|range| frame.is_dark(range))
    }

    /// A box, given by its first voxel and its voxels along each axis, with the voxels around it: the first one, and the one behind the last.
    fn around(&self, (low, dims): (UVec3, UVec3), reach: DVec3) -> (UVec3, UVec3) {
        let all = self.frame.grid.dims;
        let reach = reach.ceil().min(all.as_dvec3()).as_uvec3();
        (low.saturating_sub(reach), (low + dims + reach).min(all))
    }

    /// Whether an open one of some pixels has a point on one of the planes whose value or gradient needs a voxel of a chunk.
    fn reaches(&self, (low, dims): (UVec3, UVec3), pixels: &Pixels) -> bool {
        let Self { frame, open, .. } = self;
        let has_gradient = frame.needs_gradients || frame.compositing.is_by_means();
        let all = frame.grid.dims.as_dvec3();
        let beyond = frame.placement.slab_step() + 0.5 + SLACK;
        self.planes.iter().flatten().any(|(points, low_pass)| {
            let reach = frame.field.reach(low_pass.half_box, has_gradient) + SLACK;
            let (low, high) = (low.as_dvec3() - reach, (low + dims - 1).as_dvec3() + reach);
            // Points near a border, and up to a slab beyond it, have the cube of the nearest point inside that has four voxels along each axis.
            let low = DVec3::select(low.cmple(DVec3::splat(2.0)), -beyond, low);
            let high = DVec3::select(high.cmpge(all - 4.0), all - 1.0 + beyond, high);
            meets(points, [low, high], pixels, open)
        })
    }
}

/// Whether the point of an open pixel, one of some pixels, lies in a box.
fn meets(points: &Points, [low, high]: [DVec3; 2], pixels: &Pixels, open: &OpenMask) -> bool {
    let [left, right] = pixels.columns;
    let is_met = |row: usize| {
        let first = points.of(0, row);
        let (mut from, mut to) = (left as f64, right as f64);
        for axis in 0..3 {
            let step = points.right[axis];
            let ends = [low[axis] - first[axis], high[axis] - first[axis]];
            // A step that is not 0, but moves no point of a tile by more than rounding does.
            if step.abs() < 1e-9 {
                if ends[0] > SLACK || ends[1] < -SLACK {
                    return false;
                }
                continue;
            }
            let ends = ends.map(|end| end / step);
            (from, to) = (from.max(ends[0].min(ends[1])), to.min(ends[0].max(ends[1])));
        }
        let (from, to) = ((from - 1e-6).ceil().max(left as f64), (to + 1e-6).floor().min(right as f64));
        from <= to && open.row(row) & columns_between(from as usize, to as usize) != 0
    };
    (pixels.rows[0]..=pixels.rows[1]).any(is_met)
}
