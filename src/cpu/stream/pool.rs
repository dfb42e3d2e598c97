//! The chunks in memory: read by threads of their own when tiles ask for them, and dropped when memory is short and no tile draws them.

use std::collections::{HashMap, HashSet};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use glam::UVec3;

use super::chunk::Chunk;
use super::source::Source;
use crate::cpu::count::Drawn;
use crate::lists::quad_plan::Overlaps;
use crate::volume::VolumeError;

/// The chunks of a source.
#[derive(Debug)]
pub(super) struct Pool {
    /// The bytes that chunks may hold.
    capacity: usize,
    held: Arc<AtomicUsize>,
    state: Mutex<State>,
    /// Notified whenever a chunk has been read.
    changed: Condvar,
}

#[derive(Debug, Default)]
struct State {
    chunks: HashMap<u32, Entry>,
    /// Counts uses.
    clock: u64,
    /// All chunks that have been read, whether they are still in memory or not, with what has been drawn of their bricks.
    read: HashMap<u32, Arc<Drawn>>,
    counts: Reads,
    /// Why a chunk could not be read.
    failure: Option<VolumeError>,
}

#[derive(Debug)]
enum Entry {
    Reading,
    /// Chunks that nobody has used yet stay, however short memory is: somebody waits for them.
    Here {
        chunk: Arc<Chunk>,
        used: Option<u64>,
    },
}

/// What has been read of a store, each chunk counted once although it may have been read again.
#[derive(Clone, Debug, Default)]
pub(super) struct Reads {
    /// The store's chunks, of those that it holds.
    pub(super) chunks: HashSet<UVec3>,
    /// Bytes of the store.
    pub(super) bytes: u64,
    /// The most bytes that chunks held at a time.
    pub(super) most_held: u64,
    /// The overlaps of their voxels with slabs.
    pub(super) overlaps: Overlaps,
}

impl Pool {
    /// An empty pool for chunks that hold a number of bytes together.
    pub(super) fn new(capacity: usize) -> Self {
        Self { capacity, held: Arc::default(), state: Mutex::default(), changed: Condvar::new() }
    }

    /// Marks a chunk as being read, if it is neither here nor being read: then [`Self::read`] must follow.
    pub(super) fn reserve(&self, number: u32) -> bool {
        let mut state = self.state();
        let is_new = state.failure.is_none() && !state.chunks.contains_key(&number);
        if is_new {
            state.chunks.insert(number, Entry::Reading);
        }
        is_new
    }

    /// Reads a chunk that was reserved.
    pub(super) fn read(&self, source: &Source, number: u32) {
        let drawn = self.state().read.get(&number).cloned();
        let result = Chunk::read(source, number, drawn, &self.held);
        let mut state = self.state();
        match result {
            Err(error) => state.failure = state.failure.take().or(Some(error)),
            Ok((chunk, bytes)) => {
                state.note(source, &chunk, bytes);
                state.chunks.insert(number, Entry::Here { chunk: Arc::new(chunk), used: None });
                let held = self.held.load(Ordering::Relaxed);
                state.counts.most_held = state.counts.most_held.max(held as u64);
                if held > self.capacity {
                    state.drop_oldest(&self.held, self.capacity / 8 * 7);
                }
            }
        }
        drop(state);
        self.changed.notify_all();
    }

    /// A chunk that is here or being read; `None` if reading failed, or it must be reserved again.
    pub(super) fn wait(&self, number: u32) -> Option<Arc<Chunk>> {
        let mut state = self.state();
        loop {
            if state.failure.is_some() {
                return None;
            }
            state.clock += 1;
            let now = state.clock;
            match state.chunks.get_mut(&number) {
                None => return None,
                Some(Entry::Here { chunk, used }) => {
                    *used = Some(now);
                    return Some(Arc::clone(chunk));
                }
                Some(Entry::Reading) => {
                    state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
                }
            }
        }
    }

    /// Whether a chunk could not be read.
    pub(super) fn has_failed(&self) -> bool {
        self.state().failure.is_some()
    }

    /// What has been read until now.
    pub(super) fn reads(&self) -> Reads {
        self.state().counts.clone()
    }

    /// Why a chunk could not be read, if one could not.
    pub(super) fn take_failure(&self) -> Option<VolumeError> {
        self.state().failure.take()
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    /// Counts a chunk that has been read for the first time.
    fn note(&mut self, source: &Source, chunk: &Chunk, bytes: u64) {
        if self.read.insert(chunk.number(), Arc::clone(chunk.drawn())).is_some() {
            return;
        }
        if chunk.is_read() {
            let is_held = |chunk: &UVec3| source.store.contains(source.level, *chunk).unwrap_or(false);
            self.counts.chunks.extend(source.stored(source.read_bounds(chunk.number())).filter(is_held));
        }
        self.counts.bytes += bytes;
        self.counts.overlaps = std::mem::take(&mut self.counts.overlaps).and(chunk.overlaps().clone());
    }

    /// Drops the chunks that were used longest ago, and that nobody draws, until the others hold less than a number of bytes.
    fn drop_oldest(&mut self, held: &AtomicUsize, target: usize) {
        let idle = |(number, entry): (&u32, &Entry)| match entry {
            Entry::Here { chunk, used } if Arc::strong_count(chunk) == 1 => used.map(|used| (used, *number)),
            _ => None,
        };
        let mut idle: Vec<(u64, u32)> = self.chunks.iter().filter_map(idle).collect();
        idle.sort_unstable();
        for (_, number) in idle {
            if held.load(Ordering::Relaxed) <= target {
                break;
            }
            self.chunks.remove(&number);
        }
    }
}
