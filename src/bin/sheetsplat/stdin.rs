//! Standard input.

use std::io::Read;
use std::sync::OnceLock;

use sheetsplat::volume::Files;

/// The input's name that means standard input.
pub(crate) const NAME: &str = "-";

/// A volume file that standard input is, read whole at the first call. Beyond `limit` bytes, or where it cannot be read, a warning says why it is none.
pub(crate) fn file(limit: u64) -> Files {
    static FILE: OnceLock<Files> = OnceLock::new();
    let read = || {
        let mut bytes = Vec::new();
        let read = std::io::stdin().lock().take(limit.saturating_add(1)).read_to_end(&mut bytes);
        match read {
            Ok(length) if length as u64 <= limit => [(NAME, bytes)].into_iter().collect(),
            Ok(_) => {
                log::warn!("standard input: more than the memory limit of {limit} bytes");
                Files::default()
            }
            Err(error) => {
                log::warn!("standard input: {error}");
                Files::default()
            }
        }
    };
    FILE.get_or_init(read).clone()
}
