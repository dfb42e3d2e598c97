//! Work on every core, by rayon. A page's WebAssembly has a single thread, and its code must be short: there the same calls are loops, without a scheduler.

#[cfg(target_arch = "wasm32")]
mod sequential;

#[cfg(not(target_arch = "wasm32"))]
pub use rayon::{ThreadPool, ThreadPoolBuilder, current_num_threads, join, prelude};
#[cfg(target_arch = "wasm32")]
pub use sequential::{Indexed, ThreadPool, ThreadPoolBuilder, current_num_threads, prelude};

/// The results of a function for each index of a range.
#[cfg(not(target_arch = "wasm32"))]
pub type Indexed<F> = rayon::iter::Map<rayon::range::Iter<usize>, F>;
