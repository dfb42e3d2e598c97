//! Decoded chunks that further boxes may need.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use glam::UVec3;

use crate::volume::Values;

/// The values of chunks, of which those are dropped first that were not used for the longest time.
#[derive(Debug)]
pub(super) struct Kept {
    /// The bytes that they may take.
    capacity: u64,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    chunks: HashMap<UVec3, Entry>,
    /// The bytes that they take, and the most that they took.
    held: u64,
    most_held: u64,
    /// Counts uses.
    clock: u64,
}

#[derive(Debug)]
struct Entry {
    values: Arc<Values>,
    used: u64,
}

impl Kept {
    pub(super) fn new(capacity: u64) -> Self {
        Self { capacity, state: Mutex::default() }
    }

    /// The most bytes that were held at a time.
    pub(super) fn most_held(&self) -> u64 {
        self.state.lock().unwrap_or_else(PoisonError::into_inner).most_held
    }

    /// A chunk's values, if they are kept.
    pub(super) fn get(&self, chunk: UVec3) -> Option<Arc<Values>> {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.clock += 1;
        let used = state.clock;
        let entry = state.chunks.get_mut(&chunk)?;
        entry.used = used;
        Some(Arc::clone(&entry.values))
    }

    /// Keeps a chunk's values, if there is room for them at all.
    pub(super) fn keep(&self, chunk: UVec3, values: &Arc<Values>) {
        let bytes = |values: &Values| values.as_slice().bytes() as u64;
        if bytes(values) > self.capacity {
            return;
        }
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let before = state.chunks.remove(&chunk).map_or(0, |before| bytes(&before.values));
        state.held -= before;
        while state.held + bytes(values) > self.capacity {
            let oldest = state.chunks.iter().min_by_key(|(_, entry)| entry.used).map(|(&chunk, _)| chunk);
            let dropped = oldest.and_then(|chunk| state.chunks.remove(&chunk));
            let Some(dropped) = dropped else { break };
            state.held -= bytes(&dropped.values);
        }
        state.clock += 1;
        let entry = Entry { values: Arc::clone(values), used: state.clock };
        state.chunks.insert(chunk, entry);
        state.held += bytes(values);
        state.most_held = state.most_held.max(state.held);
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;

    #[test]
    fn what_was_not_used_for_the_longest_time_is_dropped() {
        let kept = Kept::new(100);
        let chunk = |x| UVec3::new(x, 0, 0);
        let values = |count: usize| Arc::new(Values::from(vec![0.5_f32; count]));
        (0..3).for_each(|x| kept.keep(chunk(x), &values(8)));
        assert_eq!(kept.get(chunk(0)).unwrap().as_slice().len(), 8);
        kept.keep(chunk(3), &values(8));
        assert!(kept.get(chunk(1)).is_none() && [0, 2, 3].iter().all(|&x| kept.get(chunk(x)).is_some()));
        // A chunk that is kept again takes its place, and one that is too large drops nothing.
        kept.keep(chunk(3), &values(9));
        kept.keep(chunk(4), &values(26));
        assert!([0, 2, 3].iter().all(|&x| kept.get(chunk(x)).is_some()) && kept.get(chunk(4)).is_none());
        assert_eq!(kept.most_held(), 100);
    }
}
