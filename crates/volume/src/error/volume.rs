//! Errors of volumes, which are loaded before anything is drawn, or while it is.

use std::fmt::Display;
use std::io;
use std::path::{Path, PathBuf};

use super::setting::SettingError;
use crate::text::{plain, without_passwords};

/// Why a volume could not be loaded. Every message names the file (or builtin), the field, what was found and what is allowed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum VolumeError {
    /// The file could not be opened or read.
    #[error("{}: {source}", plain(&path.to_string_lossy()))]
    #[non_exhaustive]
    Io {
        /// The file.
        path: PathBuf,
        /// The operating system's error.
        source: std::io::Error,
    },
    /// A header field, or the data it promises, is invalid.
    #[error("{}: {}: found {}, allowed: {}", plain(origin), plain(field), plain(found), plain(allowed))]
    #[non_exhaustive]
    Invalid {
        /// The file, or `builtin:NAME`.
        origin: String,
        /// The header field or the part of the file (`sizes`, `space directions`, `data`).
        field: String,
        /// The value found there.
        found: String,
        /// The values that are allowed there.
        allowed: String,
    },
}

impl VolumeError {
    /// The error of a file that could not be read, for [`Store`](crate::Store)s of other programs.
    pub fn io(path: impl Into<PathBuf>, source: std::io::Error) -> Self {
        Self::Io { path: shown(path.into()), source }
    }

    /// `Ok` with the file and the system's error, or `Err` with the origin, the field, what was found and what is allowed.
    #[doc(hidden)]
    pub fn into_parts(self) -> Result<(PathBuf, std::io::Error), [String; 4]> {
        match self {
            Self::Io { path, source } => Ok((path, source)),
            Self::Invalid { origin, field, found, allowed } => Err([origin, field, found, allowed]),
        }
    }

    /// The error of an invalid field, for [`Store`](crate::Store)s of other programs.
    pub fn invalid(
        origin: impl Into<String>,
        field: impl Into<String>,
        found: impl Into<String>,
        allowed: impl Into<String>,
    ) -> Self {
        invalid_of([origin.into(), field.into(), found.into(), allowed.into()])
    }
}

/// [`VolumeError::invalid`], compiled once for all kinds of text.
#[cold]
#[inline(never)]
fn invalid_of([origin, field, found, allowed]: [String; 4]) -> VolumeError {
    let [origin, found] = [origin, found].map(|text| without_passwords(&text).into_owned());
    VolumeError::Invalid { origin, field, found, allowed }
}

/// A path as errors tell it: an address without its password.
fn shown(path: PathBuf) -> PathBuf {
    path.to_str().map(|text| without_passwords(text).into_owned().into()).unwrap_or(path)
}

/// The error for an invalid field of a file.
pub(crate) fn invalid(path: &Path, field: &str, found: impl Display, allowed: impl Display) -> VolumeError {
    VolumeError::invalid(path.display().to_string(), field, found.to_string(), allowed.to_string())
}

/// The error for an invalid grid.
pub(crate) fn refused(origin: &str, error: SettingError) -> VolumeError {
    VolumeError::invalid(origin, &error.key, error.found.to_string(), error.allowed.to_string())
}

/// Makes the error of a file that could not be read.
pub(crate) fn io_error(path: &Path) -> impl Fn(io::Error) -> VolumeError {
    move |source| VolumeError::io(path, source)
}
