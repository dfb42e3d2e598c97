//! What the voxels of a volume are splatted as where classification comes after (SPEC §9), and which of them.

use super::extreme::is_choice;
use glam::{DVec3, UVec3};

use crate::after::brick_ranges::BrickRanges;
use crate::after::coefficients;
use crate::after::normalization::Normalization;
use crate::after::plane_geometry::PlaneGeometry;
use crate::error::RenderError;
use crate::geometry::view_geometry::ViewGeometry;

use crate::lists::brick::Brick;
use crate::lists::brick::BrickList;
use crate::scene::Scene;
use crate::settings::splatting::{Compositing, Interpolation};
use crate::settings::transfer_function::TransferFunction;
use crate::volume::Volume;

/// The coefficients of a volume, and the bricks that its last frame drew.
#[derive(Clone, Debug)]
pub(in crate::cpu) struct Coefficients {
    /// As what numbers they are splatted.
    pub(super) numbers: Normalization,
    /// Of `interpolation = "exact"`; else they are the values.
    exact: Option<Vec<f32>>,
    shown: Option<Shown>,
}

/// The bricks that may be drawn.
#[derive(Clone, Debug)]
struct Shown {
    /// How far around a brick its test looked, voxels.
    reach: UVec3,
    bricks: BrickList,
    /// All that are no holes, where what is chosen may have no opacity.
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
            Interpolation::Exact => Some(coefficients::exact(volume.grid(), volume.values(), kernel, &|_| {})?),
        };
        let all = exact.as_deref().unwrap_or(volume.values());
        let numbers = Normalization::of(all.iter().copied()).unwrap_or(Normalization::new([0.0; 2]));
        Ok(Self { numbers, exact, shown: None })
    }

    /// All of them, in memory order; NaN at holes.
    fn all<'a>(&'a self, volume: &'a Volume) -> &'a [f32] {
        self.exact.as_deref().unwrap_or(volume.values())
    }

    /// The number of a voxel, and its gradient in numbers per world unit.
    pub(super) fn voxel(&self, volume: &Volume, voxel: UVec3) -> (f32, [f32; 3]) {
        let index = volume.grid().index_of(voxel) as usize;
        let gradient: DVec3 = volume.gradient(voxel) * self.numbers.scale;
        let number = self.numbers.apply(f64::from(self.all(volume)[index])) as f32;
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
            let is_shown = ranges.shown(volume, transfer);
            let list = |voxels: Vec<u32>| BrickList::new(volume.grid(), &voxels);
            let bricks = list(ranges.voxels(volume, |brick| is_shown[brick]));
            let all = is_choice(compositing).then(|| list(ranges.voxels(volume, |_| true)));
            self.shown = Some(Shown { reach, bricks, all });
        }
    }

    /// The bricks that may be drawn in the last view that was looked at, and those that are.
    pub(super) fn bricks(&self) -> [&[Brick]; 2] {
        self.shown
            .as_ref()
            .map_or([&[]; 2], |shown| [shown.bricks.bricks(), shown.all.as_ref().unwrap_or(&shown.bricks).bricks()])
    }
}
