//! Volumes of colours from arrays.

use glam::{DMat3, DVec3, UVec3};
use numpy::{PyReadonlyArray4, PyUntypedArrayMethods};
use pyo3::prelude::*;
use sheetsplat::glam;
use sheetsplat::volume::{Inputs, Orientation, SampleType};

use crate::error::{self, Raised};
use crate::facts::Placement;
use crate::process::detached;
use crate::volume::{ORIGIN, Volume, check_spacing, warn_of_holes, zyx};

/// A volume of colours from an array `[z, y, x, 4]` of red, green, blue and A, as numbers that a type of samples has: shares of its maximum, or of 1.
#[pyfunction]
pub(crate) fn color_volume(
    py: Python<'_>,
    colors: PyReadonlyArray4<'_, f32>,
    kind: &str,
    spacing: [f64; 3],
    placement: Option<Placement>,
    unit: Option<String>,
) -> PyResult<Volume> {
    check_spacing(spacing)?;
    let kind = match kind {
        "u1" => SampleType::U8,
        "u2" => SampleType::U16,
        _ => SampleType::F32,
    };
    let shape = colors.shape();
    let found = format!("{shape:?}");
    let refused = || error::volume("shape", &found, "z, y, x and 4 components, at most 4294967295 voxels");
    let &[z, y, x, 4] = shape else { return Err(refused().into()) };
    let [z, y, x] = [z, y, x].map(|size| u32::try_from(size).ok());
    let (Some(z), Some(y), Some(x)) = (z, y, x) else { return Err(refused().into()) };
    let numbers = colors.as_slice().map_err(|_| refused())?;
    let (texels, _) = numbers.as_chunks::<4>();
    let texels = texels.to_vec();
    let orientation = placement
        .map(|(axes, origin)| Orientation { axes: DMat3::from_cols_array_2d(&axes), origin: DVec3::from(origin) });
    let volume = detached(py, move || {
        let dims = UVec3::new(x, y, z);
        let volume = sheetsplat::Volume::from_colors(ORIGIN, dims, zyx(spacing), (&texels, kind))?;
        let volume = volume.with_orientation(ORIGIN, orientation)?;
        let volume = unit.iter().fold(volume, |volume, unit| volume.with_unit(unit)).into();
        warn_of_holes(&volume, 0);
        Ok::<_, Raised>(volume)
    })?;
    Ok(Volume(volume, Inputs::default()))
}
