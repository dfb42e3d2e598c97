//! The f64 evaluation of classification after splatting (SPEC §9): it follows the specification, and its images have the properties that hold
//! for every volume.

mod field;
mod gpu;
mod images;
mod modes;
mod properties;
mod refusals;
mod slab_integral;
mod tiles;

use glam::{DVec3, UVec3};
use sheetsplat::image::Image;
use sheetsplat::internals::reference;
use sheetsplat::scene::Scene;
use sheetsplat::settings::{Classification, Projection};
use sheetsplat::volume::{Grid, Volume};

/// A volume given by a function of the voxel.
pub(crate) fn volume(dims: [u32; 3], spacing: DVec3, value: impl Fn(UVec3) -> f64) -> Volume {
    let grid = Grid::new(UVec3::from(dims), spacing);
    let values = (0..grid.dims.element_product()).map(|index| value(grid.voxel_at(index)) as f32).collect();
    Volume::new("test", grid.dims, spacing, values).unwrap()
}

/// A scene that classifies after splatting.
pub(crate) fn scene(width: u32, height: u32) -> Scene {
    let mut scene = crate::common::scene(width, height);
    scene.splatting.classification = Classification::After;
    scene.image.background = [0.0; 4];
    scene.camera.up = DVec3::new(0.1, 0.2, 1.0);
    scene
}

/// A perspective camera with its eye at this distance, in world units.
pub(crate) fn eye(distance: f64) -> Projection {
    Projection::Perspective { fov_y: 25.0, distance: Some(distance), near: None }
}

pub(crate) fn render(volume: &Volume, scene: &Scene) -> Image {
    reference::render(volume, &[scene.channels[0].transfer.resolve(volume)], scene).unwrap()
}
