//! Samples: the numbers in a file, which become values or labels while they are read.

use std::collections::TryReserveError;
use std::fmt::Display;
use std::path::Path;

use glam::{DVec3, UVec3, Vec3Swizzles};

use super::error::volume::{VolumeError, invalid};
use super::grid::Grid;
use super::rounding::Rounding;
use super::sample_type::{Sample, SampleType, for_sample_type};
use super::voxel::{Many, Voxel};
use super::voxels::Voxels;

/// The voxels that are converted at a time.
const BLOCK: usize = 1 << 14;

/// A header's description of the samples, one per voxel of the grid.
#[derive(Clone, Copy, Debug)]
pub(super) struct Samples {
    pub(super) kind: SampleType,
    pub(super) dims: UVec3,
    pub(super) big_endian: bool,
    /// Slope and intercept: the value is `sample · slope + intercept`.
    pub(super) rescale: Option<[f64; 2]>,
    /// Whether z is fastest in the file, then y, then x, instead of x, y, z.
    pub(super) z_fastest: bool,
}

impl Samples {
    /// The size of the samples in bytes, decompressed.
    pub(super) fn bytes(&self) -> u64 {
        u64::from(self.count()) * self.kind.bytes()
    }

    /// The number of samples. Readers have checked by [`dims_of`](super::grid::dims_of) that it fits in 32 bits.
    pub(super) fn count(&self) -> u32 {
        self.dims.element_product()
    }

    /// The voxel of the sample at an index in the file.
    fn voxel_at(&self, index: usize) -> UVec3 {
        let in_file = |dims| Grid::new(dims, DVec3::ONE).voxel_at(index as u32);
        if self.z_fastest { in_file(self.dims.zyx()).zyx() } else { in_file(self.dims) }
    }

    /// The file's samples reordered so that x is fastest.
    pub(super) fn in_order(&self, path: &Path, samples: Voxels) -> Result<Voxels, VolumeError> {
        if !self.z_fastest {
            return Ok(samples);
        }
        let [nx, ny, nz] = self.dims.to_array().map(|n| n as usize);
        let rows = (0..nz).flat_map(|z| (0..ny).map(move |y| z + nz * y));
        let indices = rows.flat_map(|first| (0..nx).map(move |x| first + nz * ny * x));
        let mut sorted = samples.none_alike();
        sorted.try_reserve_exact(samples.count()).map_err(self.too_many(path))?;
        sorted.append_from(&samples, indices).map_err(self.too_many(path))?;
        Ok(sorted)
    }

    /// Converts all of `bytes` and appends the voxels to `into`, which holds those before. Returns what they lose.
    pub(super) fn append(&self, path: &Path, bytes: &[u8], into: &mut Voxels) -> Result<Rounding, VolumeError> {
        match into {
            Voxels::Values(values) => self.append_to::<f32>(path, bytes, values),
            Voxels::Ids(ids) => self.append_to::<u64>(path, bytes, ids),
        }
    }

    fn append_to<T: Voxel>(&self, path: &Path, bytes: &[u8], into: &mut T::Many) -> Result<Rounding, VolumeError> {
        let mut rounding = Rounding::default();
        let mut voxels = Vec::new();
        for bytes in bytes.chunks(BLOCK * self.kind.bytes() as usize) {
            voxels.clear();
            rounding = rounding.max(self.convert::<T>(path, bytes, &mut voxels, into.count())?);
            into.append(&voxels).map_err(self.too_many(path))?;
        }
        Ok(rounding)
    }

    /// Converts all of `bytes` and appends the voxels to `into`, in front of which there are some others. Returns what they lose.
    pub(super) fn convert<T: Voxel>(
        &self,
        path: &Path,
        bytes: &[u8],
        into: &mut Vec<T>,
        before: usize,
    ) -> Result<Rounding, VolumeError> {
        into.try_reserve(bytes.len() / self.kind.bytes() as usize).map_err(self.too_many(path))?;
        self.kind.convert(self, bytes, into).map_err(|sample| {
            let voxel = self.voxel_at(before + into.len());
            invalid(path, "data", format!("{sample} at voxel {voxel}"), T::ALLOWED)
        })
    }

    pub(super) fn too_many(&self, path: &Path) -> impl Fn(TryReserveError) -> VolumeError {
        move |error| invalid(path, "data", format!("{} samples: {error}", self.count()), "fewer")
    }

    pub(super) fn mismatch(&self, path: &Path, held: impl Display) -> VolumeError {
        let allowed = format!("{} bytes ({} samples of {})", self.bytes(), self.count(), self.kind.bytes());
        invalid(path, "data", format!("{held} bytes"), allowed)
    }
}

impl SampleType {
    /// Appends the samples in `bytes`, a whole number of them, and returns what they lose. Stops at a sample that is not allowed and returns it as the
    /// error.
    pub(super) fn convert<T: Voxel>(self, layout: &Samples, bytes: &[u8], into: &mut Vec<T>) -> Result<Rounding, f64> {
        let mut swapped = Vec::new();
        let mut bytes = bytes;
        if layout.big_endian {
            swapped.extend_from_slice(bytes);
            swapped.chunks_exact_mut(self.bytes() as usize).for_each(<[u8]>::reverse);
            bytes = &swapped;
        }
        for_sample_type!(self, Number => {
            let samples = bytes.as_chunks().0.iter().map(|&sample| Number::from_le_bytes(sample));
            match layout.rescale {
                None => append(samples, into),
                Some([slope, intercept]) => {
                    append(samples.map(|sample| sample.to_f64() * slope + intercept), into)
                }
            }
        })
    }
}

fn append<S: Sample, T: Voxel>(samples: impl Iterator<Item = S> + Clone, into: &mut Vec<T>) -> Result<Rounding, f64> {
    if T::HOLDS_ALL {
        // Without a test of each, several are converted at a time.
        into.extend(samples.clone().map(|sample| T::of(sample).unwrap_or(T::HOLE)));
        return Ok(if S::MAY_ROUND { Rounding::of(samples) } else { Rounding::default() });
    }
    for sample in samples {
        into.push(T::of(sample).ok_or_else(|| sample.to_f64())?);
    }
    Ok(Rounding::default())
}
