//! Standard output.

use std::io::Write;

use crate::failure::Failure;

/// Writes a result to standard output.
pub(crate) fn stdout(bytes: &[u8]) -> Result<(), Failure> {
    let mut stdout = std::io::stdout().lock();
    let written = stdout.write_all(bytes).and_then(|()| stdout.flush());
    written.map_err(|error| Failure::Other(format!("standard output: {error}")))
}
