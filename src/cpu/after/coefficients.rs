//! The numbers that voxels are splatted as where classification comes after splatting (SPEC §9), and the choice of voxels.

use std::sync::Arc;

use super::extreme::is_choice;
use glam::{DVec3, UVec3};

use crate::after::brick_ranges::{Bearing, BrickRanges};
use crate::after::coefficients;
use crate::after::normalization::Normalization;
use crate::error::RenderError;
use crate::geometry::plane_geometry::PlaneGeometry;
use crate::geometry::view_geometry::ViewGeometry;

use crate::lists::brick::Brick;
use crate::lists::brick::BrickList;
use crate::scene::Scene;
use crate::settings::shading::Gradient;
use crate::settings::splatting::{Compositing, Interpolation};
use crate::settings::transfer_function::TransferFunction;
use crate::volume::Volume;

/// The coefficients of a volume, and the bricks that its last frame drew.
#[derive(Clone, Debug)]
pub(in crate::cpu) struct Coefficients {
    /// The map from coefficients to the numbers that are splatted.
    pub(super) numbers: Normalization,
    /// Of `interpolation = "exact"`; else they are the values.
    exact: Option<Arc<[f32]>>,
    /// From differences of neighbours on either side to gradients in numbers per world unit; `None` where the kernel's gradient is asked for.
    per_difference: Option<DVec3>,
    shown: Option<Shown>,
}

/// The bricks that may be drawn.
#[derive(Clone, Debug)]
struct Shown {
    /// The distance in voxels up to which a brick's test examined the values around it.
    reach: UVec3,
    bricks: BrickList,
    /// The bricks of all voxels but holes, for compositings that may choose a value without an opacity.
    all: Option<BrickList>,
}

impl Coefficients {
    /// # Errors
    /// If no coefficients are found that interpolate the volume's values.
    pub(in crate::cpu) fn new(volume: &Volume, scene: &Scene) -> Result<Self, RenderError> {
        let splatting = &scene.splatting;
        let kernel = (splatting.radius, splatting.falloff);
        let exact = match splatting.interpolation {
            Interpolation::Smooth => None,
            Interpolation::Exact => Some(coefficients::of_volume(volume, kernel)?),
        };
        let all = exact.as_deref().unwrap_or(volume.values());
        let numbers = Normalization::of(all.iter().copied()).unwrap_or(Normalization::new([0.0; 2]));
        let is_by_differences = scene.shading.gradient == Gradient::Differences;
        let per_difference = is_by_differences.then(|| numbers.scale / (2.0 * volume.spacing()));
        Ok(Self { numbers, exact, per_difference, shown: None })
    }

    /// All of them, in memory order; NaN at holes.
    fn all<'a>(&'a self, volume: &'a Volume) -> &'a [f32] {
        self.exact.as_deref().unwrap_or(volume.values())
    }

    /// The number of a voxel, and its gradient in numbers per world unit, 0 where the kernel's is asked for.
    pub(super) fn voxel(&self, volume: &Volume, voxel: UVec3) -> (f32, [f32; 3]) {
        let grid = volume.grid();
        let index = grid.index_of(voxel) as usize;
        let number = self.numbers.apply(f64::from(self.all(volume)[index])) as f32;
        let Some(per_difference) = self.per_difference else { return (number, [0.0; 3]) };
        let is_inside = voxel.cmpgt(UVec3::ZERO).all() && (voxel + 1).cmplt(grid.dims).all();
        let gradient = if is_inside && volume.holes() == 0 {
            let values = volume.values();
            let steps = [1, grid.dims.x as usize, grid.dims.x as usize * grid.dims.y as usize];
            let differences = steps.map(|step| f64::from(values[index + step]) - f64::from(values[index - step]));
            DVec3::from(differences) * per_difference
        } else {
            volume.gradient(voxel) * self.numbers.scale
        };
        (number, gradient.to_array().map(|component| component as f32))
    }

    /// Finds the bricks that may be drawn in a view, if that may have changed them.
    pub(in crate::cpu) fn look(
        &mut self,
        (volume, transfer): (&Volume, &TransferFunction),
        compositing: Compositing,
        view: &ViewGeometry,
    ) {
        let reach = PlaneGeometry::new(view, volume.grid()).reach(view);
        if self.shown.as_ref().is_none_or(|shown| shown.reach != reach) {
            let ranges = BrickRanges::new(volume.grid(), self.all(volume), reach);
            let is_shown = ranges.shown(volume, transfer, Bearing::of(compositing));
            let list = |voxels: Vec<u32>| BrickList::new(volume.grid(), &voxels);
            let bricks = list(ranges.voxels(volume, |brick| is_shown[brick]));
            let all = is_choice(compositing).then(|| list(ranges.voxels(volume, |_| true)));
            self.shown = Some(Shown { reach, bricks, all });
        }
    }

    /// For the last view that was looked at, the bricks whose values can meet an opacity, and the bricks that are drawn.
    pub(super) fn bricks(&self) -> [&[Brick]; 2] {
        self.shown
            .as_ref()
            .map_or([&[]; 2], |shown| [shown.bricks.bricks(), shown.all.as_ref().unwrap_or(&shown.bricks).bricks()])
    }
}
