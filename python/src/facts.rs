//! The contents of a volume, as arrays and numbers of which the same volume can be made again.

use std::sync::Arc;

use numpy::{PyArray1, PyArray3, PyArray4, PyArrayMethods, PyReadonlyArray4, PyUntypedArrayMethods};
use pyo3::prelude::*;
use sheetsplat::volume::Texel;

use crate::error::{self, Raised};
use crate::process::{detached, prepare_numpy};
use crate::volume::{Volume, extent_and_mean};

/// The directions of x, y and z in the patient (RAS), and the position of the first voxel.
pub(crate) type Placement = ([[f64; 3]; 3], [f64; 3]);

/// The least and the greatest value in all channels. A streamed volume's are those of its sample. Both are NaN for a volume of holes.
#[pyfunction]
pub(crate) fn value_range(py: Python<'_>, volume: &Volume) -> PyResult<[f64; 2]> {
    let sample = Arc::clone(volume.0.sample());
    detached(py, move || {
        let ends = sample.channels().map(|channel| extent_and_mean(channel.values()));
        let [low, high] = ends
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], [least, most, _]| [low.min(least), high.max(most)]);
        Ok(if low <= high { [low, high] } else { [f64::NAN; 2] })
    })
}

/// A copy of the labels, `[z, y, x]`, in the order of the file or the array, by their own numbers; `None` if the volume is not segmented.
#[pyfunction]
pub(crate) fn label_array<'py>(py: Python<'py>, volume: &Volume) -> PyResult<Option<Bound<'py, PyAny>>> {
    let whole = volume.whole("labels")?;
    let Some(labels) = whole.labels() else { return Ok(None) };
    prepare_numpy(py)?;
    let (grid, dims) = (whole.grid(), whole.dims());
    let shape = [dims.z, dims.y, dims.x].map(|size| size as usize);
    if whole.label_ids().is_some() {
        let mut ids: Vec<u64> = labels.iter().map(|&label| whole.label_id(label)).collect();
        grid.reorder(&mut ids);
        let array: Bound<'_, PyArray3<u64>> = PyArray1::from_vec(py, ids).reshape(shape)?;
        return Ok(Some(array.into_any()));
    }
    let mut labels = labels.to_vec();
    grid.reorder(&mut labels);
    let array: Bound<'_, PyArray3<u16>> = PyArray1::from_vec(py, labels).reshape(shape)?;
    Ok(Some(array.into_any()))
}

/// A copy of the colours, `[z, y, x, 4]`, shares of 65535, in the order of the file or the array; `None` if the volume has none.
#[pyfunction]
pub(crate) fn color_array<'py>(py: Python<'py>, volume: &Volume) -> PyResult<Option<Bound<'py, PyArray4<u16>>>> {
    let whole = volume.whole("colours")?;
    let Some(colors) = whole.colors() else { return Ok(None) };
    prepare_numpy(py)?;
    let mut colors = colors.to_vec();
    whole.grid().reorder(&mut colors);
    let [x, y, z] = whole.dims().to_array().map(|size| size as usize);
    Ok(Some(PyArray1::from_vec(py, colors.into_flattened()).reshape([z, y, x, 4])?))
}

/// A volume of the luminances that its values are, with the colours that [`color_array`] gave.
#[pyfunction]
pub(crate) fn with_colors(volume: &Volume, colors: PyReadonlyArray4<'_, u16>) -> PyResult<Volume> {
    let whole = volume.whole("colours")?;
    let mut texels: Vec<Texel> = colors.as_slice().map_err(|_| unfit(&colors))?.as_chunks::<4>().0.to_vec();
    if texels.len() != whole.values().len() {
        return Err(unfit(&colors).into());
    }
    whole.grid().reorder(&mut texels);
    let colored = sheetsplat::Volume::clone(whole).with_texels(texels);
    Ok(Volume(colored.into(), volume.1.clone()))
}

/// The error for colours of another shape than a volume's.
fn unfit(colors: &PyReadonlyArray4<'_, u16>) -> Raised {
    error::volume("colours", &format!("{:?}", colors.shape()), "four contiguous numbers for each voxel")
}

/// How the volume lies in the patient, as its file or array states it.
#[pyfunction]
pub(crate) fn placement(volume: &Volume) -> Option<Placement> {
    let orientation = volume.0.sample().file_orientation()?;
    Some((orientation.axes.to_cols_array_2d(), orientation.origin.to_array()))
}
