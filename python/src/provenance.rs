//! Pictures that tell how they were made.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError, Weak};

use pyo3::prelude::*;
use sheetsplat::Image;
use sheetsplat::annotate::Layout;
use sheetsplat::image::PngDepth;
use sheetsplat::provenance::{self, Sources, Verifier};
use sheetsplat::scene::{Channel, OpenVolume, VolumeSource};
use sheetsplat::stats::Stats;
use sheetsplat::volume::{Inputs, ReadOptions};

use crate::error::{Raised, file, picture};
use crate::process::detached;
use crate::scene::Scene;
use crate::volume::Volume;

/// How a picture was made. The files of its volume are looked at when the picture is saved: most pictures never are.
#[pyclass(frozen, module = "sheetsplat._native")]
pub(crate) struct Provenance {
    pub(crate) scene: sheetsplat::Scene,
    pub(crate) layout: Option<Layout>,
    pub(crate) annotate: Vec<String>,
    pub(crate) stats: Stats,
    pub(crate) volume: Drawn,
    pub(crate) inputs: Inputs,
    /// Shared by the pictures of a view.
    pub(crate) known: Known,
}

/// The files and values behind a volume, once they are known.
pub(crate) type Known = Arc<Mutex<Option<Sources>>>;

/// The volume that was drawn, which a picture does not keep in memory.
pub(crate) enum Drawn {
    Whole(Weak<sheetsplat::Volume>),
    Streamed(OpenVolume),
}

impl Drawn {
    pub(crate) fn of(volume: &OpenVolume) -> Self {
        match volume {
            OpenVolume::Whole(volume) => Self::Whole(Arc::downgrade(volume)),
            streamed @ OpenVolume::Streamed(_) => Self::Streamed(streamed.clone()),
        }
    }

    fn get(&self) -> Option<OpenVolume> {
        match self {
            Self::Whole(volume) => volume.upgrade().map(OpenVolume::Whole),
            Self::Streamed(volume) => Some(volume.clone()),
        }
    }
}

impl Provenance {
    /// The bytes of a picture's file.
    pub(crate) fn encode(&self, image: &Image, path: &Path, depth: PngDepth) -> Result<Vec<u8>, Raised> {
        let volume = self.volume.get();
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let sources = match &*known {
            Some(sources) => sources,
            None => known.insert(Sources::of(volume.as_ref(), &self.scene, &self.inputs)),
        };
        let scene = volume.map_or_else(|| self.scene.clone(), |volume| self.scene.explicit(volume.sample()));
        let whole = self.layout.as_ref().map_or_else(|| scene.clone(), |layout| layout.whole(&scene));
        let made = provenance::Provenance::of(path, &whole, sources, &self.stats, &self.annotate)?;
        Ok(made.encode(image, path, depth)?)
    }
}

/// A scene whose volume is the one that another scene names; without it, one from memory.
pub(crate) fn named(scene: &sheetsplat::Scene, other: Option<&sheetsplat::Scene>) -> sheetsplat::Scene {
    let others = other.map_or(&[][..], |other| &other.channels);
    // A scene of fewer channels shows some that it does not name.
    let others = if others.len() > scene.channels.len() { &[] } else { others };
    let mut named = scene.clone();
    for (number, channel) in named.channels.iter_mut().enumerate() {
        let of = others.get(number).cloned().unwrap_or_else(|| Channel::new(VolumeSource::Memory));
        let shown = std::mem::replace(channel, of);
        (channel.name, channel.visible, channel.transfer) = (shown.name, shown.visible, shown.transfer);
    }
    named
}

/// Reads how a picture was made.
fn read(path: &Path) -> Result<provenance::Provenance, Raised> {
    let read = provenance::Provenance::open(path, &ReadOptions::default())?;
    read.ok_or_else(|| picture(path, "a picture that holds no scene", "one that was saved with it"))
}

/// The scene of a picture.
#[pyfunction]
pub(crate) fn scene_of_picture(py: Python<'_>, path: PathBuf, search: Vec<PathBuf>) -> PyResult<Scene> {
    detached(py, move || Scene::of(read(&path)?.scene(&path, &search, &[])?, path.display().to_string()))
}

/// Draws a picture again: why it is not the same, the version and the backend that drew it, and its deviation from the f64 evaluation.
#[pyfunction]
pub(crate) fn verify(
    py: Python<'_>,
    path: PathBuf,
    volume: Option<PyRef<'_, Volume>>,
    search: Vec<PathBuf>,
    oracle: u32,
    any_version: bool,
) -> PyResult<(Vec<String>, String, String, Option<f64>)> {
    let volume = volume.map(|volume| volume.0.clone());
    detached(py, move || {
        let mut verifier = Verifier::default().searching(search).with_oracle(oracle);
        if let Some(volume) = volume {
            verifier = verifier.with_volume(volume);
        }
        if any_version {
            verifier = verifier.of_any_version();
        }
        // A file that is missing is no picture that cannot be verified.
        std::fs::metadata(&path).map_err(|source| file(&path, &source))?;
        let verified = verifier.verify(&path)?;
        let made = verified.provenance;
        let deviation = verified.deviation.map(|deviation| deviation.largest);
        Ok((verified.reasons, made.version().to_owned(), made.backend().to_owned(), deviation))
    })
}
