//! The frame plan: everything a frame's passes need, as plain data made without a GPU.

use std::ops::Range;

use glam::{DVec2, DVec3, DVec4, UVec3};
use rayon::prelude::*;

use crate::bucket::Buckets;
use crate::camera::{Camera, Projection, ViewBasis};
use crate::error::RenderError;
use crate::grid_warp::{self, FootprintMap};
use crate::kernel::Kernel;
use crate::slab::SlabGrid;
use crate::splatting::{Method, Order, Splatting};
use crate::stats::Counts;
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
        if splatting.method == Method::AxisAligned {
            return Err(RenderError::unsupported("splatting.method", "\"axis-aligned\"", "\"image-aligned\""));
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

/// A frame: which splats every slab draws, front to back.
#[derive(Clone, Debug, PartialEq)]
pub struct FramePlan {
    /// The view.
    pub view: View,
    /// For every voxel list the order its splats are stored in: indices into the list, sorted by first slab.
    pub orders: Vec<Vec<u32>>,
    /// The slabs that any splat touches, in the order they are composited.
    pub slabs: Vec<SlabPlan>,
    /// What the frame is made of.
    pub counts: Counts,
}

/// One slab of a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct SlabPlan {
    /// Warped depth of the slab's near plane, `k·Δ·λw`.
    pub near: f64,
    /// For every list the range of splats that can touch the slab.
    pub splats: Vec<Range<u32>>,
}

impl FramePlan {
    /// Projects and buckets the voxels (§5.1). `lists` holds voxels as indices into the volume.
    pub fn new<'a>(
        grid: &Grid,
        lists: impl IntoIterator<Item = &'a [u32]>,
        view: View,
        kernel: &Kernel,
        order: Order,
    ) -> Self {
        let lists: Vec<ListPlan> = lists.into_iter().map(|list| ListPlan::new(grid, list, &view, kernel)).collect();
        let first = lists.iter().map(|list| list.slabs.start).min().unwrap_or(0);
        let end = lists.iter().map(|list| list.slabs.end).max().unwrap_or(0);
        let mut slabs: Vec<SlabPlan> = (first..end)
            .map(|k| SlabPlan {
                near: f64::from(k) * view.slabs.width,
                splats: lists.iter().map(|list| list.buckets.touching(k)).collect(),
            })
            .filter(|slab| slab.splats.iter().any(|range| !range.is_empty()))
            .collect();
        if order == Order::BackToFront {
            slabs.reverse();
        }

        let tiles = u64::from(view.size[0].div_ceil(TILE)) * u64::from(view.size[1].div_ceil(TILE));
        let sheets = (end - first) as u64;
        let counts = Counts {
            voxels_total: grid.dims.as_u64vec3().element_product(),
            voxels_in_range: lists.iter().map(|list| list.voxels).sum(),
            voxels_shaded: lists.iter().map(|list| list.buckets.order.len() as u64).sum(),
            sections_total: lists.iter().map(|list| list.sections).sum(),
            sections_rasterized: lists.iter().map(|list| list.sections_on_screen).sum(),
            sheets,
            tiles_total: tiles * sheets,
            tiles_composited: tiles * slabs.len() as u64,
        };
        Self { view, orders: lists.into_iter().map(|list| list.buckets.order).collect(), slabs, counts }
    }
}

/// One list's share of a frame.
struct ListPlan {
    /// The voxels on the screen, by slab.
    buckets: Buckets,
    /// The slabs that any kernel of the list touches, on the screen or off it.
    slabs: Range<i32>,
    voxels: u64,
    sections: u64,
    sections_on_screen: u64,
}

impl ListPlan {
    fn new(grid: &Grid, list: &[u32], view: &View, kernel: &Kernel) -> Self {
        let half_box = view.footprint.half_box(kernel.support());
        let image = DVec2::new(f64::from(view.size[0]), f64::from(view.size[1]));
        let placed: Vec<(Range<i32>, bool)> = list
            .par_iter()
            .map(|&index| {
                let p = view.project(grid.voxel_at(index));
                // Pixel centres at half-integers: a box that holds none of the image's draws nothing.
                let (low, high) = (p.truncate() - half_box, p.truncate() + half_box);
                let on_screen = low.cmple(image - 0.5).all() && high.cmpge(DVec2::splat(0.5)).all();
                (view.slabs.touched(p.z), on_screen)
            })
            .collect();
        let sections = |on_screen_only: bool| -> u64 {
            placed.iter().filter(|placed| placed.1 || !on_screen_only).map(|(slabs, _)| slabs.len() as u64).sum()
        };
        let reach = placed.iter().map(|(slabs, _)| slabs.len()).max().unwrap_or(0);
        let first = placed.iter().map(|(slabs, _)| slabs.start).min().unwrap_or(0);
        let end = placed.iter().map(|(slabs, _)| slabs.end).max().unwrap_or(0);
        let firsts: Vec<Option<i32>> =
            placed.iter().map(|(slabs, on_screen)| on_screen.then_some(slabs.start)).collect();
        Self {
            buckets: Buckets::sort(&firsts, reach as i32),
            slabs: first..end,
            voxels: list.len() as u64,
            sections: sections(false),
            sections_on_screen: sections(true),
        }
    }
}
