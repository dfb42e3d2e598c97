//! The errors of samples that become values, which are `f32`: whole numbers beyond 24 bits are rounded.

use std::path::Path;

use super::range::range_of;
use super::sample_type::{Sample, SampleType};
use super::value_slice::ValueSlice;

/// The magnitude up to which every whole number is an `f32`, and that up to which every one is an `f64`.
const EXACT: f32 = (1 << 24) as f32;
const EXACT_F64: f64 = (1_u64 << 53) as f64;

/// Errors of fractions below this part of the range of all values are those that any `f32` has.
const NOTICEABLE: f64 = 1.0 / 65536.0;

/// The largest errors of the values of some samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Rounding {
    /// The largest error of whole numbers.
    whole: f64,
    /// The largest error of any numbers of 64 bits; infinite if one lies beyond what `f32` holds.
    any: f64,
}

impl Rounding {
    /// The errors of the values of some samples.
    pub(super) fn of<S: Sample>(samples: impl Iterator<Item = S>) -> Self {
        let error = |sample: S| {
            let (exact, value) = (sample.to_f64(), sample.to_f32());
            // NaN and infinity become holes, which have no error.
            let any = if exact.is_finite() { (exact - f64::from(value)).abs() } else { 0.0 };
            // Beyond its exact whole numbers, no fraction is left for an `f64` to tell whole numbers by.
            let may_be_id = S::IS_WHOLE || exact.abs() <= EXACT_F64;
            let whole = if value.abs() >= EXACT && may_be_id { sample.error_if_whole() } else { 0.0 };
            Self { whole, any }
        };
        samples.map(error).fold(Self::default(), Self::max)
    }

    /// The larger errors of two.
    pub(super) fn max(self, other: Self) -> Self {
        Self { whole: self.whole.max(other.whole), any: self.any.max(other.any) }
    }

    /// Whether whole numbers were rounded.
    pub(super) fn is_of_whole_numbers(self) -> bool {
        self.whole > 0.0
    }

    /// Warns of whole numbers that were rounded, and of values that are noticeably others.
    pub(super) fn warn(self, path: &Path, kind: SampleType, values: ValueSlice<'_>) {
        let path = path.display();
        if self.any == f64::INFINITY {
            log::warn!("{path}: {kind} samples beyond {:e} become holes: values are float32", f32::MAX);
        } else if self.is_of_whole_numbers() {
            let error = self.whole;
            log::warn!("{path}: {kind} samples beyond 16777216 are rounded to float32, by up to {error}");
        } else if self.any > 0.0 {
            let [min, max] = range_of(values.iter().filter(|value| value.is_finite())).unwrap_or_default();
            if max > min && self.any > NOTICEABLE * (f64::from(max) - f64::from(min)) {
                log::warn!("{path}: {kind} samples are rounded to float32, by up to {:.1e}", self.any);
            }
        }
    }
}
