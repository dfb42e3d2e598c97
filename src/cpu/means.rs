//! How rays meet sheets for the compositings by means ([`Compositing`]), as in `shaders/shared/means.wgsl`.

use std::ops::Range;

use glam::DVec3;

use super::ray::PixelRay;
use crate::geometry::means::RayBox;
use crate::geometry::view_geometry::ViewGeometry;
use crate::settings::clip::HalfSpace;
use crate::settings::splatting::{Compositing, Splatting};
use crate::volume::Grid;

/// By how much slabs' middles may lie outside, in slabs, and rays miss a box of voxel centres, in grid steps.
const HAIR: f64 = 0.01;

/// The settings of a view that decide how a ray meets sheets.
#[derive(Clone, Debug)]
pub(super) struct Means {
    compositing: Compositing,
    /// Around what counts: for `average` all voxels, for `minimum` what kernels fill, a hair wider.
    counted: [HalfSpace; 6],
    /// Around the voxels' centres, a hair wider.
    centers: [HalfSpace; 6],
    /// The depth at which a ray starts to count.
    nearest: f64,
}

impl Means {
    pub(super) fn new(view: &ViewGeometry, grid: &Grid, splatting: &Splatting) -> Self {
        let RayBox { center, half, nearest } = RayBox::new(view, grid, splatting);
        let compositing = splatting.compositing;
        let spare = if compositing.keeps_least() { HAIR } else { 0.0 };
        let around = |half: DVec3| HalfSpace::around(center, half, grid);
        let (_, centers) = grid.whole();
        Self { compositing, counted: around(half + spare), centers: around(centers + HAIR), nearest }
    }

    /// True if some slabs do not count.
    pub(super) fn is_choosy(&self) -> bool {
        self.compositing.keeps_least()
    }

    /// The factor that turns sheets into means for a ray with these visible depths.
    pub(super) fn weight(&self, ray: &PixelRay, shown: Range<f64>) -> f64 {
        if !self.compositing.is_average() {
            return ray.slabs_per_depth() / ray.length();
        }
        let depths = self.within(ray, &self.counted, shown);
        let centers = self.within(ray, &self.centers, f64::NEG_INFINITY..f64::INFINITY);
        if centers.is_empty() || depths.is_empty() {
            return 0.0;
        }
        1.0 / ((depths.end - depths.start) * ray.length())
    }

    /// The range of the middles of slabs that count.
    pub(super) fn counted(&self, ray: &PixelRay, shown: Range<f64>) -> [f64; 2] {
        let Some([first, last]) = ray.slabs(self.within(ray, &self.counted, shown)) else {
            return [f64::INFINITY, f64::NEG_INFINITY];
        };
        let middle = (first + last) / 2.0;
        [first.min(middle - 0.5) - HAIR, last.max(middle + 0.5) + HAIR]
    }

    fn within(&self, ray: &PixelRay, around: &[HalfSpace; 6], shown: Range<f64>) -> Range<f64> {
        let inside = ray.inside(around);
        inside.start.max(self.nearest).max(shown.start)..inside.end.min(shown.end)
    }
}
