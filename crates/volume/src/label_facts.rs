//! What has been found out about values that may be labels, which takes a look at all of them.

use std::sync::{Arc, OnceLock};

/// Shared by a volume's clones, whose values are the same.
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

    /// Whether they lie in regions with sharp borders. `look` looks at the first call.
    pub fn has_sharp_borders(&self, look: impl FnOnce() -> bool) -> bool {
        *known(&self.0.has_sharp_borders, look)
    }
}

/// A fact, found out if it is not known. No thread waits for another's, because one that looks by a pool of threads may be given the task that waits for it.
fn known<T>(fact: &OnceLock<T>, find: impl FnOnce() -> T) -> &T {
    fact.get().unwrap_or_else(|| {
        let found = find();
        fact.get_or_init(|| found)
    })
}
