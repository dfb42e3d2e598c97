//! Files on disk or in memory.

use std::collections::BTreeMap;
use std::fmt;
use std::io::{self, Cursor, ErrorKind, Read, Seek, SeekFrom};
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

/// Files in memory by their paths, as [`ReadOptions::with_files`](super::ReadOptions::with_files) takes them. Clones share the bytes.
#[derive(Clone, Default, PartialEq, Eq)]
pub struct Files(BTreeMap<PathBuf, Arc<[u8]>>);

impl Files {
    /// A file's bytes.
    ///
    /// # Errors
    /// If there is no such file.
    pub(super) fn get(&self, path: &Path) -> io::Result<&Arc<[u8]>> {
        self.0.get(&normal(path)).ok_or_else(|| {
            let names: Vec<String> = self.0.keys().map(|path| path.display().to_string()).collect();
            io::Error::new(ErrorKind::NotFound, format!("no such file among those given: {}", names.join(", ")))
        })
    }

    /// The files in a folder, without those of its subfolders.
    pub(super) fn in_folder(&self, folder: &Path) -> impl Iterator<Item = &PathBuf> {
        let folder = normal(folder);
        self.0.keys().filter(move |path| path.parent() == Some(&folder))
    }
}

impl fmt::Debug for Files {
    /// The paths and lengths.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_map().entries(self.0.iter().map(|(path, bytes)| (path, bytes.len()))).finish()
    }
}

impl<P: AsRef<Path>, B: Into<Arc<[u8]>>> FromIterator<(P, B)> for Files {
    fn from_iter<I: IntoIterator<Item = (P, B)>>(files: I) -> Self {
        Self(files.into_iter().map(|(path, bytes)| (normal(path.as_ref()), bytes.into())).collect())
    }
}

/// A path without components that stand for the folder itself: `./a` is `a`.
fn normal(path: &Path) -> PathBuf {
    path.components().filter(|component| *component != Component::CurDir).collect()
}

/// An open file.
pub(super) enum File {
    Disk(std::fs::File),
    Memory(Cursor<Arc<[u8]>>),
}

impl Read for File {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::Disk(file) => file.read(buffer),
            Self::Memory(bytes) => bytes.read(buffer),
        }
    }
}

impl Seek for File {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match self {
            Self::Disk(file) => file.seek(to),
            Self::Memory(bytes) => bytes.seek(to),
        }
    }
}
