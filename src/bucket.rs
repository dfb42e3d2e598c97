//! Buckets (§5.1): which voxels touch which slab, without storing a voxel twice.
//!
//! Voxels are sorted by the first slab they touch. No kernel touches more than `reach` slabs, so those that touch slab k
//! lie between the first voxel whose first slab is k - reach + 1 and the last whose first slab is k: one contiguous range.

use std::ops::Range;

/// The buckets of one voxel list.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Buckets {
    /// Indices into the voxel list, sorted by first slab; within one slab in list order.
    pub order: Vec<u32>,
    /// `starts[i]..starts[i + 1]` of `order` are the voxels whose first slab is `base + i`.
    starts: Vec<u32>,
    base: i32,
    reach: i32,
}

impl Buckets {
    /// Counting sort of voxels by their first slab. `None` leaves a voxel out. `reach` is the largest number of slabs that
    /// one kernel touches.
    pub fn sort(first_slabs: &[Option<i32>], reach: i32) -> Self {
        let base = first_slabs.iter().flatten().copied().min().unwrap_or(0);
        let end = first_slabs.iter().flatten().copied().max().map_or(base, |last| last + 1);
        let mut starts = vec![0_u32; (end - base) as usize + 1];
        for first in first_slabs.iter().flatten() {
            starts[(first - base) as usize + 1] += 1;
        }
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        let mut next = starts.clone();
        let mut order = vec![0; starts.last().copied().unwrap_or(0) as usize];
        for (voxel, first) in first_slabs.iter().enumerate() {
            if let Some(first) = first {
                let slot = &mut next[(first - base) as usize];
                order[*slot as usize] = voxel as u32;
                *slot += 1;
            }
        }
        Self { order, starts, base, reach }
    }

    /// The range of `order` that holds every voxel that touches slab `k`.
    pub fn touching(&self, k: i32) -> Range<u32> {
        let start = |slab: i32| self.starts[(slab - self.base).clamp(0, self.starts.len() as i32 - 1) as usize];
        start(k - self.reach + 1)..start(k + 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_hold_every_voxel_that_touches_a_slab() {
        let firsts = [Some(3), None, Some(-2), Some(3), Some(0), Some(-2), Some(1)];
        let buckets = Buckets::sort(&firsts, 2);
        assert_eq!(buckets.order, [2, 5, 4, 6, 0, 3]);
        for k in -5..8 {
            let touching: Vec<u32> =
                buckets.order[buckets.touching(k).start as usize..buckets.touching(k).end as usize].to_vec();
            let expected: Vec<u32> = buckets
                .order
                .iter()
                .copied()
                .filter(|&v| firsts[v as usize].is_some_and(|f| (k - 1..=k).contains(&f)))
                .collect();
            assert_eq!(touching, expected, "slab {k}");
        }
    }

    #[test]
    fn no_voxels_no_ranges() {
        let buckets = Buckets::sort(&[None, None], 5);
        assert!(buckets.order.is_empty());
        assert!(buckets.touching(0).is_empty());
    }
}
