//! Scenes.

use std::path::{Path, PathBuf};

use pyo3::prelude::*;
use pyo3::types::PyDict;
use sheetsplat::annotate::{Annotation, layout};
use sheetsplat::appearance::Preset;
use sheetsplat::scene::VolumeSource;
use sheetsplat::volume::{Inputs, Outputs, PatientSide};

use crate::error::{Raised, setting};
use crate::process::detached;
use crate::settings;
use crate::volume::{BytesRead, Volume, reading, warn_of_holes};

/// The sides of a patient.
const SIDES: [(&str, PatientSide); 6] = [
    ("front", PatientSide::Front),
    ("back", PatientSide::Back),
    ("left", PatientSide::Left),
    ("right", PatientSide::Right),
    ("top", PatientSide::Top),
    ("bottom", PatientSide::Bottom),
];

/// A checked scene, and what it was read from, so that settings can be replaced as the program's `--set` does.
#[pyclass(frozen, module = "sheetsplat._native")]
pub(crate) struct Scene {
    pub(crate) scene: sheetsplat::Scene,
    text: String,
    origin: String,
    folder: PathBuf,
    sets: Vec<String>,
}

impl Scene {
    fn read(text: String, origin: String, folder: PathBuf, sets: Vec<String>) -> Result<Self, Raised> {
        let scene = sheetsplat::Scene::parse_for(VolumeSource::Memory, &text, &origin, &folder, &sets)?;
        Ok(Self { scene, text, origin, folder, sets })
    }

    /// A scene that was derived from this one.
    pub(crate) fn derived(&self, scene: sheetsplat::Scene) -> Result<Self, Raised> {
        Self::of(scene, self.origin.clone())
    }

    /// A scene with a name for errors.
    pub(crate) fn of(scene: sheetsplat::Scene, origin: String) -> Result<Self, Raised> {
        let folder = PathBuf::from(".");
        Ok(Self { text: scene.to_toml(&folder)?, scene, origin, folder, sets: Vec::new() })
    }
}

#[pymethods]
impl Scene {
    /// A scene of TOML text with settings over it. Paths in the text are relative to `folder`.
    #[new]
    fn new(text: String, origin: String, folder: PathBuf, settings: &Bound<'_, PyDict>) -> PyResult<Self> {
        Ok(Self::read(text, origin, folder, settings::sets(settings)?)?)
    }

    /// The same scene with other settings.
    fn replaced(&self, settings: &Bound<'_, PyDict>) -> PyResult<Self> {
        let new = settings::sets(settings)?;
        let key = |set: &String| set.split_once('=').map(|(key, _)| key.to_owned());
        // Without those that have a new value, so that a scene does not grow while a setting changes many times.
        let is_kept = |old: &&String| !new.iter().any(|new| key(new) == key(old));
        let mut sets: Vec<_> = self.sets.iter().filter(is_kept).cloned().collect();
        sets.extend(new);
        Ok(Self::read(self.text.clone(), self.origin.clone(), self.folder.clone(), sets)?)
    }

    /// Whether the scene names its volume.
    #[getter]
    fn names_volume(&self) -> bool {
        self.scene.channels.first().volume != VolumeSource::Memory
    }

    /// The volume that the scene names.
    #[pyo3(signature = (memory, bytes_read, index=None))]
    fn load_volume(
        &self,
        py: Python<'_>,
        memory: Option<&str>,
        bytes_read: Option<&BytesRead>,
        index: Option<PathBuf>,
    ) -> PyResult<Volume> {
        let inputs = Inputs::default();
        let options = reading(memory, index, bytes_read)?.noted_in(&inputs);
        let scene = self.scene.clone();
        let volume = detached(py, move || {
            let volume = scene.open_volume_with(&options)?;
            warn_of_holes(&volume, 0);
            Ok(volume)
        })?;
        Ok(Volume(volume, inputs))
    }

    /// The scene with everything stated that depends on the volume; `all_around` for a camera that turns, `annotate` for words beside its pictures.
    fn explicit(&self, py: Python<'_>, volume: &Volume, all_around: bool, annotate: Vec<String>) -> PyResult<Self> {
        let annotations = annotations(&annotate)?;
        let (scene, volume) = (self.scene.clone(), volume.0.clone());
        let explicit = detached(py, move || {
            let volume = volume.sample();
            scene.check_volume(volume)?;
            let layout = (!annotations.is_empty()).then(|| layout(&annotations, &scene, volume)).transpose()?;
            let beside = layout.as_ref().map_or_else(|| scene.clone(), |layout| layout.scene(&scene));
            let stated = if all_around { beside.explicit_all_around(volume) } else { beside.explicit(volume) };
            Ok::<_, Raised>(layout.map_or_else(|| stated.clone(), |layout| layout.whole(&stated)))
        })?;
        Ok(self.derived(explicit)?)
    }

    /// The scene with the camera turned about its up vector.
    fn turned(&self, degrees: f64) -> PyResult<Self> {
        if !degrees.is_finite() {
            return Err(setting("turn", &degrees.to_string(), "a finite number of degrees").into());
        }
        Ok(self.derived(sheetsplat::Scene { camera: self.scene.camera.turned(degrees), ..self.scene.clone() })?)
    }

    /// The scene with the camera on one side of the patient.
    fn seen_from(&self, volume: &Volume, side: &str) -> PyResult<Self> {
        let Some(&(_, side)) = SIDES.iter().find(|(name, _)| *name == side) else {
            let allowed = SIDES.map(|(name, _)| format!("{name:?}")).join(", ");
            return Err(setting("side", &format!("{side:?}"), &allowed).into());
        };
        let Some(orientation) = volume.0.sample().orientation() else {
            let allowed = "a volume that says how the patient lies, or camera.direction and camera.up";
            return Err(setting("side", "a volume without orientation", allowed).into());
        };
        let mut scene = self.scene.clone();
        scene.camera = scene.camera.looking(orientation.direction_and_up(side));
        Ok(self.derived(scene)?)
    }

    /// Refuses a file that would replace one that the scene names.
    fn check_output(&self, path: PathBuf) -> PyResult<()> {
        let outputs = Outputs::new([&path]);
        for channel in &self.scene.channels {
            for named in [channel.volume.path(), channel.labels.as_deref()].into_iter().flatten() {
                outputs.check_file(named, named).map_err(Raised::from)?;
            }
        }
        Ok(())
    }

    /// The text of a scene file in a folder.
    fn to_toml(&self, folder: PathBuf) -> PyResult<String> {
        Ok(self.scene.to_toml(Path::new(&folder)).map_err(Raised::from)?)
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.scene == other.scene
    }
}

/// The names of the presets.
#[pyfunction]
pub(crate) fn presets() -> [&'static str; Preset::ALL.len()] {
    Preset::ALL.map(|(name, _)| name)
}

/// The annotations of some names.
pub(crate) fn annotations(names: &[String]) -> Result<Vec<Annotation>, Raised> {
    names.iter().map(|name| name.parse().map_err(|error: sheetsplat::SettingError| Raised::from(error))).collect()
}
