//! Comparisons that NaN fails. `f64::max` and `DVec4::max_element` ignore NaN, and `if measured < required` is false for it, so a test
//! that folds or branches by hand passes an image of nothing but NaN. Every comparison of tests goes through these functions instead:
//! they assert that all they are given is finite, and that a bound is kept.
//!
//! With `SHEETSPLAT_MARGINS=FILE` each comparison appends a line to the file whenever it comes closer to its bound than before: where it
//! stands, what was measured, and the bound. That is how the bounds are kept within 6 dB of what is measured.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::fs::OpenOptions;
use std::io::Write;
use std::panic::Location;
use std::sync::{LazyLock, Mutex};

use glam::DVec4;

/// Asserts that a measured value, such as a PSNR, is not below what is required. Infinity is what equal images measure.
#[track_caller]
pub(crate) fn assert_at_least(measured: f64, required: f64, what: impl Display) {
    assert!(required.is_finite(), "nothing is compared with {required}: {what}");
    record(measured, required, measured - required);
    assert!(measured >= required, "{measured}, not at least {required}: {what}");
}

/// Asserts that a measured value, such as the largest difference, is not above what is allowed.
#[track_caller]
pub(crate) fn assert_at_most(measured: f64, allowed: f64, what: impl Display) {
    assert!(measured.is_finite() && allowed.is_finite(), "{measured} and {allowed} are not comparable: {what}");
    record(measured, allowed, -measured / allowed.max(f64::MIN_POSITIVE));
    assert!(measured <= allowed, "{measured}, not at most {allowed}: {what}");
}

/// The largest absolute value of some errors, all of them finite.
#[track_caller]
pub(crate) fn largest(errors: impl IntoIterator<Item = f64>) -> f64 {
    let mut largest = 0.0;
    for error in errors {
        assert!(error.is_finite(), "an error of {error}");
        largest = f64::max(largest, error.abs());
    }
    largest
}

/// The root of the mean square of some errors, all of them finite and at least one.
#[track_caller]
pub(crate) fn root_mean_square(errors: impl IntoIterator<Item = f64>) -> f64 {
    let (mut squares, mut count) = (0.0, 0.0);
    for error in errors {
        assert!(error.is_finite(), "an error of {error}");
        (squares, count) = (squares + error * error, count + 1.0);
    }
    assert!(count > 0.0, "nothing to compare");
    f64::sqrt(squares / count)
}

/// A root mean square of colours up to 1 in decibels.
pub(crate) fn decibels(root_mean_square: f64) -> f64 {
    -20.0 * root_mean_square.log10()
}

/// The largest difference of any channel of two pixels, all of them finite.
#[track_caller]
pub(crate) fn apart(actual: DVec4, expected: DVec4) -> f64 {
    largest((actual - expected).to_array())
}

/// Appends to the file of `SHEETSPLAT_MARGINS` what was measured, if the margin is the smallest so far at the caller's line.
#[track_caller]
fn record(measured: f64, bound: f64, margin: f64) {
    type Smallest = Mutex<BTreeMap<(&'static str, u32), f64>>;
    static FILE: LazyLock<Option<std::ffi::OsString>> = LazyLock::new(|| std::env::var_os("SHEETSPLAT_MARGINS"));
    static SMALLEST: Smallest = Mutex::new(BTreeMap::new());
    let Some(path) = &*FILE else { return };
    let at = Location::caller();
    let mut smallest = SMALLEST.lock().unwrap();
    let smallest = smallest.entry((at.file(), at.line())).or_insert(f64::INFINITY);
    if margin < *smallest || margin.is_nan() {
        *smallest = margin;
        let line = format!("{}:{}\t{measured:.6e}\t{bound:.6e}\n", at.file(), at.line());
        let mut file = OpenOptions::new().create(true).append(true).open(path).unwrap();
        file.write_all(line.as_bytes()).unwrap();
    }
}
