//! The threads: rayon's, or a page's only one.

#[cfg(not(target_arch = "wasm32"))]
use native as of_target;
#[cfg(target_arch = "wasm32")]
use single as of_target;

pub use of_target::{ThreadPool, ThreadPoolBuilder, current_num_threads, join};
pub(super) use of_target::{run, sort};

#[cfg(not(target_arch = "wasm32"))]
mod native {
    use std::cmp::Ordering;

    use rayon::prelude::*;
    pub use rayon::{ThreadPool, ThreadPoolBuilder, current_num_threads, join};

    /// Calls a function for every number below `count`, on any thread and in any order.
    pub(in super::super) fn run(count: usize, work: &(dyn Fn(usize) + Sync)) {
        (0..count).into_par_iter().with_max_len(1).for_each(work);
    }

    /// Sorts, without keeping the order of equal items.
    pub(in super::super) fn sort<T: Send>(items: &mut [T], order: impl Fn(&T, &T) -> Ordering + Sync) {
        items.par_sort_unstable_by(order);
    }
}

#[cfg(target_arch = "wasm32")]
mod single {
    use std::cmp::Ordering;
    use std::convert::Infallible;

    /// One.
    pub fn current_num_threads() -> usize {
        1
    }

    /// Calls a function for every number below `count`.
    pub(in super::super) fn run(count: usize, work: &(dyn Fn(usize) + Sync)) {
        (0..count).for_each(work);
    }

    /// Calls both functions.
    pub fn join<A, B>(a: impl FnOnce() -> A, b: impl FnOnce() -> B) -> (A, B) {
        (a(), b())
    }

    /// Sorts, without keeping the order of equal items.
    pub(in super::super) fn sort<T>(items: &mut [T], order: impl Fn(&T, &T) -> Ordering) {
        items.sort_unstable_by(order);
    }

    /// The page's only thread.
    #[derive(Debug)]
    pub struct ThreadPool;

    impl ThreadPool {
        /// Calls the function.
        pub fn spawn(&self, work: impl FnOnce()) {
            work();
        }

        /// Calls the function.
        pub fn install<R>(&self, work: impl FnOnce() -> R) -> R {
            work()
        }
    }

    /// What makes a [`ThreadPool`].
    #[derive(Default)]
    pub struct ThreadPoolBuilder;

    impl ThreadPoolBuilder {
        /// A pool of one thread.
        pub fn new() -> Self {
            Self
        }

        /// A pool of one thread, however many are asked for.
        pub fn num_threads(self, _: usize) -> Self {
            self
        }

        /// The pool.
        pub fn build(self) -> Result<ThreadPool, Infallible> {
            Ok(ThreadPool)
        }
    }
}
