//! Where a volume comes from.

use std::path::{Path, PathBuf};

use crate::volume::RawLayout;

/// The source of a scene's volume.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum VolumeSource {
    /// A volume file.
    File(PathBuf),
    /// A file of samples without a header.
    Raw(PathBuf, RawLayout),
    /// A procedural volume, `NAME` or `NAME:N` (see [`builtin::volume`](crate::volume::builtin::volume)).
    Builtin(String),
    /// A volume that the program holds in memory and passes to the renderer. A scene file cannot name it.
    Memory,
}

impl VolumeSource {
    /// The path of a volume file, with or without a header; `None` for any other volume.
    pub fn path(&self) -> Option<&Path> {
        match self {
            Self::File(path) | Self::Raw(path, _) => Some(path),
            Self::Builtin(_) | Self::Memory => None,
        }
    }
}
