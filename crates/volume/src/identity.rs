//! Files, whatever names lead to them.

use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

/// The maximum number of chained symbolic links, as on Linux.
const MAX_LINKS: usize = 40;

/// The identity of a file, independent of its name.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) enum Identity {
    /// Its device and inode.
    #[cfg(unix)]
    Inode(u64, u64),
    /// The path at which the file is, or will be.
    Path(PathBuf),
}

impl Identity {
    /// That of the file that a path leads to, or will lead to.
    ///
    /// # Errors
    /// If it leads nowhere.
    pub(super) fn of(path: &Path) -> io::Result<Self> {
        match fs::metadata(path) {
            Err(error) if error.kind() == ErrorKind::NotFound => place(path).map(Self::Path),
            #[cfg(unix)]
            metadata => metadata.map(|metadata| Self::of_file(&metadata)),
            #[cfg(not(unix))]
            metadata => metadata.and_then(|_| fs::canonicalize(path)).map(Self::Path),
        }
    }

    /// That of a file with these metadata.
    #[cfg(unix)]
    pub(super) fn of_file(metadata: &fs::Metadata) -> Self {
        use std::os::unix::fs::MetadataExt;
        Self::Inode(metadata.dev(), metadata.ino())
    }
}

/// The path without links of a file that need not exist, in a folder that does.
pub(super) fn place(path: &Path) -> io::Result<PathBuf> {
    let path = resolved(path)?;
    let name = path.file_name().ok_or(ErrorKind::InvalidFilename)?;
    Ok(fs::canonicalize(folder(&path))?.join(name))
}

/// The path with symbolic links in its last part followed, even if they lead to a file that does not exist.
///
/// # Errors
/// If there are too many links, or one cannot be read.
pub fn resolved(path: &Path) -> io::Result<PathBuf> {
    let mut path = path.to_owned();
    for _ in 0..MAX_LINKS {
        match fs::symlink_metadata(&path) {
            Ok(metadata) if metadata.is_symlink() => path = folder(&path).join(fs::read_link(&path)?),
            Err(error) if error.kind() != ErrorKind::NotFound => return Err(error),
            _ => return Ok(path),
        }
    }
    Err(io::Error::other("too many symbolic links"))
}

/// The folder of a file.
pub fn folder(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}
