//! The ranges of the values in chunks, as far as they are known.

use std::sync::atomic::{AtomicU64, Ordering};

/// The minimum and maximum of the values in every chunk, as far as they are known.
#[derive(Debug)]
pub(super) struct Ranges(Vec<AtomicU64>);

/// A pair of `f32`s that is no range, as both are NaN.
const UNKNOWN: u64 = u64::MAX;

impl Ranges {
    /// Nothing is known of a number of chunks.
    pub(super) fn new(chunks: u32) -> Self {
        Self((0..chunks).map(|_| AtomicU64::new(UNKNOWN)).collect())
    }

    /// A chunk's minimum and maximum, if they are known; the minimum is the larger one if there are only holes.
    pub(super) fn of(&self, chunk: u32) -> Option<[f32; 2]> {
        match self.0[chunk as usize].load(Ordering::Relaxed) {
            UNKNOWN => None,
            bits => Some([(bits >> 32) as u32, bits as u32].map(f32::from_bits)),
        }
    }

    pub(super) fn set(&self, chunk: u32, [min, max]: [f32; 2]) {
        let bits = u64::from(min.to_bits()) << 32 | u64::from(max.to_bits());
        self.0[chunk as usize].store(bits, Ordering::Relaxed);
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;
    use crate::volume::range::EMPTY;

    #[test]
    fn what_is_noted_is_known() {
        let ranges = Ranges::new(4);
        let known = [[-1.5, 7.0], EMPTY, [0.0; 2]];
        (0..).zip(known).for_each(|(chunk, range)| ranges.set(chunk, range));
        assert_eq!([0, 1, 2].map(|chunk| ranges.of(chunk).unwrap()), known);
        assert_eq!(ranges.of(3), None);
    }
}
