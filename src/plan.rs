//! The frame plan: everything a frame's passes need, as plain data made without a GPU.

use glam::{DVec2, DVec3, DVec4, UVec3};
use rayon::prelude::*;

use crate::bucket::Buckets;
use crate::camera::{Camera, Projection, ViewBasis};
use crate::error::RenderError;
use crate::grid_warp::{self, FootprintMap};
use crate::kernel::Kernel;
use crate::slab::SlabGrid;
use crate::splatting::{Method, Splatting};
use crate::volume::Grid;

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
    /// If the projection or method is one that is not implemented yet.
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
        let unit = grid.unit();
        let pix = height_world / (f64::from(height) * unit);
        let warped = grid_warp::m_view_warped(&basis, grid.aspect());
        let m_vol = grid_warp::m_vol(&warped);
        let (_, lambda) = grid_warp::w_wo(&warped);

        // In units of voxels the warped grid is the voxel index grid, so eq. 11 applies to (i, j, k) - centre directly.
        let row = |axis: usize, scale: f64, at_center: f64| {
            let row = m_vol.row(axis) * scale;
            row.extend(at_center - row.dot(grid.center()))
        };
        let middle = DVec2::new(f64::from(width), f64::from(height)) / 2.0;
        let center = camera.center / unit;
        Ok(Self {
            basis,
            size,
            screen_from_voxel: [
                row(0, 1.0 / pix, middle.x - basis.u.dot(center) / pix),
                row(1, -1.0 / pix, middle.y + basis.v.dot(center) / pix),
                row(2, 1.0, 0.0),
            ],
            footprint: FootprintMap::new(&warped, pix),
            slabs: SlabGrid { width: splatting.slab_width * lambda, radius: splatting.radius },
            lambda,
        })
    }

    /// A voxel's pixel coordinates (x right, y down) and its depth in the warped grid.
    pub fn project(&self, voxel: UVec3) -> DVec3 {
        let p = voxel.as_dvec3().extend(1.0);
        DVec3::from(self.screen_from_voxel.map(|row| row.dot(p)))
    }
}

/// One list's share of a frame: its buckets and counts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ListPlan {
    /// The voxels on the screen, by slab.
    pub buckets: Buckets,
    /// The slabs that any kernel of the list touches, `first..end`.
    pub slabs: (i32, i32),
    /// Voxel–slab overlaps of positive length, wherever they fall on the screen.
    pub sections_total: u64,
    /// Those of voxels whose footprint's box meets the image.
    pub sections_on_screen: u64,
}

impl ListPlan {
    /// Projects and buckets the voxels of one list (§5.1).
    pub fn new(grid: &Grid, indices: &[u32], view: &View, kernel: &Kernel) -> Self {
        let half_box = view.footprint.half_box(kernel.support());
        let image = DVec2::new(f64::from(view.size[0]), f64::from(view.size[1]));
        let placed: Vec<(i32, i32, bool)> = indices
            .par_iter()
            .map(|&index| {
                let p = view.project(grid.voxel_at(index));
                let touched = view.slabs.touched(p.z);
                // Pixel centres at half-integers: a box that holds none of the image's draws nothing.
                let (low, high) = (p.truncate() - half_box, p.truncate() + half_box);
                let on_screen = low.cmplt(image - 0.5).all() && high.cmpgt(DVec2::splat(0.5)).all();
                (*touched.start(), *touched.end() + 1, on_screen)
            })
            .collect();
        let sections = |on_screen_only: bool| -> u64 {
            placed.iter().filter(|p| p.2 || !on_screen_only).map(|(first, end, _)| (end - first) as u64).sum()
        };
        let reach = placed.iter().map(|(first, end, _)| end - first).max().unwrap_or(0);
        let slabs = placed.iter().fold((i32::MAX, i32::MIN), |slabs, p| (slabs.0.min(p.0), slabs.1.max(p.1)));
        let firsts: Vec<Option<i32>> = placed.iter().map(|&(first, _, on_screen)| on_screen.then_some(first)).collect();
        Self {
            buckets: Buckets::sort(&firsts, reach),
            slabs,
            sections_total: sections(false),
            sections_on_screen: sections(true),
        }
    }
}
