//! Comparisons of pictures, and golden images.

use std::path::PathBuf;

use numpy::{PyArray3, PyReadonlyArray3};
use pyo3::prelude::*;
use sheetsplat::Image;
use sheetsplat::golden::{self, Golden, GoldenError, MadeOn, Outcome, Picture, Subject, Tolerance};

use crate::error::Raised;
use crate::image;
use crate::process::{detached, undisturbed};

/// A picture and where it was made.
struct Made {
    image: Image,
    made_on: Option<MadeOn>,
}

impl Subject for Made {
    fn image(&self) -> &Image {
        &self.image
    }

    fn made_on(&self) -> Option<MadeOn> {
        self.made_on.clone()
    }
}

/// The differences between two pictures.
#[pyclass(frozen, module = "sheetsplat._native")]
pub(crate) struct Comparison(golden::Comparison);

#[pymethods]
impl Comparison {
    #[getter]
    fn passes(&self) -> bool {
        self.0.passes()
    }

    #[getter]
    fn max(&self) -> [u16; 4] {
        self.0.max.map(u16::from)
    }

    #[getter]
    fn worst(&self) -> [u32; 2] {
        self.0.worst
    }

    #[getter]
    fn mean(&self) -> f64 {
        self.0.mean
    }

    #[getter]
    fn psnr_db(&self) -> f64 {
        self.0.psnr_db
    }

    #[getter]
    fn outliers(&self) -> u64 {
        self.0.outliers
    }

    fn difference_image<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        image::array(py, self.0.difference_image())
    }

    fn __str__(&self) -> String {
        self.0.to_string()
    }
}

/// Compares two pictures.
#[pyfunction]
pub(crate) fn compare(
    py: Python<'_>,
    actual: PyReadonlyArray3<'_, f32>,
    golden: PyReadonlyArray3<'_, f32>,
    per_channel: u8,
    outliers: f64,
) -> PyResult<Comparison> {
    let tolerance = Tolerance::new(per_channel, outliers).map_err(Raised::from)?;
    let [actual, golden] = [image::image(&actual)?, image::image(&golden)?];
    let comparison = detached(py, move || golden::Comparison::new(&actual, &golden, tolerance).map_err(Raised::from))?;
    Ok(Comparison(comparison))
}

/// A picture's pixels, and the adapter and driver that made it.
type Opened<'py> = (Bound<'py, PyArray3<f32>>, Option<(String, String)>);

/// Opens a picture, and says where it was made if the file tells.
#[pyfunction]
pub(crate) fn open_image(py: Python<'_>, path: PathBuf) -> PyResult<Opened<'_>> {
    let Picture { image, made_on, .. } = detached(py, move || Picture::open(&path).map_err(Raised::from))?;
    Ok((image::array(py, image)?, made_on.map(|made_on| (made_on.adapter, made_on.driver))))
}

/// Compares a picture with the golden `folder/NAME.png`: whether it was blessed, and the report if it failed.
#[pyfunction]
#[pyo3(signature = (name, folder, failures, array, made_on, tolerance))]
pub(crate) fn check_golden(
    py: Python<'_>,
    name: &str,
    folder: PathBuf,
    failures: PathBuf,
    array: PyReadonlyArray3<'_, f32>,
    made_on: Option<(String, String)>,
    tolerance: Option<(u8, f64)>,
) -> PyResult<(bool, Option<String>)> {
    let made_on = made_on.map(|(adapter, driver)| MadeOn { adapter, driver });
    let made = Made { image: image::image(&array)?, made_on };
    let mut golden = Golden::new(name, folder, failures).map_err(Raised::from)?;
    if let Some((per_channel, outliers)) = tolerance {
        golden = golden.tolerance(Tolerance::new(per_channel, outliers).map_err(Raised::from)?);
    }
    // It may write files, which Ctrl-C must not leave to be written later.
    match undisturbed(py, || Ok(golden.check(&made)))? {
        Ok(Outcome::Passed(_)) => Ok((false, None)),
        Ok(Outcome::Blessed(_)) => Ok((true, None)),
        Err(GoldenError::Failure(failure)) => Ok((false, Some(failure.to_string()))),
        Err(error) => Err(Raised::from(error).into()),
    }
}
