//! Work on every core, by rayon. A page's WebAssembly has a single thread, and its code must be short: there the same calls are loops, without a scheduler.

#[cfg(target_arch = "wasm32")]
mod sequential;

#[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
pub(crate) use rayon::join;
#[cfg(all(feature = "cpu", not(target_arch = "wasm32")))]
pub(crate) use rayon::{ThreadPool, ThreadPoolBuilder};
#[cfg(not(target_arch = "wasm32"))]
pub(crate) use rayon::{current_num_threads, prelude};
#[cfg(target_arch = "wasm32")]
pub(crate) use sequential::{Indexed, current_num_threads, prelude};
#[cfg(all(feature = "cpu", target_arch = "wasm32"))]
pub(crate) use sequential::{ThreadPool, ThreadPoolBuilder};

/// What a function returns for each index of a range.
#[cfg(not(target_arch = "wasm32"))]
pub(crate) type Indexed<F> = rayon::iter::Map<rayon::range::Iter<usize>, F>;
