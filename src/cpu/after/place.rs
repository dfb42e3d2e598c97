//! Where the cells of bricks lie in a view, in f64: on the screen and among slabs; and the planes that voxels' kernels reach (SPEC §9).

use std::ops::Range;

use fearless_simd::prelude::*;
use fearless_simd::{f64x4, mask64x4};
use glam::{DVec2, DVec3, UVec3};

use crate::cpu::bin::Placed;
use crate::cpu::project::floor;
use crate::cpu::queue::BySlot;
use crate::cpu::sheets::{COLUMNS, ROWS};
use crate::geometry::plane_geometry::PlaneGeometry;
use crate::geometry::slab;
use crate::geometry::view_geometry::ViewGeometry;
use crate::lists::brick::{self, Brick};
use crate::parallel::prelude::*;
use crate::volume::Grid;

/// Pixels around boxes, and slabs around their depths, for rounding.
const SLACK: f64 = 0.02;

/// The slab planes of a view, and how the grid lies before them.
#[derive(Clone, Debug)]
pub(super) struct Placement {
    pub(super) geometry: PlaneGeometry,
    pub(super) view: ViewGeometry,
    grid: Grid,
    /// The slabs that are drawn.
    drawn: Range<i32>,
    /// The longest step from plane to plane on any ray, in voxels.
    slab_step: DVec3,
    /// Planes that a kernel reaches to either side of its voxel.
    reach: f64,
    /// The depths of a brick's voxels relative to its first voxel, by slot, in slabs.
    depths: BySlot<f64>,
}

/// A box on the screen, pixels: its min and max corner.
pub(super) type ScreenBox = [DVec2; 2];

impl Placement {
    /// The grid before some slabs of a view.
    pub(super) fn new(view: ViewGeometry, grid: &Grid, slabs: &Range<i32>) -> Self {
        let geometry = PlaneGeometry::new(&view, grid);
        let row = view.screen_from_voxel[2].truncate() / view.slabs.width;
        Self {
            slab_step: geometry.slab_step(&view),
            reach: view.radius / (geometry.per_depth * view.slabs.width),
            depths: std::array::from_fn(|slot| row.dot(brick::in_brick(slot as u32).as_dvec3())),
            grid: *grid,
            drawn: slabs.clone(),
            geometry,
            view,
        }
    }

    /// The number of planes within a kernel's radius of each of a brick's voxels, in all.
    #[inline(always)]
    pub(super) fn sections<S: Simd>(&self, simd: S, brick: &Brick) -> u64 {
        let row = self.view.screen_from_voxel[2];
        let first =
            (row.dot(brick::origin(brick).as_dvec3().extend(1.0)) - self.view.slabs.origin) / self.view.slabs.width;
        let splat = |number: f64| f64x4::splat(simd, number);
        let nearest = splat(if self.view.perspective.is_some() { 1.0 } else { f64::NEG_INFINITY });
        let (zero, present) = (splat(0.0), brick::present(brick));
        let mut count = zero;
        for slot in (0..self.depths.len()).step_by(4) {
            let depth = f64x4::from_slice(simd, &self.depths[slot..slot + 4]) + first;
            let start = ((depth - self.reach + slab::ROUNDING).floor() + 1.0).max(nearest);
            let end = (depth + self.reach - slab::ROUNDING).ceil();
            let is_present = mask64x4::from_bitmask(simd, present >> slot & 0xf);
            count += is_present.select((end - start).max(zero), zero);
        }
        let [a, b, c, d] = count.to_array();
        (a + b + c + d) as u64
    }

    /// The pixels that the cells of some voxels may be on, from one to before another, and the slabs, of those that are drawn. Voxels at the volume's border have the points
    /// before it too that are nearest to them, up to a slab away.
    pub(super) fn bounds(&self, (low, end): (UVec3, UVec3)) -> (ScreenBox, Range<i32>) {
        let dims = self.grid.dims;
        let before = DVec3::select(low.cmpeq(UVec3::ZERO), self.slab_step, DVec3::ZERO);
        let behind = DVec3::select(end.cmpeq(dims), self.slab_step, DVec3::ZERO);
        let (low, high) = (low.as_dvec3() - 0.5 - before, end.as_dvec3() - 0.5 + behind);
        let (middle, half) = ((low + high) / 2.0, (high - low) / 2.0);
        let rows = self.view.screen_from_voxel;
        let [x, y, depth, from_eye] = rows.map(|row| row.dot(middle.extend(1.0)));
        let [dx, dy, spread, eye_spread] = rows.map(|row| row.truncate().abs().dot(half));
        let slabs =
            [depth - spread, depth + spread].map(|depth| (depth - self.view.slabs.origin) / self.view.slabs.width);
        let nearest = if self.view.perspective.is_some() { 0 } else { i32::MIN };
        let (first, end) = (floor(slabs[0] - SLACK).max(nearest), floor(slabs[1] + SLACK) + 1);
        let slabs = first.max(self.drawn.start)..end.min(self.drawn.end);
        let (at, across) = (DVec2::new(x, y), DVec2::new(dx, dy));
        let ends = [from_eye - eye_spread, from_eye + eye_spread];
        if ends[0] <= 1e-6 * ends[1] {
            return ([DVec2::NEG_INFINITY, DVec2::INFINITY], slabs);
        }
        let middle = DVec2::from(self.view.size.map(f64::from)) / 2.0;
        let low = ((at - across) / ends[0]).min((at - across) / ends[1]);
        let high = ((at + across) / ends[0]).max((at + across) / ends[1]);
        ([low + middle - SLACK, high + middle + SLACK], slabs)
    }

    /// The boxes of voxels, given by their numbers, that may be on the image. `bounds` tells a box's first voxel, and the one
    /// after the last.
    pub(super) fn place(&self, boxes: &[u32], bounds: impl Fn(u32) -> (UVec3, UVec3) + Sync) -> Vec<Placed> {
        let place = |&number: &u32| {
            let ([low, high], slabs) = self.bounds(bounds(number));
            let tiles = |axis: usize, side: usize| {
                let low = (low[axis] - 0.5).max(0.0);
                let high = (high[axis] - 0.5).min(f64::from(self.view.size[axis]) - 1.0);
                (low <= high).then(|| [low, high].map(|pixel| (pixel as usize / side) as u16))
            };
            let (columns, rows) = (tiles(0, COLUMNS)?, tiles(1, ROWS)?);
            let placed = Placed {
                brick: number,
                channel: 0,
                first: slabs.start,
                end: slabs.end,
                half_box: [0.0; 2],
                middle: [0.0; 2],
                half: [0.0; 2],
                columns,
                rows,
            };
            (!slabs.is_empty()).then_some(placed)
        };
        boxes.par_iter().filter_map(place).collect()
    }

    /// The longest step from plane to plane on any ray, in voxels.
    pub(super) fn slab_step(&self) -> DVec3 {
        self.slab_step
    }

    /// The number of a voxel's brick.
    #[inline(always)]
    pub(super) fn brick_of(&self, voxel: [u32; 3]) -> u32 {
        let across = self.bricks();
        let [x, y, z] = voxel.map(|n| n / brick::SIDE);
        x + across.x * (y + across.y * z)
    }

    /// The number of the grid's bricks along each axis.
    pub(super) fn bricks(&self) -> UVec3 {
        brick::bricks_per_axis(&self.grid)
    }
}
