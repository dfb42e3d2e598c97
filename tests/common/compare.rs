//! Comparisons that fail on NaN. `f64::max` and `DVec4::max_element` ignore NaN, and `if measured < required` is false for it, so a test that
//! folds or branches by hand would accept an image of only NaN. All tests compare through these functions: they assert that all numbers
//! are finite and that a bound holds.
//!
//! With `SHEETSPLAT_MARGINS=FILE` each comparison appends a line to the file whenever it comes closer to its bound than before: its place, the
//! measurement, and the bound. This shows which bounds are more than 6 dB from the measurement.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::fs::OpenOptions;
use std::io::Write;
use std::panic::Location;
use std::sync::{LazyLock, Mutex};

use glam::DVec4;

/// Asserts that a measurement, such as a PSNR, is not below a minimum. Equal images measure infinity.
#[track_caller]
pub(crate) fn assert_at_least(measured: f64, required: f64, what: impl Display) {
    assert!(required.is_finite(), "nothing is compared with {required}: {what}");
    record(measured, required, measured - required);
    assert!(measured >= required, "{measured}, not at least {required}: {what}");
}

/// Asserts that a measurement, such as the largest difference, is not above a maximum.
#[track_caller]
pub(crate) fn assert_at_most(measured: f64, allowed: f64, what: impl Display) {
    assert!(measured.is_finite() && allowed.is_finite(), "{measured} and {allowed} are not comparable: {what}");
    record(measured, allowed, -measured / allowed.max(f64::MIN_POSITIVE));
    assert!(measured <= allowed, "{measured}, not at most {allowed}: {what}");
}

/// The largest absolute value of some errors, all of which must be finite.
#[track_caller]
pub(crate) fn largest(errors: impl IntoIterator<Item = f64>) -> f64 {
    let mut largest = 0.0;
    for error in errors {
        assert!(error.is_finite(), "an error of {error}");
        largest = f64::max(largest, error.abs());
    }
    largest
}

/// The root mean square of some errors, all of which must be finite; there must be at least one.
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

/// The decibels of a root mean square of colours up to 1.
pub(crate) fn decibels(root_mean_square: f64) -> f64 {
    -20.0 * root_mean_square.log10()
}

/// The largest difference in any channel of two pixels, all of which must be finite.
#[track_caller]
pub(crate) fn apart(actual: DVec4, expected: DVec4) -> f64 {
    largest((actual - expected).to_array())
}

/// Appends a measurement to the file of `SHEETSPLAT_MARGINS` if its margin is the smallest so far at the caller's line.
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
