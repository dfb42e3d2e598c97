//! Buckets (§5.1): the items that touch each slab, with every item stored once.
//!
//! Items (bricks of voxels) are sorted by the first slab (sheet group) they touch. No item touches more than `reach` slabs, so the items
//! that touch slab k are a contiguous range: from the first whose first slab is k - reach + 1 to the last whose first slab is k.

use std::ops::Range;

/// The buckets of one list.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Buckets {
    /// Indices into the list, sorted by first slab; within a slab in list order.
    pub order: Vec<u32>,
    /// `starts[i]..starts[i + 1]` of `order` are the items whose first slab is `base + i`.
    starts: Vec<u32>,
    base: i32,
    reach: i32,
}

impl Buckets {
    /// Sorts items by the first slab they touch, with a counting sort.
    pub fn sort(touched: &[Range<i32>]) -> Self {
        let base = touched.iter().map(|slabs| slabs.start).min().unwrap_or(0);
        let end = touched.iter().map(|slabs| slabs.start + 1).max().unwrap_or(base);
        let mut starts = vec![0_u32; (end - base) as usize + 1];
        for slabs in touched {
            starts[(slabs.start - base) as usize + 1] += 1;
        }
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        let mut next = starts.clone();
        let mut order = vec![0; touched.len()];
        for (thing, slabs) in touched.iter().enumerate() {
            let slot = &mut next[(slabs.start - base) as usize];
            order[*slot as usize] = thing as u32;
            *slot += 1;
        }
        let reach = touched.iter().map(|slabs| slabs.end - slabs.start).max().unwrap_or(0);
        Self { order, starts, base, reach }
    }

    /// The slabs that any item can touch.
    pub fn range(&self) -> Option<Range<i32>> {
        let last = self.base + self.starts.len() as i32 - 2;
        (!self.order.is_empty()).then(|| self.base..last + self.reach)
    }

    /// The range of `order` that holds every item that touches slab `k`.
    pub fn touching(&self, k: i32) -> Range<u32> {
        let start = |slab: i32| self.starts[(slab - self.base).clamp(0, self.starts.len() as i32 - 1) as usize];
        start(k - self.reach + 1)..start(k + 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_hold_everything_that_touches_a_slab() {
        let touched = [3..5, -2..0, 3..4, 0..2, -2..-1, 1..2];
        let buckets = Buckets::sort(&touched);
        assert_eq!(buckets.order, [1, 4, 3, 5, 0, 2]);
        assert_eq!(buckets.range(), Some(-2..5));
        for k in -5..8 {
            let range = buckets.touching(k);
            let held = &buckets.order[range.start as usize..range.end as usize];
            let expected: Vec<u32> =
                buckets.order.iter().copied().filter(|&t| (k - 1..=k).contains(&touched[t as usize].start)).collect();
            assert_eq!(held, expected, "slab {k}");
            assert!((0..6).all(|t| !touched[t as usize].contains(&k) || held.contains(&t)), "slab {k}");
        }
    }

    #[test]
    fn nothing_no_ranges() {
        let buckets = Buckets::sort(&[]);
        assert!(buckets.order.is_empty());
        assert!(buckets.touching(0).is_empty());
        assert_eq!(buckets.range(), None);
    }
}
