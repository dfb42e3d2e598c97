//! Pictures as arrays and files.

use std::path::{Path, PathBuf};

use numpy::{PyArray1, PyArray3, PyArrayMethods, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use sheetsplat::Image;
use sheetsplat::image::{PngDepth, output};

use crate::error::{self, Raised, setting};
use crate::process::detached;

/// The pixels as an array height × width × 4 that owns them.
pub(crate) fn array(py: Python<'_>, image: Image) -> PyResult<Bound<'_, PyArray3<f32>>> {
    let Image { width, height, pixels } = image;
    PyArray1::from_vec(py, pixels.into_flattened()).reshape([height as usize, width as usize, 4])
}

/// The image of an array height × width × 4 of premultiplied numbers.
pub(crate) fn image(array: &PyReadonlyArray3<'_, f32>) -> Result<Image, Raised> {
    let (&[height, width, channels], view) = (array.shape(), array.as_array()) else {
        return Err(setting("image", &format!("{:?}", array.shape()), "height × width × 4"));
    };
    let sizes = (u32::try_from(width), u32::try_from(height), channels);
    let (Ok(width), Ok(height), 4) = sizes else {
        return Err(setting("image", &format!("{:?}", array.shape()), "height × width × 4"));
    };
    let channels: Vec<f32> = view.iter().copied().collect();
    let pixels = channels.chunks_exact(4).map(|pixel| [pixel[0], pixel[1], pixel[2], pixel[3]]).collect();
    Ok(Image { width, height, pixels })
}

fn png_depth(depth: u8) -> Result<PngDepth, Raised> {
    match depth {
        8 => Ok(PngDepth::Eight),
        16 => Ok(PngDepth::Sixteen),
        _ => Err(setting("depth", &depth.to_string(), "8 or 16 bits per channel")),
    }
}

/// Checks a file's extension before a long render.
#[pyfunction]
pub(crate) fn check_format(path: PathBuf) -> PyResult<()> {
    Ok(Image::check_format(&path).map_err(Raised::from)?)
}

/// Saves a picture by the file's extension.
#[pyfunction]
pub(crate) fn save(py: Python<'_>, array: PyReadonlyArray3<'_, f32>, path: PathBuf, depth: u8) -> PyResult<()> {
    let (image, depth) = (image(&array)?, png_depth(depth)?);
    Ok(detached(py, || image.save(&path, depth).map_err(Raised::from))?)
}

/// Writes a whole file, as pictures are written: aside, and then renamed.
#[pyfunction]
pub(crate) fn write(py: Python<'_>, path: PathBuf, bytes: &[u8]) -> PyResult<()> {
    Ok(detached(py, || output::write(&path, bytes)).map_err(|source| error::file(&path, &source))?)
}

/// The bytes of a PNG.
#[pyfunction]
pub(crate) fn encode<'py>(
    py: Python<'py>,
    array: PyReadonlyArray3<'py, f32>,
    depth: u8,
) -> PyResult<Bound<'py, PyBytes>> {
    let (image, depth) = (image(&array)?, png_depth(depth)?);
    let bytes = detached(py, || image.encode(Path::new("picture.png"), depth).map_err(Raised::from))?;
    Ok(PyBytes::new(py, &bytes))
}
