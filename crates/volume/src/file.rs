//! Files on disk or in memory.

use std::collections::BTreeMap;
use std::fmt;
use std::fs;
use std::io::{self, Cursor, ErrorKind, Read, Seek, SeekFrom};
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

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

/// Counts the bytes that are read of files, also while they are: clones share the count.
///
/// ```
/// use std::path::Path;
/// use sheetsplat_volume::Volume;
/// use sheetsplat_volume::{BytesRead, ReadOptions};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let header = "NRRD0001\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nencoding: raw\n\n01234567";
/// let files = [("a.nrrd", header.as_bytes())].into_iter().collect();
/// let read = BytesRead::default();
/// Volume::open_with(Path::new("a.nrrd"), &ReadOptions::default().with_files(files).counted_by(&read))?;
/// assert!(read.count() >= header.len() as u64);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, Default)]
pub struct BytesRead(Arc<AtomicU64>);

impl BytesRead {
    /// The number of bytes until now. Parts of files that are looked at more than once count each time.
    pub fn count(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }

    pub(super) fn add(&self, bytes: u64) {
        self.0.fetch_add(bytes, Ordering::Relaxed);
    }
}

impl PartialEq for BytesRead {
    /// Whether both share one count.
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl Eq for BytesRead {}

/// An open file, whose bytes are counted as they are read.
pub(super) struct File {
    bytes: Bytes,
    read: Option<BytesRead>,
}

enum Bytes {
    Disk(fs::File),
    Memory(Cursor<Arc<[u8]>>),
}

impl File {
    pub(super) fn on_disk(file: fs::File, read: Option<BytesRead>) -> Self {
        Self { bytes: Bytes::Disk(file), read }
    }

    pub(super) fn in_memory(bytes: &Arc<[u8]>, read: Option<BytesRead>) -> Self {
        Self { bytes: Bytes::Memory(Cursor::new(Arc::clone(bytes))), read }
    }
}

impl Read for File {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = match &mut self.bytes {
            Bytes::Disk(file) => file.read(buffer),
            Bytes::Memory(bytes) => bytes.read(buffer),
        }?;
        if let Some(read) = &self.read {
            read.add(count as u64);
        }
        Ok(count)
    }
}

impl Seek for File {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match &mut self.bytes {
            Bytes::Disk(file) => file.seek(to),
            Bytes::Memory(bytes) => bytes.seek(to),
        }
    }
}
