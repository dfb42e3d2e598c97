//! Values and labels of voxels from NumPy arrays, in the library's own form: one pass over an array, whatever its strides, into memory that was
//! reserved before. Values of 8 and 16 bits stay as they are, all others become `f32`.

use std::fmt::Display;
use std::marker::PhantomData;
use std::sync::Arc;

use numpy::ndarray::ArrayView3;
use numpy::{Element, PyArray3, PyArrayMethods, PyReadonlyArray3, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PySlice;
use sheetsplat::volume::Values;

use crate::error::{self, Raised};

/// The samples that are converted at once if NumPy must convert them first, so that no second copy of an array is made.
const BLOCK: usize = 1 << 20;

/// A number of an array.
trait Sample: Element + Copy + Display {
    fn value(self) -> f32;

    /// The sample as a label; `None` if it is no whole number from 0 to 65535.
    fn label(self) -> Option<u16>;
}

/// What samples become: values or labels.
trait Voxels {
    type Voxel: Copy + Default;

    fn of(sample: impl Sample) -> Option<Self::Voxel>;
}

/// Labels.
struct OfLabels;

impl Voxels for OfLabels {
    type Voxel = u16;

    fn of(sample: impl Sample) -> Option<u16> {
        sample.label()
    }
}

/// Values of a type that holds the samples.
struct OfValues<T>(PhantomData<T>);

macro_rules! of_values {
    ($($type:ty),*) => {
        $(impl Voxels for OfValues<$type> {
            type Voxel = $type;

            fn of(sample: impl Sample) -> Option<$type> {
                Some(sample.value() as $type)
            }
        })*
    };
}
of_values! { i8, u8, i16, u16, f32 }

/// Calls a macro with each type of sample.
macro_rules! for_each_type {
    ($call:ident) => {
        $call! { i8, u8, i16, u16, i32, u32, i64, u64, f32, f64 }
    };
}

macro_rules! sample {
    ($($type:ty),*) => {
        $(impl Sample for $type {
            fn value(self) -> f32 {
                self as f32
            }

            fn label(self) -> Option<u16> {
                // Back in the sample's own type, -1 of 8 or 16 bits would be the label 65535.
                let label = self as u16;
                (f64::from(label) == self as f64).then_some(label)
            }
        })*
    };
}
for_each_type! { sample }

/// The number of voxels along z, y and x of arrays that are to become a volume, and what they may take.
pub(crate) struct Sizes {
    shape: [usize; 3],
    voxels: usize,
}

impl Sizes {
    /// The sizes of a shape.
    pub(crate) fn of(shape: &[usize]) -> Result<Self, Raised> {
        let &[z, y, x] = shape else {
            return Err(error::volume("shape", &format!("{shape:?}"), "three sizes z, y, x"));
        };
        let count = [z, y, x].iter().try_fold(1_u32, |product, &size| product.checked_mul(u32::try_from(size).ok()?));
        let count = count.filter(|&count| count > 0).ok_or_else(|| {
            let allowed = "three sizes of at least 1, at most 4294967295 voxels";
            error::volume("sizes", &format!("{z}×{y}×{x}"), allowed)
        });
        Ok(Self { shape: [z, y, x], voxels: count? as usize })
    }

    /// Checks that the values of some channels, of which each value takes some bytes, and labels fit into a number of bytes.
    pub(crate) fn check(&self, channels: &[usize], labels: bool, limit: u64) -> Result<(), Raised> {
        let of_voxel = channels.iter().fold(0_u64, |sum, &bytes| sum.saturating_add(bytes as u64));
        let bytes = of_voxel.saturating_mul(self.voxels as u64);
        let bytes = if labels { bytes.saturating_add(self.bytes::<u16>()) } else { bytes };
        if bytes <= limit {
            return Ok(());
        }
        let [z, y, x] = self.shape;
        let of = if channels.len() < 2 { String::new() } else { format!(" of {} channels", channels.len()) };
        let with = if labels { " with labels" } else { "" };
        let found = format!("{z}×{y}×{x} voxels{of}{with}, which take {bytes} bytes");
        Err(error::volume("memory", &found, &format!("at most the memory limit of {limit} bytes")))
    }

    /// The bytes of one voxel of some type each.
    fn bytes<V>(&self) -> u64 {
        self.voxels as u64 * size_of::<V>() as u64
    }

    /// The sizes along x, y and z.
    fn dims(&self) -> [u32; 3] {
        let [z, y, x] = self.shape.map(|size| size as u32);
        [x, y, z]
    }

    /// Memory for one voxel of some type each.
    fn reserved<V>(&self) -> Result<Vec<V>, Raised> {
        let mut voxels = Vec::new();
        voxels.try_reserve_exact(self.voxels).map_err(|_| {
            let found = format!("{} bytes", self.bytes::<V>());
            error::volume("memory", &found, "as much as the operating system grants")
        })?;
        Ok(voxels)
    }
}

/// The sizes of an array.
pub(crate) fn sizes(array: &Bound<'_, PyAny>) -> Result<Sizes, Raised> {
    Sizes::of(array.cast::<PyUntypedArray>().map_err(|_| untyped(array))?.shape())
}

/// The bytes that each value of an array takes in the library's own form; fewer if it then turns out that fewer hold them all.
pub(crate) fn value_bytes(array: &Bound<'_, PyAny>) -> PyResult<usize> {
    Ok(match kind_and_bytes(array)? {
        (kind, bytes @ 1..=2) if kind != "f" => bytes,
        _ => size_of::<f32>(),
    })
}

/// The letter by which NumPy calls the kind of an array's samples, and their bytes.
fn kind_and_bytes(array: &Bound<'_, PyAny>) -> PyResult<(String, usize)> {
    let dtype = array.getattr("dtype")?;
    Ok((dtype.getattr("kind")?.extract()?, dtype.getattr("itemsize")?.extract()?))
}

/// The sizes and values of an array `[z, y, x]`, x fastest.
pub(crate) fn values(array: &Bound<'_, PyAny>) -> Result<([u32; 3], Values), Raised> {
    let sizes = sizes(array)?;
    let (kind, bytes) = kind_and_bytes(array)?;
    let values = match (kind.as_str(), bytes) {
        ("i", 1) => filled::<i8>(array, &sizes)?.into(),
        ("u", 1) => filled::<u8>(array, &sizes)?.into(),
        ("i", 2) => filled::<i16>(array, &sizes)?.into(),
        ("u", 2) => filled::<u16>(array, &sizes)?.into(),
        _ => filled::<f32>(array, &sizes)?.into(),
    };
    Ok((sizes.dims(), values))
}

/// The values of an array as numbers of a type.
fn filled<T: Copy + Default>(array: &Bound<'_, PyAny>, sizes: &Sizes) -> Result<Vec<T>, Raised>
where
    OfValues<T>: Voxels<Voxel = T>,
{
    let mut values = sizes.reserved()?;
    values.resize(sizes.voxels, T::default());
    fill::<OfValues<T>>(array, &mut values, sizes.shape)?;
    Ok(values)
}

/// The sizes and labels of an array `[z, y, x]`, x fastest.
pub(crate) fn labels(array: &Bound<'_, PyAny>) -> Result<([u32; 3], Arc<[u16]>), Raised> {
    let sizes = sizes(array)?;
    // Shared memory cannot be asked for in a way that may fail. This asks for as much, and gives it back.
    drop(sizes.reserved::<u16>()?);
    let mut labels: Arc<[u16]> = std::iter::repeat_n(0, sizes.voxels).collect();
    fill::<OfLabels>(array, Arc::make_mut(&mut labels), sizes.shape)?;
    Ok((sizes.dims(), labels))
}

/// The error for an array whose samples have an unsupported type.
fn untyped(array: &Bound<'_, PyAny>) -> Raised {
    let found = array.getattr("dtype").and_then(|dtype| Ok(dtype.str()?.to_string()));
    error::volume("dtype", &found.unwrap_or_else(|_| "no array".to_owned()), "integers or floating-point numbers")
}

/// The array with this type of sample, if that is how the processor reads it. While it is borrowed, no Rust code can change it.
fn typed<'py, T: Element>(array: &Bound<'py, PyAny>) -> Option<PyReadonlyArray3<'py, T>> {
    let array = array.cast::<PyArray3<T>>().ok().filter(|array| array.is_aligned())?;
    array.try_readonly().ok()
}

/// Fills memory with the samples of an array. Samples that the processor cannot read, such as those of another byte order, are first converted
/// by NumPy, a block at a time.
fn fill<V: Voxels>(array: &Bound<'_, PyAny>, voxels: &mut [V::Voxel], shape: [usize; 3]) -> Result<(), Raised> {
    if fill_typed::<V>(array, voxels, [0; 3])? {
        return Ok(());
    }
    let code = converted(array)?;
    let [_, y, x] = shape;
    // A block has several rows only if they are whole, and several planes only if they are.
    let width = x.min(BLOCK);
    let rows = (BLOCK / width).min(y);
    let planes = BLOCK / (width * rows);
    let mut voxels = voxels;
    for first in places(shape, [planes, rows, width]) {
        let ends: [usize; 3] = std::array::from_fn(|axis| (first[axis] + [planes, rows, width][axis]).min(shape[axis]));
        let slice = |axis: usize| PySlice::new(array.py(), first[axis] as isize, ends[axis] as isize, 1);
        let block = array.get_item((slice(0), slice(1), slice(2)))?.call_method1("astype", (code.as_str(),))?;
        let (of_block, rest) = voxels.split_at_mut((0..3).map(|axis| ends[axis] - first[axis]).product());
        if !fill_typed::<V>(&block, of_block, first)? {
            return Err(untyped(array));
        }
        voxels = rest;
    }
    Ok(())
}

/// The first voxels of blocks, x fastest.
fn places(shape: [usize; 3], block: [usize; 3]) -> impl Iterator<Item = [usize; 3]> {
    let steps = move |axis: usize| (0..shape[axis]).step_by(block[axis]);
    steps(0).flat_map(move |z| steps(1).flat_map(move |y| steps(2).map(move |x| [z, y, x])))
}

/// The type to which NumPy converts the samples of an array: the same in the machine's byte order, or the nearest that holds them.
fn converted(array: &Bound<'_, PyAny>) -> Result<String, Raised> {
    let (kind, bytes) = kind_and_bytes(array)?;
    Ok(match (kind.as_str(), bytes) {
        ("f", 0..=4) => "f4".to_owned(),
        ("f", _) => "f8".to_owned(),
        _ => format!("{kind}{bytes}"),
    })
}

/// Fills memory with the samples of an array, or of a block of one that begins at a voxel, if they have one of the types; whether they do.
fn fill_typed<V: Voxels>(array: &Bound<'_, PyAny>, voxels: &mut [V::Voxel], first: [usize; 3]) -> Result<bool, Raised> {
    macro_rules! fill {
        ($($type:ty),*) => {
            $(if let Some(array) = typed::<$type>(array) {
                return fill_from::<$type, V>(array.as_array(), voxels, first).map(|()| true);
            })*
        };
    }
    for_each_type! { fill }
    Ok(false)
}

fn fill_from<T: Sample, V: Voxels>(
    samples: ArrayView3<'_, T>,
    voxels: &mut [V::Voxel],
    first: [usize; 3],
) -> Result<(), Raised> {
    let is_refused = |(sample, voxel): (&T, &mut V::Voxel)| V::of(*sample).map(|of| *voxel = of).is_none();
    let refused = match samples.as_slice() {
        Some(samples) => samples.iter().zip(voxels).position(is_refused),
        None => samples.iter().zip(voxels).position(is_refused),
    };
    let Some(at) = refused else { return Ok(()) };
    let (_, y, x) = samples.dim();
    let place = [at / (y * x), at / x % y, at % x];
    let [z, y, x]: [usize; 3] = std::array::from_fn(|axis| first[axis] + place[axis]);
    let found = samples[place].to_string();
    Err(error::volume(&format!("labels[{z}, {y}, {x}]"), &found, "whole numbers from 0 to 65535"))
}
