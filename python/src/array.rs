//! Values and labels of voxels from NumPy arrays, in the library's own form: one pass over an array, whatever its strides.

use numpy::{Element, PyArray3, PyArrayMethods, PyReadonlyArray3};
use pyo3::prelude::*;

use crate::error::{self, Raised};

/// Calls a macro with each type of sample.
macro_rules! for_each_type {
    ($call:ident) => {
        $call!(i8, u8, i16, u16, i32, u32, i64, u64, f32, f64)
    };
}

/// The error for an array that is none of the types; the Python part has converted all others.
fn untyped(array: &Bound<'_, PyAny>) -> Raised {
    let found = array.getattr("dtype").and_then(|dtype| Ok(dtype.str()?.to_string()));
    error::volume("dtype", &found.unwrap_or_else(|_| "no array".to_owned()), "integers or floating-point numbers")
}

/// The array with this type of sample, if it has it. While it is borrowed, no Rust code can change it.
fn typed<'py, T: Element>(array: &Bound<'py, PyAny>) -> Option<PyReadonlyArray3<'py, T>> {
    array.cast::<PyArray3<T>>().ok().and_then(|array| array.try_readonly().ok())
}

/// The sizes x, y and z of an array `[z, y, x]`.
fn dims(shape: &[usize]) -> Result<[u32; 3], Raised> {
    let sizes: Option<Vec<u32>> = shape.iter().rev().map(|&size| u32::try_from(size).ok()).collect();
    let sizes: Option<[u32; 3]> = sizes.and_then(|sizes| sizes.try_into().ok());
    sizes.ok_or_else(|| error::volume("shape", &format!("{shape:?}"), "three sizes z, y, x of less than 2³²"))
}

/// The sizes and values of an array `[z, y, x]`, x fastest.
pub(crate) fn values(array: &Bound<'_, PyAny>) -> Result<([u32; 3], Vec<f32>), Raised> {
    macro_rules! read {
        ($($type:ty),*) => {
            $(if let Some(array) = typed::<$type>(array) {
                let view = array.as_array();
                return Ok((dims(view.shape())?, view.iter().map(|&sample| sample as f32).collect()));
            })*
        };
    }
    for_each_type!(read);
    Err(untyped(array))
}

/// The sizes and labels of an array `[z, y, x]`, x fastest.
pub(crate) fn labels(array: &Bound<'_, PyAny>) -> Result<([u32; 3], Vec<u16>), Raised> {
    macro_rules! read {
        ($($type:ty),*) => {
            $(if let Some(array) = typed::<$type>(array) {
                let view = array.as_array();
                let label = |(place, &sample): ((usize, usize, usize), &$type)| {
                    let label = sample as u16;
                    let refused = || {
                        let field = format!("labels[{}, {}, {}]", place.0, place.1, place.2);
                        error::volume(&field, &sample.to_string(), "whole numbers from 0 to 65535")
                    };
                    (label as $type == sample).then_some(label).ok_or_else(refused)
                };
                return Ok((dims(view.shape())?, view.indexed_iter().map(label).collect::<Result<_, _>>()?));
            })*
        };
    }
    for_each_type!(read);
    Err(untyped(array))
}
