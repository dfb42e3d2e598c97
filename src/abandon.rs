//! Work that nobody waits for any more, as after Ctrl-C in Python: drawing stops between two batches, and what it returns is discarded.

use std::cell::RefCell;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

thread_local! {
    static WATCHED: RefCell<Option<Arc<AtomicBool>>> = const { RefCell::new(None) };
}

/// Does some work, which may stop early once the flag is set. Then its result is to be discarded; nothing that outlives the result is incomplete.
pub fn watch<T>(abandoned: &Arc<AtomicBool>, work: impl FnOnce() -> T) -> T {
    let before = WATCHED.replace(Some(Arc::clone(abandoned)));
    let result = work();
    WATCHED.set(before);
    result
}

/// Tells threads that share this thread's work whether anybody waits for it.
#[derive(Clone, Default)]
pub(crate) struct Abandoned(Option<Arc<AtomicBool>>);

impl Abandoned {
    /// The work of this thread.
    pub(crate) fn here() -> Self {
        Self(WATCHED.with_borrow(Clone::clone))
    }

    /// Whether nobody waits for it.
    pub(crate) fn is_true(&self) -> bool {
        self.0.as_ref().is_some_and(|flag| flag.load(Ordering::Relaxed))
    }
}
