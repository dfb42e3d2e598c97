//! The values of a volume in memory: in the fewest bits that hold every one of them.

use std::collections::TryReserveError;
use std::ops::RangeBounds;
use std::slice::Iter;

use super::samples::Sample;
use crate::parallel::Indexed;
use crate::parallel::prelude::*;

/// The values that one thread looks at at a time.
const CHUNK: usize = 1 << 16;

/// The pieces in which values change their type.
const PIECES: usize = 16;

/// The range of no whole number.
const EMPTY: [i32; 2] = [i32::MAX, i32::MIN];

/// The values of a volume, x fastest, in memory of their own: whole numbers of 8 or 16 bits, or `f32`, whose NaN is a hole.
///
/// A volume keeps them in the fewest bits that hold every one of them, whatever type they are given in, and everything that is drawn or told of them is what
/// `f32` would give. In WebAssembly, where code must be short, they are always `f32`.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Values {
    /// Whole numbers from 0 to 255.
    #[cfg(not(target_arch = "wasm32"))]
    U8(Vec<u8>),
    /// Whole numbers from -128 to 127.
    #[cfg(not(target_arch = "wasm32"))]
    I8(Vec<i8>),
    /// Whole numbers from 0 to 65535.
    #[cfg(not(target_arch = "wasm32"))]
    U16(Vec<u16>),
    /// Whole numbers from -32768 to 32767.
    #[cfg(not(target_arch = "wasm32"))]
    I16(Vec<i16>),
    /// Any numbers.
    F32(Vec<f32>),
}

/// A part of a volume's [`Values`], or any other slice of numbers of their types. Each number is told as the `f32` that equals it.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
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
pub(crate) use for_type;

/// A type in which values are kept.
trait Kept: Sample + Default + Send + Sync {
    /// The number that equals a value, if there is one.
    fn of(value: f32) -> Self;
}

macro_rules! kept {
    ($($variant:ident: $type:ty),*) => {
        $(
            impl Kept for $type {
                fn of(value: f32) -> Self {
                    value as Self
                }
            }

            impl From<Vec<$type>> for Values {
                fn from(values: Vec<$type>) -> Self {
                    Self::$variant(values)
                }
            }

            impl<'a> From<&'a [$type]> for ValueSlice<'a> {
                fn from(values: &'a [$type]) -> Self {
                    Self::$variant(values)
                }
            }

            impl<'a> From<&'a Vec<$type>> for ValueSlice<'a> {
                fn from(values: &'a Vec<$type>) -> Self {
                    Self::$variant(values)
                }
            }
        )*
    };
}
#[cfg(not(target_arch = "wasm32"))]
kept!(U8: u8, I8: i8, U16: u16, I16: i16);
kept!(F32: f32);

/// A type of [`Values`].
#[derive(Clone, Copy, Debug, PartialEq)]
enum Form {
    #[cfg(not(target_arch = "wasm32"))]
    U8,
    #[cfg(not(target_arch = "wasm32"))]
    I8,
    #[cfg(not(target_arch = "wasm32"))]
    U16,
    #[cfg(not(target_arch = "wasm32"))]
    I16,
    F32,
}

impl Form {
    /// The forms of whole numbers, those of fewer bits first, and the numbers that each holds.
    const WHOLE: &[(Self, [i32; 2])] = &[
        #[cfg(not(target_arch = "wasm32"))]
        (Self::U8, [u8::MIN as i32, u8::MAX as i32]),
        #[cfg(not(target_arch = "wasm32"))]
        (Self::I8, [i8::MIN as i32, i8::MAX as i32]),
        #[cfg(not(target_arch = "wasm32"))]
        (Self::U16, [u16::MIN as i32, u16::MAX as i32]),
        #[cfg(not(target_arch = "wasm32"))]
        (Self::I16, [i16::MIN as i32, i16::MAX as i32]),
    ];

    /// The form of the fewest bits that holds the whole numbers of a range; `F32` if none does, or not all numbers are whole.
    fn of(range: Option<[i32; 2]>) -> Self {
        let holds = |[low, high]: [i32; 2]| range.is_some_and(|[min, max]| low <= min && max <= high);
        Self::WHOLE.iter().find(|(_, range)| holds(*range)).map_or(Self::F32, |(form, _)| *form)
    }

    /// The numbers that the form holds; `None` if it holds any.
    fn range(self) -> Option<[i32; 2]> {
        Self::WHOLE.iter().find(|(form, _)| *form == self).map(|(_, range)| *range)
    }

    fn bytes(self) -> usize {
        match self {
            #[cfg(not(target_arch = "wasm32"))]
            Self::U8 | Self::I8 => 1,
            #[cfg(not(target_arch = "wasm32"))]
            Self::U16 | Self::I16 => 2,
            Self::F32 => 4,
        }
    }

    /// The form of the fewest bits that holds what two forms hold.
    fn union(self, other: Self) -> Self {
        Self::of(self.range().zip(other.range()).map(|(a, b)| union(a, b)))
    }
}

/// No values.
#[cfg(not(target_arch = "wasm32"))]
impl Default for Values {
    fn default() -> Self {
        Self::U8(Vec::new())
    }
}

/// No values.
#[cfg(target_arch = "wasm32")]
impl Default for Values {
    fn default() -> Self {
        Self::F32(Vec::new())
    }
}

impl Values {
    /// All values.
    pub fn as_slice(&self) -> ValueSlice<'_> {
        match self {
            #[cfg(not(target_arch = "wasm32"))]
            Self::U8(values) => ValueSlice::U8(values),
            #[cfg(not(target_arch = "wasm32"))]
            Self::I8(values) => ValueSlice::I8(values),
            #[cfg(not(target_arch = "wasm32"))]
            Self::U16(values) => ValueSlice::U16(values),
            #[cfg(not(target_arch = "wasm32"))]
            Self::I16(values) => ValueSlice::I16(values),
            Self::F32(values) => ValueSlice::F32(values),
        }
    }

    /// The same values in the type of the fewest bits that holds every one of them. Examines them all, unless they have 8 bits.
    pub fn narrowed(self) -> Self {
        let own = self.form();
        if own.bytes() == 1 {
            return self;
        }
        let form = Form::of(self.as_slice().whole_range());
        if form.bytes() < own.bytes() { self.converted(form) } else { self }
    }

    fn form(&self) -> Form {
        match self {
            #[cfg(not(target_arch = "wasm32"))]
            Self::U8(_) => Form::U8,
            #[cfg(not(target_arch = "wasm32"))]
            Self::I8(_) => Form::I8,
            #[cfg(not(target_arch = "wasm32"))]
            Self::U16(_) => Form::U16,
            #[cfg(not(target_arch = "wasm32"))]
            Self::I16(_) => Form::I16,
            Self::F32(_) => Form::F32,
        }
    }

    /// The same values in another form, which holds them.
    fn converted(self, form: Form) -> Self {
        for_type!(Self, self, values => match form {
            #[cfg(not(target_arch = "wasm32"))]
            Form::U8 => Self::U8(converted(values)),
            #[cfg(not(target_arch = "wasm32"))]
            Form::I8 => Self::I8(converted(values)),
            #[cfg(not(target_arch = "wasm32"))]
            Form::U16 => Self::U16(converted(values)),
            #[cfg(not(target_arch = "wasm32"))]
            Form::I16 => Self::I16(converted(values)),
            Form::F32 => Self::F32(converted(values)),
        })
    }

    /// Appends values, all in the form of the fewest bits that has held both those before and these.
    ///
    /// # Errors
    /// If there is no memory for them. Those before may be lost then.
    pub(super) fn append(&mut self, values: &[f32]) -> Result<(), TryReserveError> {
        let form = Form::of(whole_range(values));
        let (own, room) = (self.form(), for_type!(Self, &*self, own => own.capacity()));
        let form = if self.as_slice().is_empty() { form } else { own.union(form) };
        if form != own {
            *self = std::mem::take(self).converted(form);
            self.try_reserve_exact(room - self.as_slice().len())?;
        }
        for_type!(Self, self, all => push(all, values))
    }

    /// Makes room for further values of the type of those before.
    ///
    /// # Errors
    /// If there is no memory for them.
    pub(super) fn try_reserve_exact(&mut self, count: usize) -> Result<(), TryReserveError> {
        for_type!(Self, self, values => values.try_reserve_exact(count))
    }

    pub(super) fn shrink_to_fit(&mut self) {
        for_type!(Self, self, values => values.shrink_to_fit());
    }

    /// Takes the values from an index on away.
    pub(super) fn split_off(&mut self, at: usize) -> Self {
        for_type!(Self, self, values => values.split_off(at).into())
    }

    /// Exchanges two runs of `count` values, of which the first one ends before the other begins.
    #[cfg(feature = "tiff")]
    pub(super) fn swap(&mut self, first: usize, other: usize, count: usize) {
        for_type!(Self, self, values => swap(values, first, other, count));
    }

    /// Makes every value that is not finite NaN, and returns the number of these.
    pub(super) fn punch_holes(&mut self) -> u64 {
        let punch = |value: &mut f32| {
            let is_hole = !value.is_finite();
            if is_hole {
                *value = f32::NAN;
            }
            u64::from(is_hole)
        };
        match self {
            Self::F32(values) => values.par_iter_mut().map(punch).sum(),
            // Whole numbers are finite.
            #[cfg(not(target_arch = "wasm32"))]
            _ => 0,
        }
    }
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
    /// If there is none.
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
    pub(crate) fn par_iter(self) -> Indexed<impl Fn(usize) -> f32 + Copy + Send + Sync + 'a> {
        let at = move |index| self.at(index);
        (0..self.len()).into_par_iter().map(at)
    }

    /// [`Self::chunks`] on every core.
    pub(crate) fn par_chunks(self, size: usize) -> Indexed<impl Fn(usize) -> Self + Copy + Send + Sync + 'a> {
        let chunk = move |number| self.chunk(size, number);
        (0..self.len().div_ceil(size)).into_par_iter().map(chunk)
    }

    fn chunk(self, size: usize, number: usize) -> Self {
        self.slice(number * size..((number + 1) * size).min(self.len()))
    }

    /// Some neighbouring values, from an index on.
    #[cfg(any(feature = "cpu", feature = "codecs", feature = "nifti"))]
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(crate) fn run<const N: usize>(self, first: usize) -> [f32; N] {
        for_type!(Self, self, values => numbers(values, first))
    }

    /// The minimum and maximum, if all values are whole numbers. Those beyond `i32` may count as its ends. `-0.0` does not count, because a whole
    /// number would restore `0.0`.
    pub(crate) fn whole_range(self) -> Option<[i32; 2]> {
        let ranges = self.par_chunks(CHUNK).map(|chunk| for_type!(Self, chunk, values => whole_range(values)));
        ranges.try_reduce(|| EMPTY, |a, b| Some(union(a, b)))
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
#[cfg(any(feature = "cpu", feature = "codecs", feature = "nifti"))]
#[cfg_attr(not(debug_assertions), inline(always))]
fn numbers<T: Sample, const N: usize>(all: &[T], first: usize) -> [f32; N] {
    let some = &all[first..first + N];
    std::array::from_fn(|at| some[at].to_f32())
}

/// The minimum and maximum of some numbers, if all are whole.
fn whole_range<T: Sample>(numbers: &[T]) -> Option<[i32; 2]> {
    let (mut min, mut max, mut are_whole) = (i32::MAX, i32::MIN, true);
    for number in numbers {
        let value = number.to_f32();
        let whole = value as i32;
        are_whole &= (whole as f32).to_bits() == value.to_bits();
        (min, max) = (min.min(whole), max.max(whole));
    }
    are_whole.then_some([min, max])
}

fn union([a, b]: [i32; 2], [c, d]: [i32; 2]) -> [i32; 2] {
    [a.min(c), b.max(d)]
}

/// The same numbers in another type, which holds them. What has been converted is given back piece by piece, from the end on, and memory that is zero takes
/// no room before it is written to, so that there is never a second copy of them all.
fn converted<A: Kept, B: Kept>(mut from: Vec<A>) -> Vec<B> {
    let mut to = vec![B::default(); from.len()];
    let piece = from.len().div_ceil(PIECES).max(CHUNK);
    while let Some(last) = from.len().checked_sub(1) {
        let first = last / piece * piece;
        let pairs = to[first..].par_iter_mut().zip(&from[first..]);
        pairs.with_min_len(CHUNK).for_each(|(to, from)| *to = B::of(from.to_f32()));
        from.truncate(first);
        from.shrink_to_fit();
    }
    to
}

fn push<T: Kept>(all: &mut Vec<T>, values: &[f32]) -> Result<(), TryReserveError> {
    all.try_reserve(values.len())?;
    all.extend(values.iter().map(|&value| T::of(value)));
    Ok(())
}

/// Exchanges two runs of a slice, of which the first one ends before the other begins.
#[cfg(feature = "tiff")]
pub(super) fn swap<T>(values: &mut [T], first: usize, other: usize, count: usize) {
    let (before, after) = values.split_at_mut(other);
    before[first..][..count].swap_with_slice(&mut after[..count]);
}
