//! The numbers that the samples of files become: values, or ids of labels.

use std::collections::TryReserveError;

use super::sample_type::{Sample, SampleType};
use super::values::Values;

/// Voxels in memory, where many together may take fewer bits than each alone.
pub(super) trait Many<T>: Default + Sync + From<Vec<T>> {
    fn count(&self) -> usize;

    /// The voxel at an index.
    fn at(&self, index: usize) -> T;

    /// Makes room for further voxels.
    ///
    /// # Errors
    /// If there is no memory for them.
    fn try_reserve_exact(&mut self, count: usize) -> Result<(), TryReserveError>;

    /// Appends voxels.
    ///
    /// # Errors
    /// If there is no memory for them. Those before may be lost then.
    fn append(&mut self, voxels: &[T]) -> Result<(), TryReserveError>;

    fn shrink_to_fit(&mut self);

    /// Exchanges two runs of `count` voxels, of which the first one ends before the other begins.
    #[cfg(feature = "tiff")]
    fn swap(&mut self, first: usize, other: usize, count: usize);
}

/// Values, in the fewest bits that hold them.
impl Many<f32> for Values {
    fn count(&self) -> usize {
        self.as_slice().len()
    }

    fn at(&self, index: usize) -> f32 {
        self.as_slice().at(index)
    }

    fn try_reserve_exact(&mut self, count: usize) -> Result<(), TryReserveError> {
        self.try_reserve_exact(count)
    }

    fn append(&mut self, voxels: &[f32]) -> Result<(), TryReserveError> {
        self.append(voxels)
    }

    fn shrink_to_fit(&mut self) {
        self.shrink_to_fit();
    }

    #[cfg(feature = "tiff")]
    fn swap(&mut self, first: usize, other: usize, count: usize) {
        self.swap(first, other, count);
    }
}

/// A number that samples are converted to: a value or the id of a label.
pub(super) trait Voxel: Copy + Send + Sync {
    /// Many of them.
    type Many: Many<Self>;

    const ALLOWED: &'static str;

    /// A voxel without a sample in the file.
    const HOLE: Self;

    /// Whether every sample is allowed.
    const HOLDS_ALL: bool;

    /// The voxel for a sample; `None` if the sample is not allowed.
    fn of(sample: impl Sample) -> Option<Self>;

    /// The voxel between this one and another, at the fraction `part` of the way.
    fn between(self, other: Self, part: f64) -> Self;

    /// The greatest number of bytes that the voxel of a sample takes among others.
    fn bytes(kind: SampleType, is_rescaled: bool) -> u64;
}

/// A value; one that is not finite makes a hole in the volume.
impl Voxel for f32 {
    type Many = Values;

    const ALLOWED: &'static str = "numbers";
    const HOLE: Self = Self::NAN;
    const HOLDS_ALL: bool = true;

    fn of(sample: impl Sample) -> Option<Self> {
        Some(sample.to_f32())
    }

    fn between(self, other: Self, part: f64) -> Self {
        (f64::from(self) * (1.0 - part) + f64::from(other) * part) as Self
    }

    fn bytes(kind: SampleType, is_rescaled: bool) -> u64 {
        let whole = size_of::<Self>() as u64;
        if is_rescaled || cfg!(target_arch = "wasm32") { whole } else { kind.bytes().min(whole) }
    }
}
