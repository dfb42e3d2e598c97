//! Parts of an image (SPEC §11).

use std::path::PathBuf;

use numpy::PyArray3;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use sheetsplat::settings::{Region, Window};

use crate::error::Raised;
use crate::image;
use crate::process::detached;
use crate::scene::Scene;
use crate::volume::Volume;

/// A range of slabs, and the first column, the first row, the width and the height of a region.
pub(crate) type Piece = ((i32, i32), (u32, u32, u32, u32));

/// A part of an image.
#[pyclass(frozen, module = "sheetsplat._native")]
pub(crate) struct Part(pub(crate) sheetsplat::part::Part);

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
        Ok(detached(py, || sheetsplat::part::Part::open(&path).map(Self).map_err(Raised::from))?)
    }

    /// The part that [`Self::to_bytes`] gave.
    #[staticmethod]
    fn from_bytes(py: Python<'_>, name: &str, bytes: &[u8]) -> PyResult<Self> {
        Ok(detached(py, || sheetsplat::part::Part::from_exr(name, bytes).map(Self).map_err(Raised::from))?)
    }

    /// Parts of the same pixels, whose slabs follow one another, as one part.
    #[staticmethod]
    fn join(py: Python<'_>, parts: Vec<Py<Self>>) -> PyResult<Self> {
        let parts: Vec<_> = parts.iter().map(|part| part.get().0.clone()).collect();
        Ok(detached(py, || sheetsplat::part::Part::join(parts).map(Self).map_err(Raised::from))?)
    }

    /// Saves the part by the file's extension.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        Ok(detached(py, || self.0.save(&path).map_err(Raised::from))?)
    }

    /// The bytes of an EXR file.
    fn to_bytes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = detached(py, || self.0.encode("part.exr".as_ref()).map_err(Raised::from))?;
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

/// The whole image.
#[pyfunction]
pub(crate) fn merge<'py>(py: Python<'py>, parts: Vec<Py<Part>>) -> PyResult<Bound<'py, PyArray3<f32>>> {
    let parts: Vec<_> = parts.iter().map(|part| part.get().0.clone()).collect();
    let merged = detached(py, || sheetsplat::Image::merge(parts).map_err(Raised::from))?;
    image::array(py, merged)
}

/// Parts of about equal work.
#[pyfunction]
pub(crate) fn split(py: Python<'_>, volume: &Volume, scene: &Scene, parts: usize) -> PyResult<Vec<Piece>> {
    let windows = detached(py, || sheetsplat::part::split(&volume.0, &scene.scene, parts).map_err(Raised::from))?;
    Ok(windows.iter().map(piece).collect())
}
