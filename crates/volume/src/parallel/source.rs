//! What loops go over: ranges, slices, their chunks, vectors, and what is made of these item by item.

use std::iter::zip;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};

/// Whether all loops are one piece: a page has one thread.
pub(super) const IS_ONE: bool = cfg!(target_arch = "wasm32");

/// How a loop is divided.
pub struct Pieces {
    pub(super) items: usize,
    pub(super) count: usize,
}

impl Pieces {
    /// The numbers of a piece's items.
    pub(super) fn range(&self, piece: usize) -> Range<usize> {
        if IS_ONE {
            return 0..self.items;
        }
        let first = |piece: usize| self.items / self.count * piece + piece.min(self.items % self.count);
        first(piece)..first(piece + 1)
    }
}

/// Items in an order, which can be divided.
pub trait Source: Sized {
    /// What the loop is given.
    type Item;
    /// What the threads share.
    type Shared: Sync;

    /// The number of items; where some are left out or become several, as if each were one.
    fn count(&self) -> usize;

    /// Gives the threads what they share.
    fn share(self, pieces: &Pieces) -> Self::Shared;

    /// The items of a piece, which is asked for once.
    fn part(shared: &Self::Shared, pieces: &Pieces, piece: usize) -> impl Iterator<Item = Self::Item>;
}

/// A source that leaves nothing out, so that items have numbers.
pub trait Exact: Source {}

/// A source that threads share as it is, given the items of a range.
macro_rules! shared {
    ([$($of:tt)*] $source:ty, $item:ty, |$own:ident| $count:expr, |$range:ident| $part:expr) => {
        impl<$($of)*> Source for $source {
            type Item = $item;
            type Shared = Self;

            #[inline(always)]
            fn count(&self) -> usize {
                let $own = self;
                $count
            }

            #[inline(always)]
            fn share(self, _: &Pieces) -> Self {
                self
            }

            #[inline(always)]
            fn part($own: &Self, pieces: &Pieces, piece: usize) -> impl Iterator<Item = $item> {
                let $range = pieces.range(piece);
                $part
            }
        }

        impl<$($of)*> Exact for $source {}
    };
}

shared!([] Range<u32>, u32, |own| own.len(), |range| own.start + range.start as u32..own.start + range.end as u32);
shared!([] Range<u64>, u64, |own| own.end.saturating_sub(own.start) as usize,
    |range| own.start + range.start as u64..own.start + range.end as u64);
shared!([] Range<usize>, usize, |own| own.len(), |range| own.start + range.start..own.start + range.end);
shared!(['a, T: Sync] &'a [T], &'a T, |own| own.len(), |range| own[range].iter());
shared!(['a, T: Sync] Chunks<'a, T>, &'a [T], |own| own.items.len().div_ceil(own.size),
    |range| own.items[within(&range, own.size, own.items.len())].chunks(own.size));

/// Slices of equal length, but for the last.
pub struct Chunks<'a, T> {
    items: &'a [T],
    size: usize,
}

impl<'a, T> Chunks<'a, T> {
    /// Panics if `size` is 0.
    pub fn new(items: &'a [T], size: usize) -> Self {
        assert!(size > 0, "chunks have no length of 0");
        Self { items, size }
    }
}

/// The items of some chunks, of which the last may have fewer.
fn within(chunks: &Range<usize>, size: usize, items: usize) -> Range<usize> {
    (chunks.start * size).min(items)..(chunks.end * size).min(items)
}

/// What each piece takes.
type Slots<T> = Vec<Mutex<Option<T>>>;

fn take<T>(slots: &Slots<T>, piece: usize) -> T {
    let taken = slots[piece].lock().unwrap_or_else(PoisonError::into_inner).take();
    taken.expect("a piece is asked for once")
}

/// Unique slices, one for each piece, of `size` items for each of the loop's.
fn divided<'a, T>(mut items: &'a mut [T], size: usize, pieces: &Pieces) -> Slots<&'a mut [T]> {
    if IS_ONE {
        return vec![Mutex::new(Some(items))];
    }
    let count = items.len();
    let slot = |piece| {
        let range = within(&pieces.range(piece), size, count);
        Mutex::new(items.split_off_mut(..range.len()))
    };
    (0..pieces.count).map(slot).collect()
}

impl<'a, T: Send> Source for &'a mut [T] {
    type Item = &'a mut T;
    type Shared = Slots<Self>;

    #[inline(always)]
    fn count(&self) -> usize {
        self.len()
    }

    #[inline(always)]
    fn share(self, pieces: &Pieces) -> Slots<Self> {
        divided(self, 1, pieces)
    }

    #[inline(always)]
    fn part(slots: &Slots<Self>, _: &Pieces, piece: usize) -> impl Iterator<Item = &'a mut T> {
        take(slots, piece).iter_mut()
    }
}

impl<T: Send> Exact for &mut [T] {}

/// Unique slices of equal length, but for the last.
pub struct ChunksMut<'a, T> {
    items: &'a mut [T],
    size: usize,
}

impl<'a, T> ChunksMut<'a, T> {
    /// Panics if `size` is 0.
    pub fn new(items: &'a mut [T], size: usize) -> Self {
        assert!(size > 0, "chunks have no length of 0");
        Self { items, size }
    }
}

impl<'a, T: Send> Source for ChunksMut<'a, T> {
    type Item = &'a mut [T];
    type Shared = (Slots<&'a mut [T]>, usize);

    #[inline(always)]
    fn count(&self) -> usize {
        self.items.len().div_ceil(self.size)
    }

    #[inline(always)]
    fn share(self, pieces: &Pieces) -> Self::Shared {
        (divided(self.items, self.size, pieces), self.size)
    }

    #[inline(always)]
    fn part((slots, size): &Self::Shared, _: &Pieces, piece: usize) -> impl Iterator<Item = &'a mut [T]> {
        take(slots, piece).chunks_mut(*size)
    }
}

impl<T: Send> Exact for ChunksMut<'_, T> {}

impl<T: Send> Source for Vec<T> {
    type Item = T;
    type Shared = Slots<Self>;

    #[inline(always)]
    fn count(&self) -> usize {
        self.len()
    }

    #[inline(always)]
    fn share(self, pieces: &Pieces) -> Slots<Self> {
        if IS_ONE {
            return vec![Mutex::new(Some(self))];
        }
        let mut items = self.into_iter();
        (0..pieces.count)
            .map(|piece| Mutex::new(Some(items.by_ref().take(pieces.range(piece).len()).collect())))
            .collect()
    }

    #[inline(always)]
    fn part(slots: &Slots<Self>, _: &Pieces, piece: usize) -> impl Iterator<Item = T> {
        take(slots, piece).into_iter()
    }
}

impl<T: Send> Exact for Vec<T> {}

/// Items with their numbers.
pub struct Enumerate<S>(pub(super) S);

impl<S: Exact> Source for Enumerate<S> {
    type Item = (usize, S::Item);
    type Shared = S::Shared;

    #[inline(always)]
    fn count(&self) -> usize {
        self.0.count()
    }

    #[inline(always)]
    fn share(self, pieces: &Pieces) -> S::Shared {
        self.0.share(pieces)
    }

    #[inline(always)]
    fn part(shared: &S::Shared, pieces: &Pieces, piece: usize) -> impl Iterator<Item = Self::Item> {
        zip(pieces.range(piece), S::part(shared, pieces, piece))
    }
}

impl<S: Exact> Exact for Enumerate<S> {}

/// Two sources side by side, as far as the shorter.
pub struct Zip<A, B>(pub(super) A, pub(super) B);

impl<A: Exact, B: Exact> Source for Zip<A, B> {
    type Item = (A::Item, B::Item);
    type Shared = (A::Shared, B::Shared);

    #[inline(always)]
    fn count(&self) -> usize {
        self.0.count().min(self.1.count())
    }

    #[inline(always)]
    fn share(self, pieces: &Pieces) -> Self::Shared {
        (self.0.share(pieces), self.1.share(pieces))
    }

    #[inline(always)]
    fn part((a, b): &Self::Shared, pieces: &Pieces, piece: usize) -> impl Iterator<Item = Self::Item> {
        zip(A::part(a, pieces, piece), B::part(b, pieces, piece))
    }
}

impl<A: Exact, B: Exact> Exact for Zip<A, B> {}

/// A source of what a function makes of another one's items, by a method of iterators.
macro_rules! adapter {
    ($(#[$doc:meta])* $name:ident, $method:ident, [$($bound:tt)*] $result:ty => $item:ty) => {
        $(#[$doc])*
        pub struct $name<S, F>(pub(super) S, pub(super) F);

        impl<S: Source, T $($bound)*, F: Fn(S::Item) -> $result + Sync> Source for $name<S, F> {
            type Item = $item;
            type Shared = (S::Shared, F);

            #[inline(always)]
            fn count(&self) -> usize {
                self.0.count()
            }

            #[inline(always)]
            fn share(self, pieces: &Pieces) -> Self::Shared {
                (self.0.share(pieces), self.1)
            }

            #[inline(always)]
            fn part((shared, f): &Self::Shared, pieces: &Pieces, piece: usize) -> impl Iterator<Item = $item> {
                S::part(shared, pieces, piece).$method(move |item| f(item))
            }
        }
    };
}

adapter!(
    /// A function's results.
    Map, map, [] T => T
);
adapter!(
    /// A function's results but for `None`.
    FilterMap, filter_map, [] Option<T> => T
);
adapter!(
    /// The items of a function's results, one after the other.
    FlatMap, flat_map, [: IntoIterator] T => T::Item
);

impl<S: Exact, T, F: Fn(S::Item) -> T + Sync> Exact for Map<S, F> {}
