//! The first bytes of a file.

use std::io::Read;
use std::path::Path;

use super::access::Access;
use super::error::volume::{VolumeError, io_error};

/// The first bytes of a file.
pub(super) fn head(path: &Path, access: &Access) -> Result<Vec<u8>, VolumeError> {
    let mut head = Vec::new();
    access.open_to_look(path)?.reader.take(1024).read_to_end(&mut head).map_err(io_error(path))?;
    Ok(head)
}

/// Whether a file begins as DICOM files without the preamble of 128 bytes and "DICM" do: with an element of group 2 or 8, and its type
/// or an even length.
pub(super) fn is_bare_dicom(head: &[u8]) -> bool {
    let &[group @ (2 | 8), 0, 0..=0x70, 0, a, b, c, d, ..] = head else { return false };
    let has_type = a.is_ascii_uppercase() && b.is_ascii_uppercase();
    has_type || group == 8 && a % 2 == 0 && [b, c, d] == [0; 3]
}
