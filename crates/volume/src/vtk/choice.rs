//! The choice among several arrays.

use std::path::Path;

/// Warns which one of several arrays is used.
pub(super) fn warn_of_choice<'a>(path: &Path, names: impl Iterator<Item = &'a str>, taken: &str) {
    let names: Vec<&str> = names.collect();
    if names.len() > 1 {
        log::warn!("{}: of the arrays {} the volume is {taken}", path.display(), names.join(", "));
    }
}
