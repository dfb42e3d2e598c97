//! Facts by which the words of Python's functions, such as `cmap=` and `azimuth=`, become the keys of scenes.

use pyo3::prelude::*;
use sheetsplat::appearance::Colormap;
use sheetsplat::settings::navigation;

use crate::error::Raised;
use crate::process::detached;
use crate::scene::Scene;
use crate::volume::Volume;

/// The names of the colour maps.
#[pyfunction]
pub(crate) fn colormaps() -> [&'static str; Colormap::ALL.len()] {
    Colormap::ALL.map(|(name, _)| name)
}

/// The evenly spaced colours of a map; `None` for the palette of a file, and for a name that no map has.
#[pyfunction]
pub(crate) fn colormap(name: &str) -> Option<Vec<[f64; 3]>> {
    let (_, map) = Colormap::ALL.into_iter().find(|(of, _)| *of == name)?;
    Some(map.rgb()?.into_iter().map(Into::into).collect())
}

/// The direction and the up vector of a scene's camera whose eye has gone to the right and up by some degrees, from where the volume has it.
#[pyfunction]
pub(crate) fn eye(
    py: Python<'_>,
    scene: &Scene,
    volume: &Volume,
    azimuth: f64,
    elevation: f64,
) -> PyResult<([f64; 3], [f64; 3])> {
    let (scene, volume) = (scene.scene.clone(), volume.0.clone());
    let moved = detached(py, move || {
        let camera = scene.camera_for(volume.sample());
        navigation::eye_moved(&camera, azimuth, elevation).map_err(Raised::from)
    })?;
    Ok((moved.direction.to_array(), moved.up.to_array()))
}

/// A scene with one label of a volume alone, by its name or its number.
#[pyfunction]
pub(crate) fn only(py: Python<'_>, scene: &Scene, volume: &Volume, label: String) -> PyResult<Scene> {
    let (shown, volume) = (scene.scene.clone(), volume.0.clone());
    let alone = detached(py, move || shown.only(&label, volume.sample()).map_err(Raised::from))?;
    Ok(scene.derived(alone)?)
}
