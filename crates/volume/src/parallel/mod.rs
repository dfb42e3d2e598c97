//! Work on every core. Loops have rayon's names and are divided here into pieces, which one function hands to rayon's threads. Rayon's own iterators are
//! compiled anew for every loop; they were a fifth of the library's code. A page's WebAssembly has a single thread, for which each loop is one piece.
//!
//! No result depends on the number of pieces (SPEC §12): what reduces and folds brings functions for which the order does not count.

#![expect(
    clippy::redundant_closure,
    reason = "a reference to a function is called through one of `core`'s, which is not inlined"
)]

mod gathered;
mod loops;
mod source;
#[cfg(test)]
mod tests;
mod threads;

pub use gathered::Gathered;
pub use loops::Loop;
pub use source::{Exact, Map, Source};
pub use threads::{ThreadPool, ThreadPoolBuilder, current_num_threads, join};

use std::ops::Range;

use source::{Chunks, ChunksMut};

/// What loops are made of, for `use`.
pub mod prelude {
    pub use super::{IntoLoop as _, Slice as _, SliceMut as _};
}

/// The results of a function for each index of a range.
pub type Indexed<F> = Loop<Map<Range<usize>, F>>;

/// What a loop can begin with.
pub trait IntoLoop {
    /// What is divided.
    type Source: Source;

    /// A loop over all items.
    fn into_par_iter(self) -> Loop<Self::Source>;
}

impl<S: Source> IntoLoop for S {
    type Source = S;

    fn into_par_iter(self) -> Loop<S> {
        Loop::new(self)
    }
}

impl<S: Source> IntoLoop for Loop<S> {
    type Source = S;

    fn into_par_iter(self) -> Self {
        self
    }
}

impl<'a, T: Sync> IntoLoop for &'a Vec<T> {
    type Source = &'a [T];

    fn into_par_iter(self) -> Loop<&'a [T]> {
        Loop::new(self)
    }
}

/// Loops over a slice.
pub trait Slice<T> {
    /// A loop over references to the items.
    fn par_iter(&self) -> Loop<&[T]>;

    /// A loop over slices of so many items; the last may have fewer. Panics if `size` is 0.
    fn par_chunks(&self, size: usize) -> Loop<Chunks<'_, T>>;
}

impl<T: Sync> Slice<T> for [T] {
    fn par_iter(&self) -> Loop<&[T]> {
        Loop::new(self)
    }

    fn par_chunks(&self, size: usize) -> Loop<Chunks<'_, T>> {
        Loop::new(Chunks::new(self, size))
    }
}

/// Loops over a slice that change it.
pub trait SliceMut<T> {
    /// A loop over unique references to the items.
    fn par_iter_mut(&mut self) -> Loop<&mut [T]>;

    /// A loop over unique slices of so many items; the last may have fewer. Panics if `size` is 0.
    fn par_chunks_mut(&mut self, size: usize) -> Loop<ChunksMut<'_, T>>;

    /// Sorts, without keeping the order of equal items.
    fn par_sort_unstable(&mut self)
    where
        T: Ord;

    /// Sorts by a key, without keeping the order of items with equal keys.
    fn par_sort_unstable_by_key<K: Ord>(&mut self, key: impl Fn(&T) -> K + Sync);
}

impl<T: Send> SliceMut<T> for [T] {
    fn par_iter_mut(&mut self) -> Loop<&mut [T]> {
        Loop::new(self)
    }

    fn par_chunks_mut(&mut self, size: usize) -> Loop<ChunksMut<'_, T>> {
        Loop::new(ChunksMut::new(self, size))
    }

    fn par_sort_unstable(&mut self)
    where
        T: Ord,
    {
        threads::sort(self, T::cmp);
    }

    fn par_sort_unstable_by_key<K: Ord>(&mut self, key: impl Fn(&T) -> K + Sync) {
        threads::sort(self, |a, b| key(a).cmp(&key(b)));
    }
}
