//! Sorted voxels for every slice of a volume: the way to find iso-voxels for axis-aligned sheets in \[8\] (§7). The renderer itself uses
//! one list of the whole volume for every direction; this bench compares the two.

use std::ops::Range;

use glam::UVec3;
use rayon::prelude::*;

use sheetsplat::internals::iso_range::{ValueSet, ordinal};
use sheetsplat::volume::{Grid, ValueSlice};

/// The lists of the slices across one axis.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct SliceLists {
    slices: Vec<Vec<u32>>,
}

impl SliceLists {
    /// Sorts a volume's voxels, slice by slice across the axis 0, 1 or 2.
    pub(crate) fn new(values: ValueSlice<'_>, grid: &Grid, axis: usize) -> Self {
        let [across, up] = [(axis + 1) % 3, (axis + 2) % 3];
        let slice = |at: u32| {
            let voxels = (0..grid.dims[up]).flat_map(|y| (0..grid.dims[across]).map(move |x| (x, y)));
            let mut keyed: Vec<u64> = voxels
                .map(|(x, y)| {
                    let mut voxel = UVec3::ZERO;
                    (voxel[axis], voxel[across], voxel[up]) = (at, x, y);
                    let index = grid.index_of(voxel);
                    u64::from(ordinal(values.at(index as usize))) << 32 | u64::from(index)
                })
                .collect();
            keyed.sort_unstable();
            keyed.into_iter().map(|key| key as u32).collect()
        };
        Self { slices: (0..grid.dims[axis]).into_par_iter().map(slice).collect() }
    }

    /// The voxels of one slice whose values are in a set, range by range: two binary searches each.
    pub(crate) fn within<'a>(
        &'a self,
        values: ValueSlice<'a>,
        slice: usize,
        set: &'a ValueSet,
    ) -> impl Iterator<Item = &'a [u32]> + 'a {
        let sorted = &self.slices[slice];
        let start = move |bound: u32| sorted.partition_point(|&voxel| ordinal(values.at(voxel as usize)) < bound);
        set.ranges().iter().map(move |&Range { start: first, end }| &sorted[start(first)..start(end)])
    }

    /// The number of slices.
    pub(crate) fn len(&self) -> usize {
        self.slices.len()
    }
}
