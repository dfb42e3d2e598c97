//! Work without Python's lock, also in forked processes: of the threads that share work only the one that forked is left there, and no GPU.

use std::process;
use std::sync::atomic::{AtomicU32, Ordering};

use pyo3::Python;

/// Whether this process was forked from the one that imported the module.
pub(crate) fn is_forked() -> bool {
    static IMPORTED_IN: AtomicU32 = AtomicU32::new(0);
    let now = process::id();
    let imported = IMPORTED_IN.compare_exchange(0, now, Ordering::Relaxed, Ordering::Relaxed);
    imported.is_err_and(|imported| imported != now)
}

/// Runs without Python's lock. A forked process makes threads of its own for it, which costs less than a millisecond for each.
pub(crate) fn detached<T: Send>(py: Python<'_>, run: impl FnOnce() -> T + Send) -> T {
    py.detach(|| {
        if !is_forked() {
            return run();
        }
        match rayon::ThreadPoolBuilder::new().build() {
            Ok(pool) => pool.install(run),
            Err(error) => panic!("a forked process can start no threads: {error}"),
        }
    })
}
