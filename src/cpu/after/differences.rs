//! The differences of voxels' neighbours, of which gradients are means where `gradient = "differences"` (SPEC §9).

use glam::UVec3;

use crate::parallel::prelude::*;
use crate::volume::{ValueSlice, Volume};

/// The maximum number of voxels of a volume of which differences are kept, which then take 192 MiB, and values as `f32`, which take 64 MiB.
pub(super) const MAX_VOXELS: u64 = 1 << 24;

/// `2·d` times the spacing, along x, y and z, for all voxels in memory order; d is the estimate of the gradient by differences. NaN beside a hole.
#[derive(Clone, Debug)]
pub(super) struct Differences(Vec<f32>);

impl Differences {
    /// Numbers behind the last voxel's, so that those of four voxels can be read as a vector of sixteen.
    const PADDING: usize = 4;

    /// `None` if the volume is too large.
    pub(super) fn new(volume: &Volume) -> Option<Self> {
        let dims = volume.dims();
        if dims.as_u64vec3().element_product() > MAX_VOXELS {
            return None;
        }
        let (nx, ny) = (dims.x as usize, dims.y as usize);
        let count = 3 * volume.values().len();
        let mut all = vec![0.0; count + Self::PADDING];
        all[..count].par_chunks_mut(3 * nx * ny).zip(0..dims.z).for_each(|(plane, z)| {
            for (row, y) in plane.chunks_mut(3 * nx).zip(0..) {
                let neighbours = Neighbours::of(volume.values(), dims, [1, nx, nx * ny]);
                let first = nx * (y as usize + ny * z as usize);
                for (of_voxel, x) in row.as_chunks_mut().0.iter_mut().zip(0..) {
                    *of_voxel = neighbours.at(first + x as usize, UVec3::new(x, y, z));
                }
            }
        });
        Some(Self(all))
    }

    /// Those of four voxels along x, given the index of the first one, and four numbers more.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn of_four(&self, index: usize) -> &[f32] {
        &self.0[3 * index..3 * index + 16]
    }
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
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn at(&self, index: usize, voxel: UVec3) -> [f32; 3] {
        [self.along(index, voxel, 0), self.along(index, voxel, 1), self.along(index, voxel, 2)]
    }

    /// The difference along an axis.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn along(&self, index: usize, voxel: UVec3, axis: usize) -> f32 {
        let (has_before, has_after) = (voxel[axis] > 0, voxel[axis] + 1 < self.dims[axis]);
        let step = self.steps[axis];
        let low = self.values.at(index - if has_before { step } else { 0 });
        let high = self.values.at(index + if has_after { step } else { 0 });
        (high - low) * if has_before && has_after { 1.0 } else { 2.0 }
    }
}
