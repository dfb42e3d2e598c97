//! File formats: which one a file is of, and what every reader gives.

use std::io::Read;
use std::path::Path;

use glam::{DVec3, UVec3};

use super::samples::Voxel;
use super::source::{Source, invalid, io_error};
use super::{Orientation, VolumeError, nrrd};

/// What is in a file of values or of labels.
pub(super) struct Loaded<T> {
    pub(super) dims: UVec3,
    /// If the file gives one.
    pub(super) spacing: Option<DVec3>,
    /// If the file gives one.
    pub(super) orientation: Option<Orientation>,
    /// X fastest, as many as there are voxels.
    pub(super) values: Vec<T>,
}

/// A format, and what reads it.
struct Format<T> {
    name: &'static str,
    /// What its files' names end with.
    extensions: &'static [&'static str],
    /// Whether a file that begins like this is surely of this format.
    is_magic: fn(&[u8]) -> bool,
    read: fn(&Path) -> Result<Loaded<T>, VolumeError>,
}

fn formats<T: Voxel>() -> Vec<Format<T>> {
    vec![Format {
        name: "NRRD",
        extensions: &[".nrrd", ".nhdr"],
        is_magic: |head| head.starts_with(b"NRRD000"),
        read: nrrd::read,
    }]
}

/// Reads a file: of the format that its first bytes tell, else of the one that its name tells.
pub(super) fn read<T: Voxel>(path: &Path) -> Result<Loaded<T>, VolumeError> {
    let formats = formats();
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    let mut head = Vec::new();
    Source::open(path)?.reader.take(1024).read_to_end(&mut head).map_err(io_error(path))?;
    let is_named = |format: &&Format<T>| format.extensions.iter().any(|extension| name.ends_with(extension));
    match formats.iter().find(|format| (format.is_magic)(&head)).or_else(|| formats.iter().find(is_named)) {
        Some(format) => (format.read)(path),
        None => {
            let known = formats.iter().map(|format| format!("{} ({})", format.name, format.extensions.join(", ")));
            let extension = path.extension().map_or("none".into(), |extension| format!(".{}", extension.display()));
            Err(invalid(path, "format", format!("{extension:?}"), known.collect::<Vec<_>>().join(", ")))
        }
    }
}
