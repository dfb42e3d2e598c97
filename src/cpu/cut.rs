//! What clip planes and the crop box leave of a pixel's ray, and so of its sheets; the same as `shaders/shared/cut.wgsl`.

use glam::{DVec2, DVec4};

use super::sheets::{COLUMNS, ROWS};
use crate::geometry::slab::SlabGrid;
use crate::geometry::view_geometry::{Rays, ViewGeometry};
use crate::settings::clip::{Clip, HalfSpace};
use crate::volume::Grid;

/// What is kept of all pixels' rays.
#[derive(Clone, Debug)]
pub(super) struct Cuts {
    half_spaces: Vec<HalfSpace>,
    rays: Rays,
    /// The sheet depth of a position.
    depth: DVec4,
    slabs: SlabGrid,
    middle: DVec2,
}

/// Of every pixel of a tile the stretch of its ray that shows, in slabs from a certain one on; empty where nothing shows.
#[derive(Clone, Debug)]
pub(super) struct TileCuts {
    base: i32,
    /// By row: where the stretches of its pixels start and end.
    pub(super) rows: Vec<[[f32; COLUMNS]; 2]>,
}

impl Cuts {
    /// `None` where nothing is cut away.
    pub(super) fn new(clip: &Clip, view: &ViewGeometry, grid: &Grid) -> Option<Self> {
        (!clip.is_empty()).then(|| Self {
            half_spaces: clip.half_spaces(grid),
            rays: view.rays(),
            depth: view.sheet_depth_row(grid.aspect(), grid.center()),
            slabs: view.slabs,
            middle: DVec2::from(view.size.map(f64::from)) / 2.0,
        })
    }

    /// The stretches of a tile's pixels, given its first pixel, in slabs from `base` on.
    pub(super) fn of_tile(&self, origin: [usize; 2], base: i32) -> TileCuts {
        let mut rows = vec![[[0.0; COLUMNS]; 2]; ROWS];
        for (y, row) in rows.iter_mut().enumerate() {
            let [starts, ends] = row;
            for (x, (start, end)) in starts.iter_mut().zip(ends).enumerate() {
                let pixel = DVec2::new((origin[0] + x) as f64, (origin[1] + y) as f64) + 0.5;
                [*start, *end] = self.stretch(pixel - self.middle, base);
            }
        }
        TileCuts { base, rows }
    }

    fn stretch(&self, place: DVec2, base: i32) -> [f32; 2] {
        let origin = self.rays.at(place, 0.0);
        let along = self.rays.at(place, 1.0) - origin;
        let (mut start, mut end) = (f64::NEG_INFINITY, f64::INFINITY);
        for HalfSpace { normal, offset } in &self.half_spaces {
            let (at_origin, slope) = (normal.dot(origin) + offset, normal.dot(along));
            if slope > 0.0 {
                start = start.max(-at_origin / slope);
            } else if slope < 0.0 {
                end = end.min(-at_origin / slope);
            } else if at_origin < 0.0 {
                end = f64::NEG_INFINITY;
            }
        }
        if start >= end {
            return [0.0, f32::NEG_INFINITY];
        }
        // Sheets are parallel to the image: their numbers grow with depth.
        let at_origin = (self.depth.dot(origin.extend(1.0)) - self.slabs.origin) / self.slabs.width;
        let slope = self.depth.truncate().dot(along) / self.slabs.width;
        [start, end].map(|depth| (at_origin - f64::from(base) + slope * depth) as f32)
    }
}

impl TileCuts {
    /// Where a slab begins, in the terms of the stretches.
    pub(super) fn begin(&self, slab: i32) -> f32 {
        (slab - self.base) as f32
    }
}
