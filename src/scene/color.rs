//! Colours in scene files: numbers, or the words of CSS.

use color::{Srgb, parse_color};
use glam::DVec3;

use super::SceneError;
use super::reader::Entry;
use crate::error::setting::Interval;

/// Red, green and blue in [0, 1], or an opaque colour of CSS.
pub(super) fn rgb(entry: &Entry<'_>) -> Result<DVec3, SceneError> {
    let allowed = "3 numbers, each a number in [0, 1], or an opaque CSS colour as \"tomato\" or \"#ff6347\"";
    match entry.value.as_str() {
        None => entry.numbers_or(Interval::SHARE, allowed).map(DVec3::from_array),
        Some(text) => match css(text) {
            Some([red, green, blue, 1.0]) => Ok(DVec3::new(red, green, blue)),
            _ => Err(entry.refused(allowed)),
        },
    }
}

/// Straight-alpha red, green, blue and A in [0, 1], or a colour of CSS.
pub(super) fn rgba(entry: &Entry<'_>) -> Result<[f64; 4], SceneError> {
    let allowed = "4 numbers, each a number in [0, 1], or a CSS colour as \"white\", \"#fff\" or \"transparent\"";
    match entry.value.as_str() {
        None => entry.numbers_or(Interval::SHARE, allowed),
        Some(text) => css(text).ok_or_else(|| entry.refused(allowed)),
    }
}

/// A colour of CSS that sRGB holds.
fn css(text: &str) -> Option<[f64; 4]> {
    let components = parse_color(text).ok()?.to_alpha_color::<Srgb>().components.map(f64::from);
    components.iter().all(|component| (0.0..=1.0).contains(component)).then_some(components)
}
