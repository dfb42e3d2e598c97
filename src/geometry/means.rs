//! The stretch of each ray over which means of sheets count ([`Compositing::is_by_means`](crate::settings::splatting::Compositing::is_by_means)).

use std::ops::Range;

use glam::DVec3;

use crate::geometry::view_geometry::ViewGeometry;
use crate::settings::splatting::Splatting;
use crate::volume::Grid;

/// A box around the centre of the volume, of which a grid may be a part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayBox {
    /// Its centre in grid steps from the grid's.
    pub center: DVec3,
    /// Half its size in grid steps.
    pub half: DVec3,
    /// The minimum depth along w that counts, in `unit`s from the eye; minus infinity without an eye.
    pub nearest: f64,
}

impl RayBox {
    /// The box for `minimum`, in which kernels are complete, or for `average` and
    /// [`Classification::After`], with all voxels; the other modes do not use it.
    pub fn new(view: &ViewGeometry, grid: &Grid, splatting: &Splatting) -> Self {
        let ((center, centers), near) = (grid.whole(), view.perspective.map_or(f64::NEG_INFINITY, |it| it.eye.near));
        if !splatting.compositing.counts_empty(splatting.classification) {
            return Self { center, half: centers + 0.5, nearest: near };
        }
        // The maximum depth by which a kernel reaches beyond a voxel at the near plane.
        let reach = splatting.radius * (view.basis.w * grid.aspect()).length();
        Self { center, half: (centers - splatting.radius).max(centers / 2.0), nearest: near + reach }
    }
}

/// The sheet depths whose slabs count for `minimum` even if they are empty: those on some ray's stretch. Empty for the
/// other modes.
pub fn covered(view: &ViewGeometry, grid: &Grid, splatting: &Splatting) -> Range<f64> {
    if !splatting.compositing.counts_empty(splatting.classification) {
        return 0.0..0.0;
    }
    let RayBox { center, half, nearest } = RayBox::new(view, grid, splatting);
    let row = view.screen_from_voxel[2];
    let (middle, spread) = (row.dot((grid.center() + center).extend(1.0)), row.truncate().abs().dot(half));
    let start = match &view.perspective {
        Some(perspective) if perspective.is_image_aligned => (middle - spread).max(view.slabs.origin + nearest),
        _ => middle - spread,
    };
    // For a stretch shorter than a slab, the slab around its middle counts.
    let margin = view.slabs.width / 2.0;
    if start <= middle + spread { start - margin..middle + spread + margin } else { 0.0..0.0 }
}
