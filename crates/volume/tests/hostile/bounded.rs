//! Runs that must not panic or allocate more than their input warrants.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Mutex, MutexGuard, PoisonError};

use peak_alloc::PeakAlloc;

#[global_allocator]
static ALLOCATOR: PeakAlloc = PeakAlloc;

/// The bytes that a load may use beyond four times the file's size and three times the values'. Users may be promised 64 MiB.
pub(crate) const ROOM: usize = 8 << 20;

/// Keeps this program's other tests waiting, because the allocator counts for the whole process.
pub(crate) fn alone() -> MutexGuard<'static, ()> {
    static ALONE: Mutex<()> = Mutex::new(());
    ALONE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Runs a function that must not panic or use more memory than `bytes` plus its result. CI ends runs that take too long.
pub(crate) fn bounded<T>(what: &str, bytes: usize, run: impl Fn() -> T, size: impl Fn(&T) -> usize) -> T {
    let before = ALLOCATOR.current_usage();
    ALLOCATOR.reset_peak_usage();
    let result = catch_unwind(AssertUnwindSafe(&run)).unwrap_or_else(|_| panic!("{what}: a panic"));
    let peak = ALLOCATOR.peak_usage().saturating_sub(before);
    let allowed = ROOM + 4 * bytes + 3 * size(&result);
    assert!(peak <= allowed, "{what}: {peak} bytes of memory, not {allowed}");
    result
}

/// The counts of a run.
#[derive(Default)]
pub(crate) struct Count {
    pub(crate) inputs: usize,
    pub(crate) accepted: usize,
}

impl Count {
    /// Asserts that there were enough mutants, and that they were neither harmless nor hopeless.
    #[track_caller]
    pub(crate) fn assert_mixed(&self, least: usize) {
        let Self { inputs, accepted } = *self;
        println!("{accepted} of {inputs} accepted");
        assert!(inputs >= least, "{inputs} inputs");
        assert!(20 * accepted > inputs && 20 * accepted < 19 * inputs, "{accepted} of {inputs} accepted");
    }
}
