//! The one place at which panics of decoders become errors.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use super::error::volume::{VolumeError, invalid};

/// Runs a reader of the file at `path`. Other crates decode much of what readers read, and some panic at files that they do not expect.
///
/// # Errors
/// The reader's errors, and one with the words of a panic.
pub(super) fn guarded<T>(path: &Path, run: impl FnOnce() -> Result<T, VolumeError>) -> Result<T, VolumeError> {
    // The reader's state is gone with the panic.
    catch_unwind(AssertUnwindSafe(run)).unwrap_or_else(|panic| {
        let found = format!("a decoder that gave up: {}", words(panic.as_ref()));
        Err(invalid(path, "data", found, "data that the decoder of the format can read"))
    })
}

fn words(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "a panic without words".to_owned())
}

#[cfg(test)]
#[expect(clippy::panic, reason = "the test is about panics")]
mod tests {
    use super::*;

    #[test]
    fn panics_are_errors() {
        assert_eq!(guarded(Path::new("a.tif"), || Ok(7)).ok(), Some(7));
        let number = 3;
        let errors: [Result<(), VolumeError>; 2] = [
            guarded(Path::new("a.tif"), || panic!("no strip")),
            guarded(Path::new("a.tif"), || panic!("no strip {number}")),
        ];
        for (error, words) in errors.into_iter().zip(["no strip", "no strip 3"]) {
            let message = error.err().map(|error| error.to_string()).unwrap_or_default();
            assert!(
                message.contains("a.tif: data: found a decoder that gave up: ") && message.contains(words),
                "{message}"
            );
        }
    }
}
