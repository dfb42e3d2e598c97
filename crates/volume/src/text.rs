//! Numbers and vectors in headers, and text from files as errors show it.

use glam::DVec3;

/// Text from a file, shortened and on one line.
pub(super) fn shown(text: &str) -> String {
    let short: String = text.chars().take(60).collect();
    format!("{short:?}{}", if short.len() < text.len() { "…" } else { "" })
}

pub(super) fn lower(text: &str) -> String {
    text.to_ascii_lowercase()
}

pub(super) fn three<T>(items: impl Iterator<Item = Option<T>>) -> Option<[T; 3]> {
    items.collect::<Option<Vec<T>>>()?.try_into().ok()
}

/// A finite number.
pub(super) fn number(text: &str) -> Option<f64> {
    text.trim().parse().ok().filter(|number: &f64| number.is_finite())
}

/// A vector `(x,y,z)`, with or without spaces around the numbers.
pub(super) fn vector(text: &str) -> Option<DVec3> {
    let components = text.trim().strip_prefix('(')?.strip_suffix(')')?;
    three(components.split(',').map(number)).map(DVec3::from_array)
}
