//! Sets of files: planes that a description places in other files.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use super::super::VolumeError;
use super::super::access::Access;
use super::super::error::volume::invalid;
use super::calibration::Calibration;
use super::stack::Runs;

/// The maximum number of names in an error.
const MAX_NAMES: usize = 8;

/// The other files of a set, which lie beside the file at `path`, with what their pages show.
///
/// # Errors
/// If some are missing.
pub(super) fn others<'a>(
    path: &Path,
    calibration: &'a Calibration,
    access: &Access,
) -> Result<Vec<(PathBuf, &'a Runs)>, VolumeError> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let (mut found, mut missing) = (Vec::new(), Vec::new());
    for (name, runs) in &calibration.others {
        let file = folder.join(name);
        match access.open(&file) {
            Ok(_) => found.push((file, runs)),
            Err(VolumeError::Io { source, .. }) if source.kind() == ErrorKind::NotFound => missing.push(name.as_str()),
            Err(error) => return Err(error),
        }
    }
    if missing.is_empty() {
        return Ok(found);
    }
    let more = if missing.len() > MAX_NAMES { ", …" } else { "" };
    let names = missing[..missing.len().min(MAX_NAMES)].join(", ");
    let shown = format!("planes in {} files that are missing: {names}{more}", missing.len());
    Err(invalid(path, "TiffData", shown, "all files of the set in one folder"))
}
