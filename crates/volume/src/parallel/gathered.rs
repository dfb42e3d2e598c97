//! Collections of a loop's items.

use super::Loop;
use super::source::Source;

/// A collection of a loop's items, in the loop's order.
pub trait Gathered<T>: Sized {
    /// All items.
    fn gathered<S: Source<Item = T>>(all: Loop<S>) -> Self;
}

impl<T: Send> Gathered<T> for Vec<T> {
    fn gathered<S: Source<Item = T>>(all: Loop<S>) -> Self {
        joined(all.pieces(|part| part.items().collect()))
    }
}

/// The items, or the first failure.
impl<T: Send, E: Send> Gathered<Result<T, E>> for Result<Vec<T>, E> {
    fn gathered<S: Source<Item = Result<T, E>>>(all: Loop<S>) -> Self {
        let pieces = all.pieces(|part| part.items().collect::<Result<_, E>>());
        pieces.into_iter().collect::<Result<_, E>>().map(joined)
    }
}

/// The items, or `None` if one is.
impl<T: Send> Gathered<Option<T>> for Option<Vec<T>> {
    fn gathered<S: Source<Item = Option<T>>>(all: Loop<S>) -> Self {
        let pieces = all.pieces(|part| part.items().collect::<Option<_>>());
        pieces.into_iter().collect::<Option<_>>().map(joined)
    }
}

fn joined<T>(pieces: Vec<Vec<T>>) -> Vec<T> {
    let count: usize = pieces.iter().map(Vec::len).sum();
    let mut pieces = pieces.into_iter();
    let mut all = pieces.next().unwrap_or_default();
    all.reserve_exact(count - all.len());
    pieces.for_each(|piece| all.extend(piece));
    all
}
