//! Table 1's list of relevant voxels, sorted once by value, so that one or two binary searches find any iso-range (§5.1).

use std::ops::Range;

use crate::lists::iso_range::{ValueSet, ordinal};
use crate::parallel::prelude::*;
use crate::volume::ValueSlice;

/// The relevant voxels of a volume, which exclude holes and voxels of the minimum value, sorted by value and then by index.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ValueList {
    least: u32,
    voxels: Vec<u32>,
}

impl ValueList {
    /// Sorts a volume's voxels.
    pub fn new(values: ValueSlice<'_>) -> Self {
        let finite = || values.par_iter().enumerate().filter(|(_, value)| !value.is_nan());
        let least = finite().map(|(_, value)| ordinal(value)).min().unwrap_or(0);
        let mut keyed: Vec<u64> = finite()
            .filter(|&(_, value)| ordinal(value) != least)
            .map(|(index, value)| u64::from(ordinal(value)) << 32 | index as u64)
            .collect();
        keyed.par_sort_unstable();
        Self { least, voxels: keyed.par_iter().map(|&key| key as u32).numbers() }
    }

    /// The voxels whose values are in a set, range by range. Voxels of the minimum value are searched for in the volume.
    pub fn within(&self, values: ValueSlice<'_>, set: &ValueSet) -> Vec<u32> {
        let mut found = Vec::new();
        for range in set.ranges() {
            if range.contains(&self.least) {
                let indices = (0..).zip(values);
                found.extend(indices.filter(|&(_, value)| ordinal(value) == self.least).map(|(index, _)| index));
            }
            found.extend_from_slice(self.relevant(values, range));
        }
        found
    }

    /// The relevant voxels of one range of ordinals, by binary search.
    pub fn relevant(&self, values: ValueSlice<'_>, range: &Range<u32>) -> &[u32] {
        let start = |bound: u32| self.voxels.partition_point(|&voxel| ordinal(values.at(voxel as usize)) < bound);
        &self.voxels[start(range.start)..start(range.end)]
    }

    /// The size of the list in bytes.
    pub fn bytes(&self) -> u64 {
        (self.voxels.len() * size_of::<u32>()) as u64
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use std::collections::BTreeMap;

    use glam::DVec3;

    use super::*;
    use crate::settings::transfer_function::{Ramp, TransferFunction};

    #[test]
    fn finds_what_a_scan_finds() {
        let mut values: Vec<f32> = (0..500_u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as f32 - 100.0).collect();
        values.iter_mut().step_by(7).for_each(|value| *value = f32::NAN);
        let list = ValueList::new((&values).into());
        for iso_range in [[-100.0, -90.0], [-1.0, 0.0], [20.5, 77.0], [155.0, 155.0], [-1e9, 1e9], [200.0, 300.0]] {
            let set = ValueSet::of(&TransferFunction {
                color: Ramp::new(vec![(0.0, DVec3::ONE)]).unwrap(),
                opacity: Ramp::new(vec![(0.0, 1.0)]).unwrap(),
                gradient_opacity: None,
                membership: false,
                iso_ranges: Some(vec![iso_range]),
                labels: BTreeMap::new(),
            });
            let mut found = list.within((&values).into(), &set);
            assert!(found.is_sorted_by_key(|&voxel| values[voxel as usize]));
            found.sort_unstable();
            let inside = |value: f32| (iso_range[0]..=iso_range[1]).contains(&f64::from(value));
            let expected: Vec<u32> = (0..500).filter(|&voxel| inside(values[voxel as usize])).collect();
            assert_eq!(found, expected, "{iso_range:?}");
        }
    }
}
