//! Names of slices, which must form one run of numbers.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::super::VolumeError;
use super::super::error::volume::invalid;
use super::super::folder::{Part, natural};

/// Stands for a number; displayed as `#`, which names may contain.
const NUMBER: &str = "/";

/// Refuses names that are not one run of numbers, and warns about gaps in it.
pub(super) fn check(folder: &Path, files: &[PathBuf]) -> Result<(), VolumeError> {
    let names: Vec<String> =
        files.iter().map(|path| path.file_name().unwrap_or_default().to_string_lossy().into_owned()).collect();
    let refused = |found: String| {
        invalid(folder, "slices", found, "names that differ in one number, as slice-001.tif and slice-002.tif")
    };
    let patterns = count_by(names.iter().map(|name| pattern(name)));
    if patterns.len() > 1 {
        let listed = patterns.iter().take(8).map(|(pattern, count)| format!("{count} of {}", shown(pattern)));
        return Err(refused(listed.collect::<Vec<_>>().join(", ")));
    }
    let numbers: Vec<Vec<u64>> = names.iter().map(|name| numbers(name)).collect();
    let columns = numbers.first().map_or(0, Vec::len);
    let column = |at: usize| numbers.iter().map(move |row| row[at]);
    // Names are sorted by the first number that changes. Wherever it stays constant, a second one changes.
    let Some(run) = (0..columns).find(|&at| column(at).any(|number| number != numbers[0][at])) else { return Ok(()) };
    let mut steps: Vec<u64> = column(run).zip(column(run).skip(1)).map(|(one, next)| next - one).collect();
    if steps.contains(&0) {
        return Err(refused(format!("more than one number that changes in {}", shown(&pattern(&names[0])))));
    }
    steps.sort_unstable();
    steps.dedup();
    if steps.len() > 1 {
        let folder = folder.display();
        log::warn!("{folder}: the slices' numbers go up by {steps:?}: they are treated as neighbours");
    }
    Ok(())
}

/// A name with `NUMBER` in place of every number.
fn pattern(name: &str) -> String {
    let parts = natural(name);
    let text = parts[..parts.len() - 1].iter().map(|part| match part {
        Part::Number(..) => NUMBER,
        Part::Text(text) => text,
    });
    text.collect()
}

fn shown(pattern: &str) -> String {
    pattern.replace(NUMBER, "#")
}

/// The numbers in a name, saturated to the maximum.
fn numbers(name: &str) -> Vec<u64> {
    let numbers = natural(name).into_iter().filter_map(|part| match part {
        Part::Number(_, digits) if digits.is_empty() => Some(0),
        Part::Number(_, digits) => Some(digits.parse().unwrap_or(u64::MAX)),
        Part::Text(_) => None,
    });
    numbers.collect()
}

/// The number of occurrences of each item.
fn count_by(items: impl Iterator<Item = String>) -> BTreeMap<String, usize> {
    let mut counts = BTreeMap::new();
    for item in items {
        *counts.entry(item).or_default() += 1;
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_patterns_and_numbers() {
        assert_eq!(shown(&pattern("a10b001.tif")), "a#b#.tif");
        assert_ne!(pattern("a5#.tif"), pattern("a#1.tif"));
        assert_eq!(numbers("a10b001.tif99999999999999999999"), [10, 1, u64::MAX]);
    }
}
