//! The part of rayon that the library uses, as loops over iterators. Results are those of rayon, since no result depends on the number of threads (SPEC §12).

use std::convert::Infallible;
use std::iter::{Enumerate, Filter, FilterMap, FlatMap, Map, Zip};
use std::ops::Range;
use std::slice::{Chunks, ChunksMut, Iter, IterMut};

pub mod prelude {
    pub use super::{IntoLoop as _, Slice as _, SliceMut as _, VecExtend as _};
}

pub fn current_num_threads() -> usize {
    1
}

/// An iterator with rayon's names. Those whose meaning is the standard library's come from [`Iterator`]; the ones here return a loop again, or take
/// other arguments than there.
pub struct Loop<I>(I);

/// The results of a function for each index of a range.
pub type Indexed<F> = Loop<Map<Range<usize>, F>>;

impl<I: Iterator> Iterator for Loop<I> {
    type Item = I::Item;

    fn next(&mut self) -> Option<I::Item> {
        self.0.next()
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        self.0.size_hint()
    }
}

impl<I: Iterator> Loop<I> {
    pub fn map<T, F: FnMut(I::Item) -> T>(self, f: F) -> Loop<Map<I, F>> {
        Loop(self.0.map(f))
    }

    pub fn filter<F: FnMut(&I::Item) -> bool>(self, f: F) -> Loop<Filter<I, F>> {
        Loop(self.0.filter(f))
    }

    pub fn filter_map<T, F: FnMut(I::Item) -> Option<T>>(self, f: F) -> Loop<FilterMap<I, F>> {
        Loop(self.0.filter_map(f))
    }

    pub fn flat_map_iter<T: IntoIterator, F: FnMut(I::Item) -> T>(self, f: F) -> Loop<FlatMap<I, T, F>> {
        Loop(self.0.flat_map(f))
    }

    pub fn enumerate(self) -> Loop<Enumerate<I>> {
        Loop(self.0.enumerate())
    }

    pub fn zip<T: IntoIterator>(self, other: T) -> Loop<Zip<I, T::IntoIter>> {
        Loop(self.0.zip(other))
    }

    pub fn with_min_len(self, _: usize) -> Self {
        self
    }

    pub fn with_max_len(self, _: usize) -> Self {
        self
    }

    pub fn for_each_init<S>(self, init: impl FnOnce() -> S, mut f: impl FnMut(&mut S, I::Item)) {
        let mut state = init();
        self.0.for_each(|item| f(&mut state, item));
    }

    /// A loop over a single item: the result of folding all items, where rayon has one for each thread.
    pub fn fold<T>(self, start: impl FnOnce() -> T, f: impl FnMut(T, I::Item) -> T) -> Loop<std::iter::Once<T>> {
        Loop(std::iter::once(self.0.fold(start(), f)))
    }

    pub fn reduce(self, start: impl FnOnce() -> I::Item, f: impl FnMut(I::Item, I::Item) -> I::Item) -> I::Item {
        self.0.fold(start(), f)
    }

    pub fn reduce_with(self, f: impl FnMut(I::Item, I::Item) -> I::Item) -> Option<I::Item> {
        self.0.reduce(f)
    }

    pub fn try_reduce<T, R: Tried<T>>(mut self, start: impl FnOnce() -> T, f: impl Fn(T, T) -> R) -> R
    where
        I: Iterator<Item = R>,
    {
        let mut result = start();
        for item in &mut self.0 {
            match item.tried().and_then(|item| f(result, item).tried()) {
                Ok(next) => result = next,
                Err(failure) => return failure,
            }
        }
        R::of(result)
    }
}

/// An [`Option`] or a [`Result`].
pub trait Tried<T>: Sized {
    /// The value, or `Err` with the `None` or the error itself.
    fn tried(self) -> Result<T, Self>;

    fn of(value: T) -> Self;
}

impl<T> Tried<T> for Option<T> {
    fn tried(self) -> Result<T, Self> {
        self.ok_or(None)
    }

    fn of(value: T) -> Self {
        Some(value)
    }
}

impl<T, E> Tried<T> for Result<T, E> {
    fn tried(self) -> Result<T, Self> {
        self.map_err(Err)
    }

    fn of(value: T) -> Self {
        Ok(value)
    }
}

pub trait IntoLoop: IntoIterator + Sized {
    fn into_par_iter(self) -> Loop<Self::IntoIter> {
        Loop(self.into_iter())
    }
}

impl<T: IntoIterator> IntoLoop for T {}

pub trait Slice<T> {
    fn par_iter(&self) -> Loop<Iter<'_, T>>;
    fn par_chunks(&self, size: usize) -> Loop<Chunks<'_, T>>;
}

impl<T> Slice<T> for [T] {
    fn par_iter(&self) -> Loop<Iter<'_, T>> {
        Loop(self.iter())
    }

    fn par_chunks(&self, size: usize) -> Loop<Chunks<'_, T>> {
        Loop(self.chunks(size))
    }
}

pub trait SliceMut<T> {
    fn par_iter_mut(&mut self) -> Loop<IterMut<'_, T>>;
    fn par_chunks_mut(&mut self, size: usize) -> Loop<ChunksMut<'_, T>>;
    fn par_sort_unstable(&mut self)
    where
        T: Ord;
    fn par_sort_unstable_by_key<K: Ord>(&mut self, key: impl FnMut(&T) -> K);
}

impl<T> SliceMut<T> for [T] {
    fn par_iter_mut(&mut self) -> Loop<IterMut<'_, T>> {
        Loop(self.iter_mut())
    }

    fn par_chunks_mut(&mut self, size: usize) -> Loop<ChunksMut<'_, T>> {
        Loop(self.chunks_mut(size))
    }

    fn par_sort_unstable(&mut self)
    where
        T: Ord,
    {
        self.sort_unstable();
    }

    fn par_sort_unstable_by_key<K: Ord>(&mut self, key: impl FnMut(&T) -> K) {
        self.sort_unstable_by_key(key);
    }
}

pub trait VecExtend<T> {
    fn par_extend(&mut self, items: impl IntoIterator<Item = T>);
}

impl<T> VecExtend<T> for Vec<T> {
    fn par_extend(&mut self, items: impl IntoIterator<Item = T>) {
        self.extend(items);
    }
}

/// A pool without threads: the caller does the work itself.
#[derive(Debug)]
pub struct ThreadPool;

impl ThreadPool {
    #[expect(clippy::unused_self, reason = "rayon's threads belong to a pool")]
    pub fn spawn(&self, work: impl FnOnce()) {
        work();
    }

    #[expect(clippy::unused_self, reason = "rayon's threads belong to a pool")]
    pub fn install<R>(&self, work: impl FnOnce() -> R) -> R {
        work()
    }
}

pub struct ThreadPoolBuilder;

impl ThreadPoolBuilder {
    pub fn new() -> Self {
        Self
    }

    pub fn num_threads(self, _: usize) -> Self {
        self
    }

    #[expect(clippy::unnecessary_wraps, reason = "rayon's may fail")]
    pub fn build(self) -> Result<ThreadPool, Infallible> {
        Ok(ThreadPool)
    }
}
