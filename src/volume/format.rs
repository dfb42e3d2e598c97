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

type Reader<T> = fn(&Path) -> Result<Loaded<T>, VolumeError>;

/// A format, and what reads it.
struct Format<T> {
    name: &'static str,
    /// What its files' names end with.
    extensions: &'static [&'static str],
    /// Whether a file that begins like this is surely of this format.
    is_magic: fn(&[u8]) -> bool,
    /// Or the feature that it is compiled with.
    read: Result<Reader<T>, &'static str>,
}

/// A module's `read`, or the feature that it is compiled with.
macro_rules! reader {
    ($feature:literal, $read:path) => {{
        #[cfg(feature = $feature)]
        let read: Result<Reader<_>, _> = Ok($read);
        #[cfg(not(feature = $feature))]
        let read = Err($feature);
        read
    }};
}

fn formats<T: Voxel>() -> Vec<Format<T>> {
    vec![
        Format {
            name: "NRRD",
            extensions: &[".nrrd", ".nhdr"],
            is_magic: |head| head.starts_with(b"NRRD000"),
            read: Ok(nrrd::read),
        },
        Format {
            name: "NIfTI",
            extensions: &[".nii", ".nii.gz", ".hdr", ".img", ".hdr.gz", ".img.gz"],
            is_magic: |head| {
                matches!(head.get(344..348), Some(b"n+1\0" | b"ni1\0"))
                    || matches!(head.get(4..8), Some(b"n+2\0" | b"ni2\0"))
            },
            read: reader!("nifti", super::nifti::read),
        },
        Format {
            name: "MetaImage",
            extensions: &[".mha", ".mhd"],
            is_magic: |head| head.starts_with(b"ObjectType = Image"),
            read: reader!("metaimage", super::metaimage::read),
        },
        Format {
            name: "NPY",
            extensions: &[".npy"],
            is_magic: |head| head.starts_with(b"\x93NUMPY"),
            read: reader!("npy", super::npy::read),
        },
    ]
}

/// Reads a file: of the format that its first bytes tell, else of the one that its name tells.
pub(super) fn read<T: Voxel>(path: &Path) -> Result<Loaded<T>, VolumeError> {
    let formats = formats();
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    let mut head = Vec::new();
    Source::open(path)?.reader.take(1024).read_to_end(&mut head).map_err(io_error(path))?;
    let is_named = |format: &&Format<T>| format.extensions.iter().any(|extension| name.ends_with(extension));
    let format = formats.iter().find(|format| (format.is_magic)(&head)).or_else(|| formats.iter().find(is_named));
    let found = match format {
        Some(Format { read: Ok(read), .. }) => return read(path),
        Some(Format { name, read: Err(feature), .. }) => format!("{name}, which needs the feature `{feature}`"),
        None => match path.extension() {
            Some(extension) => format!("\".{}\"", extension.display()),
            None => "none".to_owned(),
        },
    };
    let list = |compiled: bool| {
        let formats = formats.iter().filter(|format| format.read.is_ok() == compiled);
        formats
            .map(|format| format!("{} ({})", format.name, format.extensions.join(", ")))
            .collect::<Vec<_>>()
            .join(", ")
    };
    let mut allowed = format!("{}, or raw samples by `volume.dims` and `volume.type`", list(true));
    if formats.iter().any(|format| format.read.is_err()) {
        allowed = format!("{allowed}; not compiled in: {}", list(false));
    }
    Err(invalid(path, "format", found, allowed))
}
