//! Refusals of volume files, compared part by part.

use sheetsplat_volume::VolumeError;

/// Asserts that the message names the file, the field, what was found and what is allowed.
#[track_caller]
pub(crate) fn assert_refused<T: std::fmt::Debug>(
    result: Result<T, VolumeError>,
    file: &str,
    field: &str,
    found: &str,
    allowed: &str,
) {
    let error = result.expect_err("a volume");
    let message = error.to_string();
    let VolumeError::Invalid { origin, field: at, found: what, allowed: instead, .. } = error else {
        panic!("{message}")
    };
    assert!(origin.ends_with(file), "{message}");
    assert_eq!(at, field, "{message}");
    assert!(what.contains(found), "found {found:?}: {message}");
    assert!(instead.contains(allowed), "allowed {allowed:?}: {message}");
    for part in [origin, at, what, instead] {
        assert!(message.contains(&part), "{part}: {message}");
    }
}
