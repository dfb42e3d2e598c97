//! Facts about values that may be labels. Each takes a look at all values, so that a volume keeps it.

use std::sync::{Arc, OnceLock};

/// The facts that are known of a volume. Its clones share them, since their values are the same.
#[derive(Clone, Debug, Default)]
pub struct LabelFacts(Arc<Found>);

#[derive(Debug, Default)]
struct Found {
    counts: OnceLock<Option<Vec<(u16, u64)>>>,
    has_sharp_borders: OnceLock<bool>,
}

impl LabelFacts {
    /// The values, ascending, each with its number of voxels; `None` if some are no labels. `count` counts them at the first call.
    pub fn counts(&self, count: impl FnOnce() -> Option<Vec<(u16, u64)>>) -> Option<&[(u16, u64)]> {
        known(&self.0.counts, count).as_deref()
    }

    /// Whether the labels lie in regions with sharp borders. `look` finds out at the first call.
    pub fn has_sharp_borders(&self, look: impl FnOnce() -> bool) -> bool {
        *known(&self.0.has_sharp_borders, look)
    }
}

/// A fact, found out if it is not known. No thread waits for another: a thread that looks with the help of a pool may be given the very task that waits.
fn known<T>(fact: &OnceLock<T>, find: impl FnOnce() -> T) -> &T {
    fact.get().unwrap_or_else(|| {
        let found = find();
        fact.get_or_init(|| found)
    })
}
