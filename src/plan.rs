//! The frame plan: everything a frame's passes need, as plain data made without a GPU.

use std::ops::Range;

use glam::{DVec2, DVec3, DVec4, UVec3};
use rayon::prelude::*;

use crate::brick;
use crate::bucket::Buckets;
use crate::camera::{Camera, Projection, ViewBasis};
use crate::error::RenderError;
use crate::gpu::layout::Brick;
use crate::grid_warp::{self, FootprintMap};
use crate::slab::SlabGrid;
use crate::splatting::{Method, Order, Splatting};
use crate::volume::Grid;

/// Side of a tile, pixels (§6).
pub const TILE: u32 = 32;

/// An orthographic view of a volume in the terms of SPEC §5: where voxels fall on the screen, how footprints lie there,
/// and how slabs cut the warped grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// The viewing coordinate system in world space.
    pub basis: ViewBasis,
    /// Pixels: width, height.
    pub size: [u32; 2],
    /// Rows that map voxel indices (i, j, k, 1) to x in pixels, y in pixels, and depth in the warped grid.
    pub screen_from_voxel: [DVec4; 3],
    /// How a footprint lies on the screen.
    pub footprint: FootprintMap,
    /// The slabs.
    pub slabs: SlabGrid,
    /// `λ = λw`: warped length of one `unit` along a ray.
    pub lambda: f64,
}

impl View {
    /// # Errors
    /// If the projection or method is one that is not implemented yet, pixels are too small or too large for `f32`, or there
    /// are more than [`MAX_SLABS`](crate::slab::MAX_SLABS).
    pub fn new(grid: &Grid, camera: &Camera, splatting: &Splatting, size: [u32; 2]) -> Result<Self, RenderError> {
        let [width, height] = size;
        let Some(height_world) = camera.orthographic_height(grid, splatting.radius, width, height) else {
            let Projection::Perspective { .. } = camera.projection else { unreachable!() };
            return Err(RenderError::unsupported("camera.projection", "\"perspective\"", "\"orthographic\""));
        };
        let method = match splatting.method {
            Method::ImageAligned => None,
            Method::AxisAligned => Some("\"axis-aligned\""),
            Method::CompositeEverySample => Some("\"composite-every-sample\""),
        };
        if let Some(found) = method {
            return Err(RenderError::unsupported("splatting.method", found, "\"image-aligned\""));
        }
        let basis = camera.basis();
        let pix = Camera::pixel_size(height_world, grid, height)?;
        let warped = grid_warp::m_view_warped(&basis, grid.aspect());
        let m_vol = grid_warp::m_vol(&warped);
        let (w_wo, lambda) = grid_warp::w_wo(&warped);
        let slabs = SlabGrid { width: splatting.slab_width * lambda, radius: splatting.radius };
        slabs.check(w_wo.abs().dot(grid.center()), splatting.slab_width)?;

        // In units of voxels the warped grid is the voxel index grid, so eq. 11 applies to (i, j, k) - centre directly.
        let row = |axis: usize, scale: f64, at_center: f64| {
            let row = m_vol.row(axis) * scale;
            row.extend(at_center - row.dot(grid.center()))
        };
        let middle = DVec2::new(f64::from(width), f64::from(height)) / 2.0;
        let center = camera.center / grid.unit();
        Ok(Self {
            basis,
            size,
            screen_from_voxel: [
                row(0, 1.0 / pix, middle.x - basis.u.dot(center) / pix),
                row(1, -1.0 / pix, middle.y + basis.v.dot(center) / pix),
                row(2, 1.0, 0.0),
            ],
            footprint: FootprintMap::new(&warped, pix),
            slabs,
            lambda,
        })
    }

    /// A voxel's pixel coordinates (x right, y down) and its depth in the warped grid.
    pub fn project(&self, voxel: UVec3) -> DVec3 {
        let p = voxel.as_dvec3().extend(1.0);
        DVec3::from(self.screen_from_voxel.map(|row| row.dot(p)))
    }
}

/// Tiles across and down an image.
pub fn tile_grid(size: [u32; 2]) -> [u32; 2] {
    size.map(|pixels| pixels.div_ceil(TILE))
}

/// A frame: which bricks every sheet group looks at, in the order the groups are composited.
#[derive(Clone, Debug, PartialEq)]
pub struct FramePlan {
    /// The view.
    pub view: View,
    /// Sheets of a group.
    pub sheets: u32,
    /// For every list its bricks, sorted by first group.
    pub orders: Vec<Vec<u32>>,
    /// The groups that any brick may reach into.
    pub groups: Vec<GroupPlan>,
}

/// One sheet group.
#[derive(Clone, Debug, PartialEq)]
pub struct GroupPlan {
    /// Its first slab.
    pub first_slab: i32,
    /// Warped depth of that slab's near plane, `k·Δ·λw`.
    pub near: f64,
    /// For every list the range of its bricks that can reach into the group.
    pub bricks: Vec<Range<u32>>,
}

impl FramePlan {
    /// Buckets the bricks of every list (§5.1), in groups of `sheets` sheets.
    pub fn new<'a>(lists: impl IntoIterator<Item = &'a [Brick]>, view: View, sheets: u32, order: Order) -> Self {
        // A group is a thick slab.
        let groups = SlabGrid { width: view.slabs.width * f64::from(sheets), ..view.slabs };
        let row = view.screen_from_voxel[2];
        let buckets: Vec<Buckets> = lists
            .into_iter()
            .map(|bricks| {
                // In memory order, whatever changes of iso-range came before: equal scenes add up in equal order.
                let mut in_memory: Vec<u32> = (0..bricks.len() as u32).collect();
                let position = |&at: &u32| brick::position(&bricks[at as usize]);
                if !in_memory.is_sorted_by_key(position) {
                    in_memory.sort_unstable_by_key(position);
                }
                let touched: Vec<Range<i32>> = in_memory
                    .iter()
                    .map(|&at| {
                        let brick = &bricks[at as usize];
                        let (middle, half) = brick::bounds(brick);
                        let z = row.dot(middle.extend(1.0));
                        let spread = row.truncate().abs().dot(half);
                        groups.touched(z - spread).start..groups.touched(z + spread).end
                    })
                    .collect();
                let mut buckets = Buckets::sort(&touched);
                buckets.order.iter_mut().for_each(|at| *at = in_memory[*at as usize]);
                buckets
            })
            .collect();
        let first = buckets.iter().filter_map(|b| b.range().map(|range| range.start)).min().unwrap_or(0);
        let end = buckets.iter().filter_map(|b| b.range().map(|range| range.end)).max().unwrap_or(0);
        let mut plans: Vec<GroupPlan> = (first..end)
            .map(|group| GroupPlan {
                first_slab: group * sheets as i32,
                near: f64::from(group) * groups.width,
                bricks: buckets.iter().map(|buckets| buckets.touching(group)).collect(),
            })
            .filter(|group| group.bricks.iter().any(|range| !range.is_empty()))
            .collect();
        if order == Order::BackToFront {
            plans.reverse();
        }
        Self { view, sheets, orders: buckets.into_iter().map(|buckets| buckets.order).collect(), groups: plans }
    }
}

/// Voxel–slab overlaps of positive length, wherever they fall on the screen, and the slabs from the first to the last that
/// any kernel of some bricks touches; `None` without voxels.
pub fn count_sections(bricks: &[Brick], view: &View) -> Option<(u64, Range<i32>)> {
    bricks
        .par_iter()
        .flat_map_iter(brick::voxels)
        .map(|(_, voxel)| {
            let slabs = view.slabs.touched(view.project(voxel).z);
            (slabs.len() as u64, slabs)
        })
        .reduce_with(add_sections)
}

/// The sum of two results of [`count_sections`].
pub fn add_sections(a: (u64, Range<i32>), b: (u64, Range<i32>)) -> (u64, Range<i32>) {
    (a.0 + b.0, a.1.start.min(b.1.start)..a.1.end.max(b.1.end))
}
