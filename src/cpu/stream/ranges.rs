//! What is known of the values in chunks: nothing, that the store holds them, or their range.

use std::sync::atomic::{AtomicU64, Ordering};

/// The minimum and maximum of the values in every chunk, as far as they are known.
#[derive(Debug)]
pub(super) struct Ranges(Vec<AtomicU64>);

/// What is known of a chunk.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Known {
    Nothing,
    /// The store holds it.
    Held,
    /// Its minimum and maximum; the minimum is the larger one if there are only holes.
    Range([f32; 2]),
}

/// Pairs of `f32`s that are no range, as both are NaN.
const NOTHING: u64 = u64::MAX;
const HELD: u64 = u64::MAX - 1;

impl Ranges {
    /// Nothing is known of a number of chunks.
    pub(super) fn new(chunks: u32) -> Self {
        Self((0..chunks).map(|_| AtomicU64::new(NOTHING)).collect())
    }

    pub(super) fn of(&self, chunk: u32) -> Known {
        match self.0[chunk as usize].load(Ordering::Relaxed) {
            NOTHING => Known::Nothing,
            HELD => Known::Held,
            bits => Known::Range([(bits >> 32) as u32, bits as u32].map(f32::from_bits)),
        }
    }

    pub(super) fn set(&self, chunk: u32, known: Known) {
        let bits = match known {
            Known::Nothing => NOTHING,
            Known::Held => HELD,
            Known::Range([min, max]) => u64::from(min.to_bits()) << 32 | u64::from(max.to_bits()),
        };
        self.0[chunk as usize].store(bits, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::range::EMPTY;

    #[test]
    fn what_is_noted_is_known() {
        let ranges = Ranges::new(5);
        let known =
            [Known::Nothing, Known::Held, Known::Range([-1.5, 7.0]), Known::Range(EMPTY), Known::Range([0.0; 2])];
        (0..).zip(known).for_each(|(chunk, known)| ranges.set(chunk, known));
        assert_eq!([0, 1, 2, 3, 4].map(|chunk| ranges.of(chunk)), known);
    }
}
