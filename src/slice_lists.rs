//! Every volume slice's voxels sorted by value: how iso-voxels are found for axis-aligned sheets in \[8\] (§7). Here it is an
//! alternative to [`ValueList`](crate::value_list::ValueList) for programs that work slice by slice: the renderer itself finds
//! who takes part once for all axes.

use std::ops::Range;

use glam::UVec3;
use rayon::prelude::*;

use crate::iso_range::{ValueSet, ordinal};
use crate::volume::Grid;

/// The lists of the slices across one axis.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SliceLists {
    slices: Vec<Vec<u32>>,
}

impl SliceLists {
    /// Sorts a volume's voxels, slice by slice across the axis 0, 1 or 2.
    pub fn new(values: &[f32], grid: &Grid, axis: usize) -> Self {
        let [across, up] = [(axis + 1) % 3, (axis + 2) % 3];
        let slice = |at: u32| {
            let voxels = (0..grid.dims[up]).flat_map(|y| (0..grid.dims[across]).map(move |x| (x, y)));
            let mut keyed: Vec<u64> = voxels
                .map(|(x, y)| {
                    let mut voxel = UVec3::ZERO;
                    (voxel[axis], voxel[across], voxel[up]) = (at, x, y);
                    let index = grid.index_of(voxel);
                    u64::from(ordinal(values[index as usize])) << 32 | u64::from(index)
                })
                .collect();
            keyed.sort_unstable();
            keyed.into_iter().map(|key| key as u32).collect()
        };
        Self { slices: (0..grid.dims[axis]).into_par_iter().map(slice).collect() }
    }

    /// The voxels of one slice whose values are in a set, range by range: two binary searches each.
    pub fn within<'a>(
        &'a self,
        values: &'a [f32],
        slice: usize,
        set: &'a ValueSet,
    ) -> impl Iterator<Item = &'a [u32]> + 'a {
        let sorted = &self.slices[slice];
        let start = |bound: u32| sorted.partition_point(|&voxel| ordinal(values[voxel as usize]) < bound);
        set.ranges().iter().map(move |&Range { start: first, end }| &sorted[start(first)..start(end)])
    }

    /// Number of slices.
    pub fn len(&self) -> usize {
        self.slices.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.slices.is_empty()
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;
    use crate::scene::TransferSettings;
    use crate::value_list::ValueList;
    use crate::volume::builtin;

    #[test]
    fn slices_together_hold_what_the_volume_list_holds() {
        let volume = builtin::volume("tomato:24").unwrap();
        let transfer = TransferSettings::default().resolve(&volume);
        let transfer = crate::transfer_function::TransferFunction { iso_ranges: Some(vec![[30.0, 90.0]]), ..transfer };
        let (values, set) = (volume.values(), ValueSet::of(&transfer));
        let mut expected = ValueList::new(values).within(values, &set);
        expected.sort_unstable();
        assert!(expected.len() > 100 && expected.len() < values.len() / 2, "{}", expected.len());
        for axis in 0..3 {
            let lists = SliceLists::new(values, volume.grid(), axis);
            assert_eq!(lists.len(), volume.grid().dims[axis] as usize);
            let mut found = Vec::new();
            for slice in 0..lists.len() {
                for voxels in lists.within(values, slice, &set) {
                    assert!(voxels.is_sorted_by_key(|&voxel| ordinal(values[voxel as usize])));
                    assert!(voxels.iter().all(|&voxel| volume.grid().voxel_at(voxel)[axis] as usize == slice));
                    found.extend_from_slice(voxels);
                }
            }
            found.sort_unstable();
            assert_eq!(found, expected, "axis {axis}");
        }
    }
}
