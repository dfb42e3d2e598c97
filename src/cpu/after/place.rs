//! The positions of voxels' kernels on the slab planes of a view, in f64 (SPEC §9): the planes they reach, and the pixels around which they do.

use std::ops::Range;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::cpu::bin::Placed;
use crate::cpu::project::floor;
use crate::cpu::queue::{BySlot, NO_SHEET};
use crate::cpu::sheets::{COLUMNS, ROWS};
use crate::cpu::vector::LANES;
use crate::geometry::plane_geometry::PlaneGeometry;
use crate::geometry::slab;
use crate::geometry::view_geometry::ViewGeometry;

use crate::lists::brick::Brick;
use crate::lists::brick::{self, BRICK_VOXELS};
use crate::volume::Grid;

/// Pixels around boxes, for rounding in f32.
const SLACK: f64 = 0.02;

/// The position of a voxel. Depths are counted in planes: plane k is at depth k.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// Pixel coordinates times the depth from the eye, from the image's middle; without an eye that depth is 1.
    pub(super) at: DVec2,
    pub(super) depth: f64,
}

/// The map from a pixel's offset on a plane to grid units along the plane's two axes: a = `a·(dx, dy)` and b = `b·(dx, dy)`.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlaneMap {
    /// The plane's depth from the eye, `unit`s; 1 without an eye.
    pub(super) from_eye: f64,
    pub(super) a: DVec2,
    pub(super) b: DVec2,
    /// Half the box around a kernel of the whole radius, pixels.
    pub(super) half_box: DVec2,
}

/// The slab planes of a view, and how voxels lie before them.
#[derive(Clone, Debug)]
pub(super) struct Placement {
    pub(super) geometry: PlaneGeometry,
    pub(super) view: ViewGeometry,
    /// Grid units along the planes' normal from plane to plane.
    pub(super) per_plane: f64,
    /// Planes that a kernel reaches to either side of its voxel.
    reach: f64,
    /// The planes that are drawn.
    drawn: Range<i32>,
    /// The positions of a brick's voxels relative to its first voxel, by slot.
    x: BySlot<f64>,
    y: BySlot<f64>,
    depth: BySlot<f64>,
    /// The maps of the planes that the volume's kernels reach, from the first on; without an eye a single one, because all are equal.
    maps: Vec<PlaneMap>,
    first_map: i32,
}

/// A box on the screen, pixels: its min and max corner.
pub(super) type ScreenBox = [DVec2; 2];

impl Placement {
    /// The planes of some slabs of a view.
    pub(super) fn new(view: ViewGeometry, grid: &Grid, slabs: &Range<i32>) -> Self {
        let geometry = PlaneGeometry::new(&view, grid);
        let per_plane = geometry.per_depth * view.slabs.width;
        let reach = view.radius / per_plane;
        let offset = |row: usize, slot: usize| {
            view.screen_from_voxel[row].truncate().dot(brick::in_brick(slot as u32).as_dvec3())
        };
        let [x, y] = [0, 1].map(|row| std::array::from_fn(|slot| offset(row, slot)));
        let depth = std::array::from_fn(|slot| offset(2, slot) / view.slabs.width);
        let drawn = if slabs.is_empty() { 0..0 } else { slabs.start..slabs.end + 1 };
        let maps = Vec::new();
        let mut placement = Self { geometry, reach, drawn, per_plane, view, x, y, depth, maps, first_map: 0 };
        let (middle, half) = (grid.center(), grid.center());
        let Place { depth, .. } = placement.of(middle);
        let spread = view.screen_from_voxel[2].truncate().abs().dot(half) / view.slabs.width;
        // One more plane on either side, for rounding.
        let planes = placement.planes(depth - spread - 1.0..depth + spread + 1.0);
        let planes = if view.perspective.is_some() { planes } else { 0..1 };
        placement.maps = planes.clone().map(|plane| placement.new_map(plane)).collect();
        placement.first_map = planes.start;
        placement
    }

    fn of(&self, voxel: DVec3) -> Place {
        let [x, y, depth, _] = self.view.screen_from_voxel.map(|row| row.dot(voxel.extend(1.0)));
        Place { at: DVec2::new(x, y), depth: (depth - self.view.slabs.origin) / self.view.slabs.width }
    }

    /// The position of a brick's first voxel.
    pub(super) fn of_brick(&self, brick: &Brick) -> Place {
        self.of(brick::origin(brick).as_dvec3())
    }

    /// The position of one of a brick's voxels.
    pub(super) fn of_voxel(&self, brick: Place, slot: u32) -> Place {
        let slot = slot as usize;
        Place { at: brick.at + DVec2::new(self.x[slot], self.y[slot]), depth: brick.depth + self.depth[slot] }
    }

    /// Without an eye, pixel coordinates of a brick's voxels in eight slots, from the first on, in a tile given by its first pixel. The centre of
    /// that is at 0, 0.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn centers(&self, brick: Place, first: usize, origin: [usize; 2]) -> [[f32; LANES]; 2] {
        let middle = self.middle();
        let (shift_x, shift_y) = (middle.x - 0.5 - origin[0] as f64, middle.y - 0.5 - origin[1] as f64);
        let (x, y) = (&self.x[first..first + LANES], &self.y[first..first + LANES]);
        let mut centers = [[0.0; LANES]; 2];
        let [columns, rows] = &mut centers;
        for ((column, row), (x, y)) in columns.iter_mut().zip(rows).zip(x.iter().zip(y)) {
            *column = (brick.at.x + x + shift_x) as f32;
            *row = (brick.at.y + y + shift_y) as f32;
        }
        centers
    }

    /// The first planes of voxels in all slots of a brick; [`NO_SHEET`] for none.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn first_planes(&self, brick: Place) -> BySlot<i32> {
        let mut firsts = [NO_SHEET; BRICK_VOXELS as usize];
        for (first, offset) in firsts.iter_mut().zip(&self.depth) {
            let depth = brick.depth + offset;
            let planes = self.planes(depth..depth);
            *first = if planes.start < planes.end { planes.start } else { NO_SHEET };
        }
        firsts
    }

    /// The planes within a kernel's radius of voxels between two depths, of those that are drawn; none at the eye or behind it.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn planes(&self, depths: Range<f64>) -> Range<i32> {
        let first = floor(depths.start - self.reach + slab::ROUNDING) + 1;
        let end = -floor(-(depths.end + self.reach - slab::ROUNDING));
        let first = if self.view.perspective.is_some() { first.max(1) } else { first };
        first.max(self.drawn.start)..end.min(self.drawn.end)
    }

    /// From a voxel to a plane, grid units along the normal.
    pub(super) fn to_plane(&self, place: Place, plane: i32) -> f64 {
        (f64::from(plane) - place.depth) * self.per_plane
    }

    /// The kept map of a plane that a kernel may reach.
    pub(super) fn map(&self, plane: i32) -> &PlaneMap {
        let at = if self.view.perspective.is_some() { plane - self.first_map } else { 0 };
        &self.maps[at as usize]
    }

    /// The map of a plane, by the low-pass rule.
    fn new_map(&self, plane: i32) -> PlaneMap {
        let PlaneGeometry { screen_axis, per_pixel, .. } = self.geometry;
        let from_eye = self.geometry.distance_from_eye(self.view.slabs.plane(plane));
        let size = (per_pixel * from_eye).min(DVec2::ONE);
        let (a, b) = (screen_axis * size.x, screen_axis.perp() * size.y);
        // Of an ellipse with these axes.
        let reach = self.view.radius / size;
        let (along, across) = (screen_axis * reach.x, screen_axis.perp() * reach.y);
        let squared = along * along + across * across;
        let half_box = DVec2::new(squared.x.sqrt(), squared.y.sqrt()) + SLACK;
        PlaneMap { from_eye, a, b, half_box }
    }

    /// Half the box around kernels, pixels, where it is the same on all planes.
    pub(super) fn flat_half_box(&self) -> Option<[f32; 2]> {
        let half_box = || self.map(0).half_box.to_array().map(|half| half as f32);
        self.view.perspective.is_none().then(half_box)
    }

    /// The pixel position of the point of a plane that is nearest to a voxel.
    pub(super) fn center(&self, place: Place, to_plane: f64, map: &PlaneMap) -> DVec2 {
        (place.at + to_plane * self.geometry.step.truncate()) / map.from_eye + self.middle()
    }

    fn middle(&self) -> DVec2 {
        DVec2::from(self.view.size.map(f64::from)) / 2.0
    }

    /// The pixels that a brick's kernels may reach, and the planes; `None` for no plane.
    pub(super) fn bounds(&self, brick: &Brick) -> Option<(ScreenBox, Range<i32>)> {
        let (middle, half) = brick::bounds(brick);
        let Place { at, depth } = self.of(middle);
        let rows = self.view.screen_from_voxel;
        let [dx, dy, spread, _] = rows.map(|row| row.truncate().abs().dot(half));
        let spread = spread / self.view.slabs.width;
        let planes = self.planes(depth - spread..depth + spread);
        if planes.is_empty() {
            return None;
        }
        let across = DVec2::new(dx, dy) + self.view.radius * self.geometry.step.truncate().abs();
        let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for plane in [planes.start, planes.end - 1] {
            let map = self.map(plane);
            low = low.min((at - across) / map.from_eye - map.half_box);
            high = high.max((at + across) / map.from_eye + map.half_box);
        }
        Some(([low + self.middle() - SLACK, high + self.middle() + SLACK], planes))
    }

    /// The bricks that may be on the image, by first plane and then in memory order.
    pub(super) fn place_bricks(&self, bricks: &[Brick]) -> Vec<Placed> {
        let place = |(number, brick): (usize, &Brick)| {
            let ([low, high], planes) = self.bounds(brick)?;
            let tiles = |axis: usize, side: usize| {
                let low = (low[axis] - 0.5).max(0.0);
                let high = (high[axis] - 0.5).min(f64::from(self.view.size[axis]) - 1.0);
                (low <= high).then(|| [low as usize / side, high as usize / side])
            };
            let (columns, rows) = (tiles(0, COLUMNS)?, tiles(1, ROWS)?);
            Some(Placed { brick: number as u32, first: planes.start, half_box: [0.0; 2], columns, rows })
        };
        let mut placed: Vec<Placed> = bricks.par_iter().enumerate().filter_map(place).collect();
        placed.par_sort_unstable_by_key(|placed| (placed.first, placed.brick));
        placed
    }
}
