//! Loops, whose pieces run on every core.

use std::iter::Sum;
use std::sync::{Mutex, PoisonError};

use super::source::{Enumerate, Exact, FilterMap, FlatMap, IS_ONE, Map, Pieces, Source, Zip};
use super::{Gathered, IntoLoop, SliceMut as _, current_num_threads, threads};

/// The pieces of a loop for each thread: a thread whose pieces took less time than others' takes over some of theirs.
const PIECES_PER_THREAD: usize = 8;

/// A loop over items, with rayon's names.
pub struct Loop<S> {
    source: S,
    /// The least number of items in a piece, unless that is more than `most`.
    least: usize,
    /// The greatest number of items in a piece.
    most: usize,
}

impl<S: Source> Loop<S> {
    pub(super) fn new(source: S) -> Self {
        Self { source, least: 1, most: usize::MAX }
    }

    fn over<T>(self, of: impl FnOnce(S) -> T) -> Loop<T> {
        Loop { source: of(self.source), least: self.least, most: self.most }
    }

    /// Sets the least number of items in a piece, where fewer would not be worth a thread.
    #[must_use]
    pub fn with_min_len(self, least: usize) -> Self {
        Self { least, ..self }
    }

    /// Sets the greatest number of items in a piece, where each item takes long.
    #[must_use]
    pub fn with_max_len(self, most: usize) -> Self {
        Self { most, ..self }
    }

    /// A function's results.
    pub fn map<T, F: Fn(S::Item) -> T>(self, f: F) -> Loop<Map<S, F>> {
        self.over(|source| Map(source, f))
    }

    /// The items for which a function holds.
    pub fn filter(self, f: impl Fn(&S::Item) -> bool + Sync) -> Loop<impl Source<Item = S::Item>> {
        self.filter_map(move |item| f(&item).then_some(item))
    }

    /// The items of a function's results, one after the other.
    pub fn flat_map_iter<T: IntoIterator, F: Fn(S::Item) -> T>(self, f: F) -> Loop<FlatMap<S, F>> {
        self.over(|source| FlatMap(source, f))
    }

    /// A function's results but for `None`.
    pub fn filter_map<T, F: Fn(S::Item) -> Option<T>>(self, f: F) -> Loop<FilterMap<S, F>> {
        self.over(|source| FilterMap(source, f))
    }

    /// Items with their numbers from 0 on.
    pub fn enumerate(self) -> Loop<Enumerate<S>>
    where
        S: Exact,
    {
        self.over(Enumerate)
    }

    /// Pairs with another loop's items, as far as the shorter one goes.
    pub fn zip<T: IntoLoop>(self, other: T) -> Loop<Zip<S, T::Source>>
    where
        S: Exact,
    {
        let other = other.into_par_iter();
        let (least, most) = (self.least.max(other.least), self.most.min(other.most));
        Loop { source: Zip(self.source, other.source), least, most }
    }

    /// Calls a function for every item.
    pub fn for_each(self, f: impl Fn(S::Item) + Sync) {
        self.pieces(|part| part.items().for_each(|item| f(item)));
    }

    /// Calls a function for every item with a value that the calls of a piece share.
    pub fn for_each_init<T>(self, init: impl Fn() -> T + Sync, f: impl Fn(&mut T, S::Item) + Sync) {
        self.pieces(|part| {
            let mut state = init();
            part.items().for_each(|item| f(&mut state, item));
        });
    }

    /// Each piece's items joined into one value, in order.
    pub fn fold<T: Send>(self, start: impl Fn() -> T + Sync, f: impl Fn(T, S::Item) -> T + Sync) -> Loop<Vec<T>> {
        let folded = self.pieces(|part| part.items().fold(start(), |all, item| f(all, item)));
        Loop::new(folded).with_min_len(usize::MAX)
    }

    /// All items joined into one.
    pub fn reduce(self, start: impl Fn() -> S::Item + Sync, f: impl Fn(S::Item, S::Item) -> S::Item + Sync) -> S::Item
    where
        S::Item: Send,
    {
        self.pieces(|part| part.items().fold(start(), |all, item| f(all, item)))
            .into_iter()
            .reduce(&f)
            .unwrap_or_else(start)
    }

    /// All items joined into one; `None` for a loop without items.
    pub fn reduce_with(self, f: impl Fn(S::Item, S::Item) -> S::Item + Sync) -> Option<S::Item>
    where
        S::Item: Send,
    {
        self.pieces(|part| part.items().reduce(|all, item| f(all, item))).into_iter().flatten().reduce(&f)
    }

    /// The sum of all items.
    pub fn sum<T: Sum<S::Item> + Sum<T> + Send>(self) -> T {
        self.pieces(|part| part.items().sum::<T>()).into_iter().sum()
    }

    /// The least item; `None` for a loop without items.
    pub fn min(self) -> Option<S::Item>
    where
        S::Item: Ord + Send,
    {
        self.reduce_with(Ord::min)
    }

    /// How many items there are.
    pub fn count(self) -> usize {
        self.pieces(|part| part.items().count()).into_iter().sum()
    }

    /// Whether a function holds for every item.
    pub fn all(self, f: impl Fn(S::Item) -> bool + Sync) -> bool {
        self.pieces(|part| part.items().all(|item| f(item))).into_iter().all(|all| all)
    }

    /// Whether a function holds for some item.
    pub fn any(self, f: impl Fn(S::Item) -> bool + Sync) -> bool {
        self.pieces(|part| part.items().any(|item| f(item))).into_iter().any(|any| any)
    }

    /// All items in order, or the first failure.
    pub fn collect<C: Gathered<S::Item>>(self) -> C
    where
        S::Item: Send,
    {
        C::gathered(self)
    }

    /// All items in order, which pieces write into one allocation: without the copies of [`Loop::collect`], for numbers by the million.
    pub fn numbers(self) -> Vec<S::Item>
    where
        S: Exact,
        S::Item: Copy + Default + Send,
    {
        let mut numbers = vec![S::Item::default(); self.source.count()];
        numbers.par_iter_mut().zip(self).for_each(|(to, number)| *to = number);
        numbers
    }

    /// What a function makes of every piece, in order.
    pub(super) fn pieces<R: Send>(self, of: impl Fn(Part<'_, S>) -> R + Sync) -> Vec<R> {
        let Self { source, least, most } = self;
        let (items, threads) = (source.count(), current_num_threads());
        let count = (PIECES_PER_THREAD * threads).min(items / least.max(1)).max(items.div_ceil(most));
        let pieces = &Pieces { items, count: if threads == 1 { 1 } else { count.max(1) } };
        let shared = &source.share(pieces);
        if IS_ONE {
            // A call through a table would only take bytes.
            return vec![of(Part { shared, pieces, piece: 0 })];
        }
        results(pieces.count, &|piece| of(Part { shared, pieces, piece }))
    }
}

/// A piece of a loop.
pub(super) struct Part<'a, S: Source> {
    shared: &'a S::Shared,
    pieces: &'a Pieces,
    piece: usize,
}

impl<'a, S: Source> Part<'a, S> {
    #[inline(always)]
    pub(super) fn items(self) -> impl Iterator<Item = S::Item> {
        S::part(self.shared, self.pieces, self.piece)
    }
}

/// A function's results for all numbers below `count`, in order. It is compiled once for each type of results, not for each loop.
fn results<R: Send>(count: usize, of: &(dyn Fn(usize) -> R + Sync)) -> Vec<R> {
    if count == 1 {
        return vec![of(0)];
    }
    let slots: Vec<Mutex<Option<R>>> = (0..count).map(|_| Mutex::default()).collect();
    threads::run(count, &|number| {
        let result = of(number);
        *slots[number].lock().unwrap_or_else(PoisonError::into_inner) = Some(result);
    });
    slots.into_iter().filter_map(|slot| slot.into_inner().unwrap_or_else(PoisonError::into_inner)).collect()
}

impl<'a, T: Copy + Send + Sync + 'a, S: Source<Item = &'a T>> Loop<S> {
    /// Copies of the items.
    pub fn copied(self) -> Loop<impl Source<Item = T>> {
        self.map(|item| *item)
    }
}
