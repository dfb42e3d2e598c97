//! Why a scene could not be read.

use std::path::PathBuf;

use sheetsplat_volume::internals::{plain, plain_lines};

use crate::error::setting::Allowed;
use crate::volume::VolumeError;

/// Why a scene could not be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// The scene file could not be opened or read.
    #[error("{}: {source}", plain(&path.to_string_lossy()))]
    #[non_exhaustive]
    Io {
        /// The scene file.
        path: PathBuf,
        /// The operating system's error.
        source: std::io::Error,
    },
    /// The scene file is not TOML.
    #[error("{}: {}", plain(origin), plain_lines(message))]
    #[non_exhaustive]
    Syntax {
        /// The scene file.
        origin: String,
        /// What is wrong, with line and column.
        message: String,
    },
    /// A key is unknown or missing, or its value has the wrong type or is out of range.
    #[error("{}: {}: found {}, allowed: {}", plain(origin), plain(key), plain(found), plain(&allowed.to_string()))]
    #[non_exhaustive]
    Invalid {
        /// The scene file, or `--set` if the value came from an override.
        origin: String,
        /// The full key, with elements counted from 0: `camera.up`, `transfer.opacity[2]`.
        key: String,
        /// What was found, as written.
        found: String,
        /// What is allowed.
        allowed: Allowed,
    },
}

impl From<VolumeError> for SceneError {
    fn from(error: VolumeError) -> Self {
        match error.into_parts() {
            Ok((path, source)) => Self::Io { path, source },
            Err([origin, key, found, allowed]) => Self::Invalid { origin, key, found, allowed: allowed.into() },
        }
    }
}
