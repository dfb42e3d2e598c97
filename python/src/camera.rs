//! Cameras that follow a pointer.

use pyo3::prelude::*;
use sheetsplat::glam::{DVec2, DVec3};
use sheetsplat::settings::{Projection, navigation};

use crate::scene::Scene;
use crate::volume::Volume;

/// The degrees of a scene's eye over the plane perpendicular to `camera.up`, and the world point at its picture's centre.
#[pyfunction]
pub(crate) fn elevation_and_center(scene: &Scene) -> (f64, [f64; 3]) {
    let camera = &scene.scene.camera;
    (navigation::elevation(camera), camera.middle().to_array())
}

/// A scene whose camera states everything, with the camera turned by `azimuth` degrees right-handed about its up vector, its eye at an elevation in
/// degrees, with some magnification, and with a world point at the picture's centre.
#[pyfunction]
pub(crate) fn placed(home: &Scene, azimuth: f64, elevation: f64, zoom: f64, center: [f64; 3]) -> PyResult<Scene> {
    let mut camera = home.scene.camera;
    // A camera that did not turn keeps its direction to the last bit.
    let degrees = DVec2::new(-azimuth, elevation - navigation::elevation(&camera));
    if degrees != DVec2::ZERO {
        navigation::orbit(&mut camera, degrees);
    }
    match &mut camera.projection {
        Projection::Orthographic { height } => *height = height.map(|height| height / zoom),
        Projection::Perspective { distance, .. } => *distance = distance.map(|distance| distance / zoom),
    }
    camera.center = Some(DVec3::from_array(center));
    Ok(home.derived(sheetsplat::Scene { camera, ..home.scene.clone() })?)
}

/// The world point at a picture's centre after what was there has followed a pointer that moved by some heights of the picture.
#[pyfunction]
pub(crate) fn panned(scene: &Scene, volume: &Volume, right: f64, down: f64) -> [f64; 3] {
    let mut camera = scene.scene.camera;
    navigation::pan(&mut camera, DVec2::new(right, down) * height(scene, volume));
    camera.middle().to_array()
}

/// The size of a pixel at the depth of the picture's centre, in the volume's smallest voxel spacings.
#[pyfunction]
pub(crate) fn pixel(scene: &Scene, volume: &Volume) -> f64 {
    height(scene, volume) / f64::from(scene.scene.image.height) / volume.0.grid().unit()
}

/// The height of a picture in world units, at the depth of its centre.
fn height(scene: &Scene, volume: &Volume) -> f64 {
    let scene = &scene.scene;
    let size = [scene.image.width, scene.image.height];
    navigation::height(&scene.camera, volume.0.grid(), scene.splatting.radius, size)
}

/// A scene with the camera of another one.
#[pyfunction]
pub(crate) fn with_camera(scene: &Scene, other: &Scene) -> PyResult<Scene> {
    Ok(scene.derived(sheetsplat::Scene { camera: other.scene.camera, ..scene.scene.clone() })?)
}
