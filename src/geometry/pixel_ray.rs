//! The ray of a pixel's centre, the stretch of it that counts where values are classified after splatting (SPEC §9), and the voxel in its middle.

use std::ops::Range;

use glam::{DVec2, DVec3, UVec3};

use super::view_geometry::{Rays, ViewGeometry};
use crate::settings::clip::{Clip, HalfSpace};
use crate::volume::Grid;

/// By how much of a cell middles of rays are moved before their voxel is found. Rays that enter and leave a volume by opposite faces have their middle where
/// two cells meet, if the number of cells is even, and rounding would decide pixel by pixel.
pub(crate) const HAIR_OF_CELL: f64 = 1e-3;

/// The ray of a pixel's centre, by its depth along w: positions in `unit`s from the volume's centre.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PixelRay {
    pub(crate) origin: DVec3,
    /// The change of position per `unit` of depth.
    pub(crate) along: DVec3,
}

impl PixelRay {
    /// The ray of a pixel, counted from the upper left, in an image with this middle.
    pub(crate) fn of(rays: &Rays, [x, y]: [usize; 2], middle: DVec2) -> Self {
        let place = DVec2::new(x as f64, y as f64) + 0.5 - middle;
        let origin = rays.at(place, 0.0);
        Self { origin, along: rays.at(place, 1.0) - origin }
    }

    /// The depths inside of all half spaces.
    pub(crate) fn inside(&self, half_spaces: &[HalfSpace]) -> Range<f64> {
        let (mut start, mut end) = (f64::NEG_INFINITY, f64::INFINITY);
        for HalfSpace { normal, offset } in half_spaces {
            let (at_origin, slope) = (normal.dot(self.origin) + offset, normal.dot(self.along));
            if slope > 0.0 {
                start = start.max(-at_origin / slope);
            } else if slope < 0.0 {
                end = end.min(-at_origin / slope);
            } else if at_origin < 0.0 {
                end = f64::NEG_INFINITY;
            }
        }
        start..end
    }

    /// The position at a depth.
    pub(crate) fn at(&self, depth: f64) -> DVec3 {
        self.origin + depth * self.along
    }

    /// The voxel whose cell has the middle of a range of depths; of cells that meet there, the last ([`HAIR_OF_CELL`]).
    pub(crate) fn middle_voxel(&self, depths: &Range<f64>, grid: &Grid) -> UVec3 {
        let at = self.at((depths.start + depths.end) / 2.0) / grid.aspect() + grid.center();
        grid.nearest(at + HAIR_OF_CELL)
    }
}

/// The half spaces within which pixels' rays count: the box of voxel cells, beyond the near plane, within the cuts.
pub(crate) fn counted(view: &ViewGeometry, clip: &Clip, grid: &Grid) -> Vec<HalfSpace> {
    let (center, centers) = grid.whole();
    let mut counted = if clip.is_empty() { Vec::new() } else { clip.half_spaces(grid) };
    counted.extend(HalfSpace::around(center, centers + 0.5, grid));
    counted.extend(view.perspective.map(|perspective| {
        let (eye, w) = (perspective.eye, view.basis.w);
        HalfSpace { normal: w, offset: -eye.position.dot(w) - eye.near }
    }));
    counted
}
