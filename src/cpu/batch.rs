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

/// The sections of a voxel along its ray, as [`Splat`] holds them.
#[derive(Default)]
pub(super) struct AlongRay {
    end: i32,
    first_plane: f32,
    step: f32,
}

impl Batch<'_> {
    pub(super) fn new(projection: &Projection, amplitude: f64) -> Self {
        let nothing = Err(UVec3::ZERO);
        let flat_step = (f64::from(projection.direction) * projection.flat.per_slab) as f32;
        let mut batch = Self {
            count: 0,
            materials: [nothing; LANES],
            unshaded: Unshaded::default(),
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

    /// The sections of a voxel without perspective.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn flat(&self, (first_plane, end): (f32, i32)) -> AlongRay {
        AlongRay { end, first_plane, step: self.flat_step }
    }

    /// The sections of a voxel in perspective, the next one of the batch.
    pub(super) fn lens(&mut self, frame: &Frame, place: Place, voxel: UVec3, sheet: i32) -> AlongRay {
        let projection = &frame.projection;
        let Some(perspective) = &projection.view.perspective else { return AlongRay::default() };
        let lens = projection.lens(perspective, place, voxel);
        self.set_view(self.count, projection, &lens, frame.amplitude);
        self.splats[self.count].local = lens.local.map_or_else(LocalFootprint::default, |local| LocalFootprint {
            axis: local.axis.to_array().map(|component| component as f32),
            metric: local.metric.to_array().map(|component| component as f32),
            depth_per_warped: local.depth_per_warped as f32,
            from_eye: place.from_eye as f32,
            cut: local.cut as f32,
        });
        AlongRay {
            end: projection.sheets(place, voxel).end,
            first_plane: ((projection.plane_before(sheet) - place.depth) * lens.per_slab) as f32,
            step: (f64::from(projection.direction) * lens.per_slab) as f32,
        }
    }

    /// Adds a voxel; in perspective that of the last [`Self::lens`].
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn add(
        &mut self,
        voxel: [u32; 2],
        sheet: i32,
        AlongRay { end, first_plane, step }: AlongRay,
        (center, pixels): ([f32; 2], Pixels),
    ) {
        // Its amount is not known yet.
        let splat = &mut self.splats[self.count];
        (splat.center, splat.pixels, splat.sheets) = (center, pixels, [sheet, end]);
        (splat.first_plane, splat.step) = (first_plane, step);
        (splat.voxel, splat.drawn) = (voxel, 0);
        self.count += 1;
    }
}
