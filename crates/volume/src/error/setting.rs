//! The error for invalid settings: which setting, what was found, and what is allowed. Every settings type has a `check` that states its
//! ranges once; the scene reader, a view's setters and the f64 reference all call it.

use std::fmt;
use std::ops::{Bound, RangeBounds};

use glam::DVec3;

use crate::text::plain;

/// A setting with an invalid value.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{}: found {}, allowed: {}", plain(key), plain(&found.to_string()), plain(&allowed.to_string()))]
#[non_exhaustive]
pub struct SettingError {
    /// The scene file's key, with elements counted from 0 (`camera.up`, `transfer.opacity[2][1]`), or the name of a parameter that scene
    /// files do not have. The tables of labels have the label's number as their index: `transfer.label[7].opacity`.
    pub key: String,
    /// The value found.
    pub found: Found,
    /// The values that are allowed.
    pub allowed: Allowed,
}

impl SettingError {
    /// The error of a setting, given its key, what was found, and what is allowed.
    pub fn new(key: impl Into<String>, found: impl Into<Found>, allowed: impl Into<Allowed>) -> Self {
        Self { key: key.into(), found: found.into(), allowed: allowed.into() }
    }
}

/// The value that was found.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Found {
    /// A number.
    Number(f64),
    /// Several numbers, such as a vector's.
    Numbers(Vec<f64>),
    /// Anything else, in words.
    Text(String),
}

impl fmt::Display for Found {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(number) => f.write_str(&short(*number)),
            Self::Numbers(numbers) => {
                let numbers: Vec<String> = numbers.iter().copied().map(short).collect();
                write!(f, "[{}]", numbers.join(", "))
            }
            Self::Text(text) => f.write_str(text),
        }
    }
}

impl From<f64> for Found {
    fn from(number: f64) -> Self {
        Self::Number(number)
    }
}

impl From<&[f64]> for Found {
    fn from(numbers: &[f64]) -> Self {
        Self::Numbers(numbers.to_vec())
    }
}

impl From<DVec3> for Found {
    fn from(vector: DVec3) -> Self {
        Self::Numbers(vector.to_array().to_vec())
    }
}

impl From<&str> for Found {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<String> for Found {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

/// The values that are allowed.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Allowed {
    /// Numbers in an interval.
    Interval(Interval),
    /// Anything else, in words.
    Text(String),
}

impl fmt::Display for Allowed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Interval(interval) => interval.fmt(f),
            Self::Text(text) => f.write_str(text),
        }
    }
}

impl From<Interval> for Allowed {
    fn from(interval: Interval) -> Self {
        Self::Interval(interval)
    }
}

impl From<&str> for Allowed {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<String> for Allowed {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

/// The finite numbers between two bounds.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Interval {
    /// The lower bound.
    pub min: Bound<f64>,
    /// The upper bound.
    pub max: Bound<f64>,
    /// The noun for the numbers in messages: `a number`, `degrees`.
    noun: &'static str,
}

impl Interval {
    /// Any finite number.
    pub const FINITE: Self = Self::new(Bound::Unbounded, Bound::Unbounded);
    /// Numbers above 0.
    pub const POSITIVE: Self = Self::new(Bound::Excluded(0.0), Bound::Unbounded);
    /// Numbers from 0 on.
    pub const NOT_NEGATIVE: Self = Self::new(Bound::Included(0.0), Bound::Unbounded);
    /// The range of opacities and colours.
    pub const SHARE: Self = Self::new(Bound::Included(0.0), Bound::Included(1.0));
    /// The range of opacity thresholds.
    pub const THRESHOLD: Self = Self::new(Bound::Excluded(0.0), Bound::Included(1.0));

    /// The numbers between two bounds.
    pub const fn new(min: Bound<f64>, max: Bound<f64>) -> Self {
        Self { min, max, noun: "a number" }
    }

    /// The same range with another noun.
    pub const fn of(self, noun: &'static str) -> Self {
        Self { noun, ..self }
    }

    /// Whether a number lies in the range; NaN and infinite numbers never do.
    pub fn contains(&self, number: f64) -> bool {
        number.is_finite() && (self.min, self.max).contains(&number)
    }

    /// Checks the number under a key.
    pub fn check(self, key: &str, number: f64) -> Result<(), SettingError> {
        if self.contains(number) { Ok(()) } else { Err(SettingError::new(key, number, self)) }
    }

    /// Checks the number under a key, if it is present.
    pub fn check_given(self, key: &str, number: Option<f64>) -> Result<(), SettingError> {
        number.map_or(Ok(()), |number| self.check(key, number))
    }

    /// Checks each number in the array under a key.
    pub fn check_each(self, key: &str, numbers: &[f64]) -> Result<(), SettingError> {
        match numbers.iter().position(|&number| !self.contains(number)) {
            Some(at) => Err(SettingError::new(format!("{key}[{at}]"), numbers[at], self)),
            None => Ok(()),
        }
    }
}

impl fmt::Display for Interval {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let noun = self.noun;
        match (self.min, self.max) {
            (Bound::Unbounded, Bound::Unbounded) => write!(f, "a finite number"),
            (Bound::Included(min), Bound::Unbounded) => write!(f, "a finite number >= {}", brief(min)),
            (Bound::Excluded(min), Bound::Unbounded) => write!(f, "a finite number > {}", brief(min)),
            (Bound::Unbounded, Bound::Included(max)) => write!(f, "a finite number <= {}", brief(max)),
            (Bound::Unbounded, Bound::Excluded(max)) => write!(f, "a finite number < {}", brief(max)),
            (Bound::Included(min), Bound::Included(max)) => write!(f, "{noun} in [{}, {}]", brief(min), brief(max)),
            (Bound::Included(min), Bound::Excluded(max)) => write!(f, "{noun} in [{}, {})", brief(min), brief(max)),
            (Bound::Excluded(min), Bound::Included(max)) => write!(f, "{noun} in ({}, {}]", brief(min), brief(max)),
            (Bound::Excluded(min), Bound::Excluded(max)) => write!(f, "{noun} in ({}, {})", brief(min), brief(max)),
        }
    }
}

/// A bound, rounded to two digits if it has many.
fn brief(bound: f64) -> String {
    const LONGEST: usize = 8;
    let text = short(bound);
    if text.len() <= LONGEST { text } else { format!("{bound:.1e}") }
}

/// A number in its shortest usual notation.
fn short(number: f64) -> String {
    let text = format!("{number:?}");
    match text.strip_suffix(".0") {
        Some(integer) => integer.to_owned(),
        None => text,
    }
}

/// Checks a vector of which only the direction matters.
pub fn check_direction(key: &str, vector: DVec3) -> Result<(), SettingError> {
    Interval::FINITE.check_each(key, &vector.to_array())?;
    if vector == DVec3::ZERO {
        return Err(SettingError::new(key, vector, "a vector other than [0, 0, 0]"));
    }
    Ok(())
}

/// A vector of the same direction, scaled if necessary so that its squared length, and that of a product of two such vectors, is in the
/// range of `f64`.
pub fn scaled(vector: DVec3) -> DVec3 {
    let largest = vector.abs().max_element();
    if (1e-60..1e60).contains(&largest) { vector } else { vector / largest }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_hold_finite_numbers_between_their_bounds() {
        for (range, inside, outside, text) in [
            (Interval::FINITE, vec![-1e300, 0.0, 1e300], vec![], "a finite number"),
            (Interval::POSITIVE, vec![5e-324, 1e300], vec![0.0, -1.0], "a finite number > 0"),
            (Interval::NOT_NEGATIVE, vec![0.0, 1e300], vec![-5e-324], "a finite number >= 0"),
            (Interval::SHARE, vec![0.0, 1.0], vec![-0.1, 1.1], "a number in [0, 1]"),
            (Interval::THRESHOLD, vec![0.1, 1.0], vec![0.0, 1.1], "a number in (0, 1]"),
        ] {
            assert_eq!(range.to_string(), text);
            inside.iter().for_each(|&x| assert!(range.contains(x), "{x} is {text}"));
            let never = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
            outside.iter().chain(&never).for_each(|&x| assert!(!range.contains(x), "{x} is not {text}"));
        }
    }

    #[test]
    fn messages_name_key_found_and_allowed() {
        let error = Interval::SHARE.check_each("image.background", &[0.0, f64::NAN]).expect_err("NaN is no share");
        assert_eq!(error.to_string(), "image.background[1]: found NaN, allowed: a number in [0, 1]");
        let error = check_direction("camera.up", DVec3::ZERO).expect_err("it has no direction");
        assert_eq!(error.to_string(), "camera.up: found [0, 0, 0], allowed: a vector other than [0, 0, 0]");
        let range = Interval::new(Bound::Included(1e-100), Bound::Excluded(0.05));
        assert_eq!(range.of("degrees").to_string(), "degrees in [1e-100, 0.05)");
        let range = Interval::new(Bound::Included(5.119_999e-23), Bound::Unbounded);
        assert_eq!(range.to_string(), "a finite number >= 5.1e-23");
    }
}
