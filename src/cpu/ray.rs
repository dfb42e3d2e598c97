//! The rays of pixels among sheets, in f64 (SPEC §2, §5).

use std::ops::Range;

use glam::{DVec2, DVec3, DVec4, UVec3};

use crate::geometry::pixel_ray;
use crate::geometry::slab::SlabGrid;
use crate::geometry::view_geometry::{Rays, ViewGeometry};
use crate::settings::clip::HalfSpace;
use crate::volume::Grid;

/// The rays of a view.
#[derive(Clone, Debug)]
pub(super) struct PixelRays {
    rays: Rays,
    /// The sheet depth of a position.
    depth: DVec4,
    slabs: SlabGrid,
    middle: DVec2,
}

/// The ray of a pixel's centre, and how it passes through slabs.
#[derive(Clone, Copy, Debug)]
pub(super) struct PixelRay {
    line: pixel_ray::PixelRay,
    /// The number of the slab where the depth is 0.
    slab_at_origin: f64,
    /// The number of slabs per `unit` of depth; negative where a ray far off the axis meets slices in the opposite order.
    slabs_per_depth: f64,
}

impl PixelRays {
    pub(super) fn new(view: &ViewGeometry, grid: &Grid) -> Self {
        Self {
            rays: view.rays(),
            depth: view.sheet_depth_row(grid.aspect(), grid.center()),
            slabs: view.slabs,
            middle: DVec2::from(view.size.map(f64::from)) / 2.0,
        }
    }

    /// The ray of a pixel, counted from the upper left.
    pub(super) fn of(&self, pixel: [usize; 2]) -> PixelRay {
        let line = pixel_ray::PixelRay::of(&self.rays, pixel, self.middle);
        PixelRay {
            line,
            slab_at_origin: (self.depth.dot(line.origin.extend(1.0)) - self.slabs.origin) / self.slabs.width,
            slabs_per_depth: self.depth.truncate().dot(line.along) / self.slabs.width,
        }
    }
}

impl PixelRay {
    /// The depths inside of all half spaces.
    pub(super) fn inside(&self, half_spaces: &[HalfSpace]) -> Range<f64> {
        self.line.inside(half_spaces)
    }

    /// The position at a depth.
    pub(super) fn at(&self, depth: f64) -> DVec3 {
        self.line.at(depth)
    }

    /// The voxel whose cell has the middle of a range of depths.
    pub(super) fn middle_voxel(&self, depths: &Range<f64>, grid: &Grid) -> UVec3 {
        self.line.middle_voxel(depths, grid)
    }

    /// The unit vector towards the eye.
    pub(super) fn toward_eye(&self) -> DVec3 {
        -self.line.along.normalize()
    }

    /// The length of the ray to a `unit` of depth.
    pub(super) fn length(&self) -> f64 {
        self.line.along.length()
    }

    /// Slabs that the ray passes through in a `unit` of depth.
    pub(super) fn slabs_per_depth(&self) -> f64 {
        self.slabs_per_depth.abs()
    }

    /// Where among slabs the ray is at two depths, the smaller number first: slab k fills `k..k + 1`. `None` between depths that are no
    /// stretch; a ray that stays in one slice is everywhere.
    pub(super) fn slabs(&self, depths: Range<f64>) -> Option<[f64; 2]> {
        if depths.is_empty() {
            return None;
        }
        if self.slabs_per_depth == 0.0 {
            return Some([f64::NEG_INFINITY, f64::INFINITY]);
        }
        let [a, b] = [depths.start, depths.end].map(|depth| self.slab(depth));
        Some([a.min(b), a.max(b)])
    }

    /// Where among slabs the ray is at a depth.
    pub(super) fn slab(&self, depth: f64) -> f64 {
        self.slab_at_origin + self.slabs_per_depth * depth
    }

    /// The depth of a place among slabs.
    pub(super) fn depth(&self, slab: f64) -> f64 {
        (slab - self.slab_at_origin) / self.slabs_per_depth
    }
}
