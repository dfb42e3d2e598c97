//! Pictures as arrays and files.

use std::io::Write;
use std::path::{Path, PathBuf};

use numpy::{PyArray1, PyArray3, PyArrayMethods, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use sheetsplat::Image;
use sheetsplat::image::PngDepth;
use sheetsplat::image::output::{Output, Target};
use sheetsplat::volume::{self, Outputs};

use crate::error::{self, Raised, setting};
use crate::process::{detached, may_commit, prepare_numpy};
use crate::provenance::Provenance;

/// The pixels as an array height × width × 4 that owns them.
pub(crate) fn array(py: Python<'_>, image: Image) -> PyResult<Bound<'_, PyArray3<f32>>> {
    prepare_numpy(py)?;
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

/// Saves a picture by the file's extension, unless that is the file of an input, with the text of how it was made.
#[pyfunction]
pub(crate) fn save(
    py: Python<'_>,
    array: PyReadonlyArray3<'_, f32>,
    path: PathBuf,
    depth: u8,
    inputs: Vec<PyRef<'_, Inputs>>,
    provenance: Option<Py<Provenance>>,
) -> PyResult<()> {
    let (image, depth) = (image(&array)?, png_depth(depth)?);
    refuse(&inputs, [&path])?;
    detached(py, move || {
        let bytes = match &provenance {
            Some(made) => made.get().encode(&image, &path, depth)?,
            None => image.encode(&path, depth)?,
        };
        output(&path, &bytes)
    })
}

/// Writes a whole file, as pictures are written: aside, and then renamed, unless that is the file of an input.
#[pyfunction]
pub(crate) fn write(py: Python<'_>, path: PathBuf, bytes: Vec<u8>, inputs: Vec<PyRef<'_, Inputs>>) -> PyResult<()> {
    refuse(&inputs, [&path])?;
    detached(py, move || output(&path, &bytes))
}

/// Writes a whole file, if anybody still waits for it.
pub(crate) fn output(path: &Path, bytes: &[u8]) -> Result<(), Raised> {
    let written = Target::of(path).and_then(Target::create).and_then(|mut output| {
        output.write_all(bytes)?;
        // Before Ctrl-C has to wait: a slow disk takes seconds.
        output.sync()?;
        if may_commit() { Output::commit(vec![output]).map_err(|(_, error)| error) } else { Ok(()) }
    });
    written.map_err(|source| error::file(path, &source))
}

/// The files that were read for a picture.
#[pyclass(frozen, module = "sheetsplat._native")]
pub(crate) struct Inputs(pub(crate) volume::Inputs);

/// Refuses files that would replace an input.
#[pyfunction]
pub(crate) fn check_outputs(paths: Vec<PathBuf>, inputs: Vec<PyRef<'_, Inputs>>) -> PyResult<()> {
    Ok(refuse(&inputs, &paths)?)
}

/// Refuses files that would replace an input.
pub(crate) fn refuse(
    inputs: &[PyRef<'_, Inputs>],
    paths: impl IntoIterator<Item = impl AsRef<Path>>,
) -> Result<(), Raised> {
    let outputs = Outputs::new(paths);
    inputs.iter().try_for_each(|inputs| Ok(inputs.0.check(&outputs)?))
}

/// The bytes of a PNG.
#[pyfunction]
pub(crate) fn encode<'py>(
    py: Python<'py>,
    array: PyReadonlyArray3<'py, f32>,
    depth: u8,
) -> PyResult<Bound<'py, PyBytes>> {
    let (image, depth) = (image(&array)?, png_depth(depth)?);
    let bytes = detached(py, move || image.encode(Path::new("picture.png"), depth).map_err(Raised::from))?;
    Ok(PyBytes::new(py, &bytes))
}
