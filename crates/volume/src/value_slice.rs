//! Values that a volume lends, of whichever type they are kept in.

use std::ops::RangeBounds;
use std::slice::Iter;

use super::sample_type::Sample;
use crate::parallel::Indexed;
use crate::parallel::prelude::*;

/// The values that one thread looks at at a time.
pub(super) const CHUNK: usize = 1 << 16;

/// The range of no whole number.
const EMPTY: [i32; 2] = [i32::MAX, i32::MIN];

/// A part of a volume's [`Values`](super::Values), or any other slice of numbers of their types. Each number is told as the `f32` that equals it.
#[derive(Clone, Copy, Debug)]
pub enum ValueSlice<'a> {
    /// Whole numbers from 0 to 255.
    #[cfg(not(target_arch = "wasm32"))]
    U8(&'a [u8]),
    /// Whole numbers from -128 to 127.
    #[cfg(not(target_arch = "wasm32"))]
    I8(&'a [i8]),
    /// Whole numbers from 0 to 65535.
    #[cfg(not(target_arch = "wasm32"))]
    U16(&'a [u16]),
    /// Whole numbers from -32768 to 32767.
    #[cfg(not(target_arch = "wasm32"))]
    I16(&'a [i16]),
    /// Any numbers.
    F32(&'a [f32]),
}

/// The numbers of a [`ValueSlice`], one after the other.
#[derive(Clone, Debug)]
pub struct ValueIter<'a>(Numbers<'a>);

#[derive(Clone, Debug)]
enum Numbers<'a> {
    #[cfg(not(target_arch = "wasm32"))]
    U8(Iter<'a, u8>),
    #[cfg(not(target_arch = "wasm32"))]
    I8(Iter<'a, i8>),
    #[cfg(not(target_arch = "wasm32"))]
    U16(Iter<'a, u16>),
    #[cfg(not(target_arch = "wasm32"))]
    I16(Iter<'a, i16>),
    F32(Iter<'a, f32>),
}

/// Evaluates an expression in which a name stands for what the given variant of an enum of the five types holds, whichever it is. It is compiled for each
/// type.
#[doc(hidden)]
#[macro_export]
macro_rules! for_type {
    ($enum:ident, $of:expr, $name:ident => $result:expr) => {
        match $of {
            #[cfg(not(target_arch = "wasm32"))]
            $enum::U8($name) => $result,
            #[cfg(not(target_arch = "wasm32"))]
            $enum::I8($name) => $result,
            #[cfg(not(target_arch = "wasm32"))]
            $enum::U16($name) => $result,
            #[cfg(not(target_arch = "wasm32"))]
            $enum::I16($name) => $result,
            $enum::F32($name) => $result,
        }
    };
}

impl<'a> ValueSlice<'a> {
    /// The number of values.
    pub fn len(self) -> usize {
        for_type!(Self, self, values => values.len())
    }

    /// Whether there are no values.
    pub fn is_empty(self) -> bool {
        self.len() == 0
    }

    /// The bytes of memory that the values take.
    pub fn bytes(self) -> usize {
        for_type!(Self, self, values => size_of_val(values))
    }

    /// The value at an index.
    ///
    /// # Panics
    /// If the index is not less than the number of values.
    #[inline]
    pub fn at(self, index: usize) -> f32 {
        for_type!(Self, self, values => values[index].to_f32())
    }

    /// The values at the indices of a range.
    ///
    /// # Panics
    /// If the range ends before it begins, or behind the last value.
    pub fn slice(self, range: impl RangeBounds<usize>) -> Self {
        let ends = (range.start_bound().cloned(), range.end_bound().cloned());
        for_type!(Self, self, values => values[ends].into())
    }

    /// Sets the flags of those of as many values that a test is true of.
    #[doc(hidden)]
    pub fn flag(self, flags: &mut [bool], test: impl Fn(f32) -> bool) {
        for_type!(Self, self, values => {
            flags.iter_mut().zip(values).for_each(|(flag, value)| *flag |= test(value.to_f32()));
        });
    }

    /// The values, one after the other.
    pub fn iter(self) -> ValueIter<'a> {
        ValueIter(match self {
            #[cfg(not(target_arch = "wasm32"))]
            Self::U8(values) => Numbers::U8(values.iter()),
            #[cfg(not(target_arch = "wasm32"))]
            Self::I8(values) => Numbers::I8(values.iter()),
            #[cfg(not(target_arch = "wasm32"))]
            Self::U16(values) => Numbers::U16(values.iter()),
            #[cfg(not(target_arch = "wasm32"))]
            Self::I16(values) => Numbers::I16(values.iter()),
            Self::F32(values) => Numbers::F32(values.iter()),
        })
    }

    /// Runs of `size` values one after the other; the last one may be shorter.
    ///
    /// # Panics
    /// If `size` is 0.
    pub fn chunks(self, size: usize) -> impl ExactSizeIterator<Item = Self> + Clone {
        (0..self.len().div_ceil(size)).map(move |number| self.chunk(size, number))
    }

    /// A copy of the values.
    pub fn to_vec(self) -> Vec<f32> {
        let mut all = Vec::with_capacity(self.len());
        self.iter().for_each(|value| all.push(value));
        all
    }

    /// [`Self::iter`] on every core.
    #[doc(hidden)]
    pub fn par_iter(self) -> Indexed<impl Fn(usize) -> f32 + Copy + Send + Sync + 'a> {
        let at = move |index| self.at(index);
        (0..self.len()).into_par_iter().map(at)
    }

    /// [`Self::chunks`] on every core.
    #[doc(hidden)]
    pub fn par_chunks(self, size: usize) -> Indexed<impl Fn(usize) -> Self + Copy + Send + Sync + 'a> {
        let chunk = move |number| self.chunk(size, number);
        (0..self.len().div_ceil(size)).into_par_iter().map(chunk)
    }

    fn chunk(self, size: usize, number: usize) -> Self {
        self.slice(number * size..((number + 1) * size).min(self.len()))
    }

    /// Some neighbouring values, from an index on.
    #[doc(hidden)]
    #[inline(always)]
    pub fn run<const N: usize>(self, first: usize) -> [f32; N] {
        for_type!(Self, self, values => numbers(values, first))
    }

    /// The minimum and maximum, if all values are whole numbers. Those beyond `i32` may count as its ends. `-0.0` does not count, because a whole
    /// number would restore `0.0`.
    #[doc(hidden)]
    pub fn whole_range(self) -> Option<[i32; 2]> {
        let ranges = self.par_chunks(CHUNK).map(|chunk| for_type!(Self, chunk, values => whole_range(values)));
        Some(ranges.collect::<Option<Vec<_>>>()?.into_iter().fold(EMPTY, union))
    }
}

/// Equal numbers, whatever their types. NaN equals nothing.
impl PartialEq for ValueSlice<'_> {
    fn eq(&self, other: &Self) -> bool {
        self.len() == other.len() && self.iter().zip(other.iter()).all(|(a, b)| a == b)
    }
}

impl PartialEq<[f32]> for ValueSlice<'_> {
    fn eq(&self, other: &[f32]) -> bool {
        *self == ValueSlice::F32(other)
    }
}

impl PartialEq<&[f32]> for ValueSlice<'_> {
    fn eq(&self, other: &&[f32]) -> bool {
        *self == ValueSlice::F32(other)
    }
}

impl PartialEq<Vec<f32>> for ValueSlice<'_> {
    fn eq(&self, other: &Vec<f32>) -> bool {
        *self == ValueSlice::F32(other)
    }
}

impl<const N: usize> PartialEq<[f32; N]> for ValueSlice<'_> {
    fn eq(&self, other: &[f32; N]) -> bool {
        *self == ValueSlice::F32(other)
    }
}

impl<'a> IntoIterator for ValueSlice<'a> {
    type Item = f32;
    type IntoIter = ValueIter<'a>;

    fn into_iter(self) -> ValueIter<'a> {
        self.iter()
    }
}

impl Iterator for ValueIter<'_> {
    type Item = f32;

    fn next(&mut self) -> Option<f32> {
        for_type!(Numbers, &mut self.0, values => values.next().map(|number| number.to_f32()))
    }

    fn nth(&mut self, count: usize) -> Option<f32> {
        for_type!(Numbers, &mut self.0, values => values.nth(count).map(|number| number.to_f32()))
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        for_type!(Numbers, &self.0, values => values.size_hint())
    }

    /// Looks at the type once for all values, not once for each.
    fn fold<B, F: FnMut(B, f32) -> B>(self, start: B, mut f: F) -> B {
        for_type!(Numbers, self.0, values => values.fold(start, |sum, number| f(sum, number.to_f32())))
    }
}

impl DoubleEndedIterator for ValueIter<'_> {
    fn next_back(&mut self) -> Option<f32> {
        for_type!(Numbers, &mut self.0, values => values.next_back().map(|number| number.to_f32()))
    }
}

impl ExactSizeIterator for ValueIter<'_> {}

/// Some neighbouring numbers, from an index on, as `f32`.
#[inline(always)]
fn numbers<T: Sample, const N: usize>(all: &[T], first: usize) -> [f32; N] {
    let some = &all[first..first + N];
    std::array::from_fn(|at| some[at].to_f32())
}

/// The minimum and maximum of some numbers, if all are whole.
pub(super) fn whole_range<T: Sample>(numbers: &[T]) -> Option<[i32; 2]> {
    let (mut min, mut max, mut are_whole) = (i32::MAX, i32::MIN, true);
    for number in numbers {
        let value = number.to_f32();
        let whole = value as i32;
        are_whole &= (whole as f32).to_bits() == value.to_bits();
        (min, max) = (min.min(whole), max.max(whole));
    }
    are_whole.then_some([min, max])
}

pub(super) fn union([a, b]: [i32; 2], [c, d]: [i32; 2]) -> [i32; 2] {
    [a.min(c), b.max(d)]
}
