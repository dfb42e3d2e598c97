//! Parts of an image (SPEC §11).

use std::path::PathBuf;
use std::sync::Arc;

use numpy::PyArray3;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use sheetsplat::settings::{Region, Window};

use crate::error::Raised;
use crate::image::{self, Inputs};
use crate::process::detached;
use crate::scene::Scene;
use crate::volume::Volume;

/// A range of slabs, and the first column, the first row, the width and the height of a region.
pub(crate) type Piece = ((i32, i32), (u32, u32, u32, u32));

/// A part of an image.
#[pyclass(frozen, module = "sheetsplat._native")]
pub(crate) struct Part(pub(crate) Arc<sheetsplat::part::Part>);

/// The slabs and pixels of an image that are asked for; all of them where none are.
pub(crate) fn window(size: [u32; 2], slabs: Option<(i32, i32)>, region: Option<(u32, u32, u32, u32)>) -> Window {
    let mut window = Window::whole(size);
    if let Some((start, end)) = slabs {
        window.slabs = start..end;
    }
    if let Some((x, y, width, height)) = region {
        window.region = Region { x, y, width, height };
    }
    window
}

fn piece(Window { slabs, region }: &Window) -> Piece {
    ((slabs.start, slabs.end), (region.x, region.y, region.width, region.height))
}

#[pymethods]
impl Part {
    /// The part in a file.
    #[staticmethod]
    fn open(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let part = detached(py, move || sheetsplat::part::Part::open(&path).map_err(Raised::from))?;
        Ok(Self(Arc::new(part)))
    }

    /// The part that [`Self::to_bytes`] gave.
    #[staticmethod]
    fn from_bytes(py: Python<'_>, name: String, bytes: Vec<u8>) -> PyResult<Self> {
        let part = detached(py, move || sheetsplat::part::Part::from_exr(&name, &bytes).map_err(Raised::from))?;
        Ok(Self(Arc::new(part)))
    }

    /// Parts of the same pixels, whose slabs follow one another, as one part.
    #[staticmethod]
    fn join(py: Python<'_>, parts: Vec<Py<Self>>) -> PyResult<Self> {
        let parts = copies(&parts);
        let part = detached(py, move || sheetsplat::part::Part::join(parts).map_err(Raised::from))?;
        Ok(Self(Arc::new(part)))
    }

    /// Saves the part by the file's extension, unless that is the file of an input.
    fn save(&self, py: Python<'_>, path: PathBuf, inputs: Vec<PyRef<'_, Inputs>>) -> PyResult<()> {
        image::refuse(&inputs, [&path])?;
        let part = Arc::clone(&self.0);
        detached(py, move || {
            let bytes = part.encode(&path)?;
            image::output(&path, &bytes)
        })
    }

    /// The bytes of an EXR file.
    fn to_bytes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let part = Arc::clone(&self.0);
        let bytes = detached(py, move || part.encode("part.exr".as_ref()).map_err(Raised::from))?;
        Ok(PyBytes::new(py, &bytes))
    }

    /// What errors call it.
    #[getter]
    fn name(&self) -> &str {
        &self.0.name
    }

    /// Its slabs and pixels.
    #[getter]
    fn piece(&self) -> Piece {
        piece(&self.0.window)
    }

    /// The first slab of the scene, and the one after the last.
    #[getter]
    fn scene_slabs(&self) -> (i32, i32) {
        let slabs = &self.0.identity.slabs;
        (slabs.start, slabs.end)
    }
}

fn copies(parts: &[Py<Part>]) -> Vec<sheetsplat::part::Part> {
    parts.iter().map(|part| (*part.get().0).clone()).collect()
}

/// The whole image.
#[pyfunction]
pub(crate) fn merge<'py>(py: Python<'py>, parts: Vec<Py<Part>>) -> PyResult<Bound<'py, PyArray3<f32>>> {
    let parts = copies(&parts);
    let merged = detached(py, move || sheetsplat::Image::merge(parts).map_err(Raised::from))?;
    image::array(py, merged)
}

/// Parts of about equal work.
#[pyfunction]
pub(crate) fn split(py: Python<'_>, volume: &Volume, scene: &Scene, parts: usize) -> PyResult<Vec<Piece>> {
    let (volume, scene) = (volume.0.clone(), scene.scene.clone());
    let windows = detached(py, move || sheetsplat::part::split(&volume, &scene, parts).map_err(Raised::from))?;
    Ok(windows.iter().map(piece).collect())
}
