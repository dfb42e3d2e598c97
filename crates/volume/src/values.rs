//! The values of a volume in memory: in the fewest bits that hold every one of them.

use std::collections::TryReserveError;

use super::sample_type::Sample;
use super::value_slice::{CHUNK, ValueSlice, union, whole_range};
use crate::for_type;
use crate::parallel::prelude::*;

/// The pieces in which values change their type.
const PIECES: usize = 16;

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

/// A type in which values are kept.
trait Kept: Sample + Default + Send + Sync {
    const FORM: Form;

    /// The number that equals a value, if there is one.
    fn of(value: f32) -> Self;
}

macro_rules! kept {
    ($($variant:ident: $type:ty),*) => {
        $(
            impl Kept for $type {
                const FORM: Form = Form::$variant;

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

#[cfg(target_arch = "wasm32")]
impl From<Vec<u16>> for Values {
    fn from(labels: Vec<u16>) -> Self {
        Self::F32(labels.into_iter().map(f32::from).collect())
    }
}

impl Values {
    /// All values.
    pub fn as_slice(&self) -> ValueSlice<'_> {
        for_type!(Self, self, values => values.into())
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
        fn of<T: Kept>(_: &[T]) -> Form {
            T::FORM
        }
        for_type!(Self, self, values => of(values))
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
