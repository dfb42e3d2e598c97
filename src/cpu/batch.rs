//! Voxels that are shaded together, on their way from a brick to the sheets.

use glam::UVec3;

use super::cull::Pixels;
use super::frame::Frame;
use super::material::Material;
use super::project::{Lens, Place, Projection};
use super::shade::Unshaded;
use super::splat::{LocalFootprint, Splat};
use super::vector::LANES;

/// Up to eight voxels that are shaded together.
pub(super) struct Batch<'a> {
    pub(super) count: usize,
    /// Their materials in all channels, or the voxels whose materials are not kept.
    pub(super) materials: [Result<&'a [Material], UVec3>; LANES],
    pub(super) unshaded: Unshaded,
    pub(super) splats: [Splat; LANES],
    /// Without perspective, the distance from plane to plane of all voxels.
    flat_step: f32,
}

impl Batch<'_> {
    pub(super) fn new(projection: &Projection, amplitude: f64) -> Self {
        let nothing = Err(UVec3::ZERO);
        let flat_step = (f64::from(projection.direction) * projection.flat.per_slab) as f32;
        let mut batch = Self {
            count: 0,
            materials: [nothing; LANES],
            unshaded: Unshaded::new(),
            splats: Default::default(),
            flat_step,
        };
        (0..LANES).for_each(|lane| batch.set_view(lane, projection, &projection.flat, amplitude));
        batch
    }

    fn set_view(&mut self, lane: usize, projection: &Projection, lens: &Lens, amplitude: f64) {
        // Back to front, planes come in the opposite order, so that sections and their factors are both negative.
        self.unshaded.set_view(lane, lens.to_eye, f64::from(projection.direction) * lens.per_lambda * amplitude);
    }

    /// The sections of the next voxel without perspective.
    #[inline(always)]
    pub(super) fn flat(&mut self, (first_plane, end): (f32, i32), sheet: i32) {
        let splat = &mut self.splats[self.count];
        (splat.first_plane, splat.step, splat.sheets) = (first_plane, self.flat_step, [sheet, end]);
    }

    /// The sections of the next voxel in perspective.
    pub(super) fn lens(&mut self, frame: &Frame, place: Place, voxel: UVec3, sheet: i32) {
        let projection = &frame.projection;
        let Some(perspective) = &projection.view.perspective else { return };
        let lens = projection.lens(perspective, place, voxel);
        self.set_view(self.count, projection, &lens, frame.amplitude);
        let splat = &mut self.splats[self.count];
        splat.local = lens.local.map_or_else(LocalFootprint::default, |local| LocalFootprint {
            axis: local.axis.to_array().map(|component| component as f32),
            metric: local.metric.to_array().map(|component| component as f32),
            depth_per_warped: local.depth_per_warped as f32,
            from_eye: place.from_eye as f32,
            cut: local.cut as f32,
        });
        splat.first_plane = ((projection.plane_before(sheet) - place.depth) * lens.per_slab) as f32;
        splat.step = (f64::from(projection.direction) * lens.per_slab) as f32;
        splat.sheets = [sheet, projection.sheets(place, voxel).end];
    }

    /// Adds the next voxel, whose sections are set, and whose amount is not known yet.
    #[inline(always)]
    pub(super) fn add(&mut self, voxel: [u32; 2], center: [f32; 2], pixels: Pixels) {
        let splat = &mut self.splats[self.count];
        (splat.center, splat.pixels) = (center, pixels);
        (splat.voxel, splat.drawn) = (voxel, 0);
        self.count += 1;
    }
}
