//! Where along rays the means of sheets count ([`Compositing::is_by_means`]).

use std::ops::Range;

use glam::DVec3;

use crate::geometry::view_geometry::ViewGeometry;
use crate::settings::splatting::{Classification, Compositing, Splatting};
use crate::volume::Grid;

/// A box around the volume's centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayBox {
    /// Half its extent, grid steps.
    pub half: DVec3,
    /// The depth along w from which on a ray is looked at, `unit`s from the eye; without one minus infinity.
    pub nearest: f64,
}

impl RayBox {
    /// That of [`Compositing::Minimum`], where kernels are complete, or all cells, of [`Compositing::Average`] and with
    /// [`Classification::After`]; the others look at none.
    pub fn new(view: &ViewGeometry, grid: &Grid, splatting: &Splatting) -> Self {
        let (centers, near) = (grid.center(), view.perspective.map_or(f64::NEG_INFINITY, |it| it.eye.near));
        if splatting.compositing != Compositing::Minimum || splatting.classification == Classification::After {
            return Self { half: centers + 0.5, nearest: near };
        }
        // The farthest that a kernel reaches in depth from a voxel before the near plane.
        let reach = splatting.radius * (view.basis.w * grid.aspect()).length();
        Self { half: (centers - splatting.radius).max(centers / 2.0), nearest: near + reach }
    }
}

/// The sheet depths whose slabs count even where they hold nothing, empty for none: those that some ray counts for
/// [`Compositing::Minimum`].
pub fn covered(view: &ViewGeometry, grid: &Grid, splatting: &Splatting) -> Range<f64> {
    if splatting.compositing != Compositing::Minimum || splatting.classification == Classification::After {
        return 0.0..0.0;
    }
    let RayBox { half, nearest } = RayBox::new(view, grid, splatting);
    let row = view.screen_from_voxel[2];
    let (middle, spread) = (row.dot(grid.center().extend(1.0)), row.truncate().abs().dot(half));
    let start = match &view.perspective {
        Some(perspective) if perspective.is_image_aligned => (middle - spread).max(view.slabs.origin + nearest),
        _ => middle - spread,
    };
    // Of stretches shorter than a slab the slabs around their middles count.
    let margin = view.slabs.width / 2.0;
    if start <= middle + spread { start - margin..middle + spread + margin } else { 0.0..0.0 }
}
