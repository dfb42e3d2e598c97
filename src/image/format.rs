//! Image formats and errors.

use std::path::{Path, PathBuf};

/// Why an image could not be opened or saved.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImageError {
    /// The extension is unknown.
    #[error("{}: extension: found {found}, allowed: .png, .exr or .npy", path.display())]
    #[non_exhaustive]
    Format {
        /// The file.
        path: PathBuf,
        /// Its extension.
        found: String,
    },
    /// The file could not be read or written.
    #[error("{}: {source}", path.display())]
    #[non_exhaustive]
    Io {
        /// The file.
        path: PathBuf,
        /// The operating system's error.
        source: std::io::Error,
    },
    /// The image could not be encoded.
    #[error("{}: {source}", path.display())]
    #[non_exhaustive]
    Encode {
        /// The file.
        path: PathBuf,
        /// The encoder's error.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// The file cannot be decoded as the format of its extension.
    #[error("{}: {source}", path.display())]
    #[non_exhaustive]
    Decode {
        /// The file.
        path: PathBuf,
        /// The decoder's error.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// The file does not hold an image that can be read.
    #[error("{}: {what}: found {found}, allowed: {allowed}", path.display())]
    #[non_exhaustive]
    Content {
        /// The file.
        path: PathBuf,
        /// The part of it that is wrong (`shape`, `descr`, `size`).
        what: String,
        /// What was found.
        found: String,
        /// What is allowed.
        allowed: String,
    },
}

/// The keyword of the text that describes a picture: of an iTXt chunk in PNG files, of an attribute in EXR files.
pub(super) const KEYWORD: &str = "sheetsplat picture";

/// The maximum length of such a text in bytes: that of a scene, each of whose characters may be escaped.
#[cfg(feature = "golden")]
pub(crate) const MAX_TEXT: usize = 32 << 20;

/// File formats by extension, ignoring case.
pub(super) enum Format {
    Png,
    Exr,
    Npy,
}

impl Format {
    pub(super) fn of(path: &Path) -> Result<Self, ImageError> {
        let extension = path.extension().and_then(|extension| extension.to_str());
        match extension.map(str::to_ascii_lowercase).as_deref() {
            Some("png") => Ok(Self::Png),
            Some("exr") => Ok(Self::Exr),
            Some("npy") => Ok(Self::Npy),
            _ => Err(ImageError::Format {
                path: path.to_owned(),
                found: extension.map_or("none".to_owned(), |extension| format!("\".{extension}\"")),
            }),
        }
    }
}
