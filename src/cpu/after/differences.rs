//! The differences of voxels' neighbours, of which gradients are means where `gradient = "differences"` (SPEC §9).

use glam::UVec3;

use crate::parallel::prelude::*;
use crate::volume::{ValueSlice, Volume};

/// The maximum number of voxels of a volume of which differences are kept, which then take 192 MiB at the most, and values as `f32`, which take 64 MiB.
pub(super) const MAX_VOXELS: u64 = 1 << 24;

/// `2·d` times the spacing, along x, y and z, for all voxels in memory order; d is the estimate of the gradient by differences. Where all values of a volume
/// are whole numbers, so are these, and if they fit in 16 bits they take half the memory.
#[derive(Clone, Debug)]
pub(super) enum Differences {
    /// Differences that are whole numbers. Web pages are compiled without this variant, because they keep all values as `f32`.
    #[cfg(not(target_arch = "wasm32"))]
    Small(Vec<i16>),
    /// NaN beside a hole.
    Any(Vec<f32>),
}

impl Differences {
    /// Numbers behind the last voxel's, so that those of four voxels can be read as a vector of sixteen.
    const PADDING: usize = 4;

    /// `None` if the volume is too large.
    pub(super) fn new(volume: &Volume) -> Option<Self> {
        if volume.dims().as_u64vec3().element_product() > MAX_VOXELS {
            return None;
        }
        #[cfg(not(target_arch = "wasm32"))]
        if are_small(volume.values()) {
            // A cast, which keeps whole numbers in this range.
            return Some(Self::Small(differences(volume, |difference| difference as i16)));
        }
        Some(Self::Any(differences(volume, |difference| difference)))
    }

    /// One of them.
    pub(super) fn at(&self, index: usize) -> f32 {
        match self {
            #[cfg(not(target_arch = "wasm32"))]
            Self::Small(all) => all[index].into(),
            Self::Any(all) => all[index],
        }
    }
}

/// Whether differences of any two values, twice, are whole numbers that fit in 16 bits.
#[cfg(not(target_arch = "wasm32"))]
fn are_small(values: ValueSlice<'_>) -> bool {
    if matches!(values, ValueSlice::F32(_)) {
        return false;
    }
    let (least, greatest) = values.iter().fold((f32::MAX, f32::MIN), |(a, b), value| (a.min(value), b.max(value)));
    2.0 * (greatest - least) <= f32::from(i16::MAX)
}

/// The differences of all voxels, each made a `T` by `of`, and [`Differences::PADDING`] zeros.
fn differences<T: Copy + Default + Send>(volume: &Volume, of: impl Fn(f32) -> T + Sync) -> Vec<T> {
    let dims = volume.dims();
    let (nx, ny) = (dims.x as usize, dims.y as usize);
    let count = 3 * volume.values().len();
    let mut all = vec![T::default(); count + Differences::PADDING];
    all[..count].par_chunks_mut(3 * nx * ny).zip(0..dims.z).for_each(|(plane, z)| {
        for (row, y) in plane.chunks_mut(3 * nx).zip(0..) {
            let neighbours = Neighbours::of(volume.values(), dims, [1, nx, nx * ny]);
            let first = nx * (y as usize + ny * z as usize);
            for (of_voxel, x) in row.as_chunks_mut().0.iter_mut().zip(0..) {
                *of_voxel = neighbours.at(first + x as usize, UVec3::new(x, y, z)).map(&of);
            }
        }
    });
    all
}

/// A volume's values, its voxels along each axis, and the steps in memory along each.
#[derive(Clone, Copy, Debug)]
pub(super) struct Neighbours<'a> {
    values: ValueSlice<'a>,
    dims: UVec3,
    steps: [usize; 3],
}

impl<'a> Neighbours<'a> {
    pub(super) fn of(values: ValueSlice<'a>, dims: UVec3, steps: [usize; 3]) -> Self {
        Self { values, dims, steps }
    }

    /// The differences at a voxel, given its index too. At a border they are one-sided.
    #[inline(always)]
    pub(super) fn at(&self, index: usize, voxel: UVec3) -> [f32; 3] {
        [self.along(index, voxel, 0), self.along(index, voxel, 1), self.along(index, voxel, 2)]
    }

    /// The difference along an axis.
    #[inline(always)]
    fn along(&self, index: usize, voxel: UVec3, axis: usize) -> f32 {
        let (has_before, has_after) = (voxel[axis] > 0, voxel[axis] + 1 < self.dims[axis]);
        let step = self.steps[axis];
        let low = self.values.at(index - if has_before { step } else { 0 });
        let high = self.values.at(index + if has_after { step } else { 0 });
        (high - low) * if has_before && has_after { 1.0 } else { 2.0 }
    }
}
