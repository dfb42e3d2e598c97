//! Limits on reading: which files may be opened, and how much memory their values may use.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use super::VolumeError;
use super::memory;
use super::source::{Source, invalid, io_error};

/// Options for reading volumes, labels and scenes. By default files may lie anywhere.
///
/// ```
/// use sheetsplat::volume::ReadOptions;
///
/// let options = ReadOptions::default().confined_to("uploads").with_memory(2 << 30);
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct ReadOptions {
    /// The folder that every file must lie in once links are followed; `None` allows any place.
    pub confine: Option<PathBuf>,
    /// The maximum number of bytes for the values of a volume and its labels together. `None` means three quarters of the machine's
    /// memory, or of what the process's control group may use if that is less.
    pub memory: Option<u64>,
}

impl ReadOptions {
    /// These options with files confined to this folder.
    pub fn confined_to(self, folder: impl Into<PathBuf>) -> Self {
        Self { confine: Some(folder.into()), ..self }
    }

    /// These options with another memory limit in bytes.
    pub fn with_memory(self, bytes: u64) -> Self {
        Self { memory: Some(bytes), ..self }
    }
}

/// [`ReadOptions`] while a volume and its labels are read. Clones share the memory limit.
#[derive(Clone)]
pub(crate) struct Access(Arc<Inner>);

struct Inner {
    folder: Option<Folder>,
    limit: u64,
    reserved: AtomicU64,
    files: Mutex<BTreeSet<PathBuf>>,
}

/// The folder to which files are confined.
struct Folder {
    /// The path in the options, for errors.
    named: PathBuf,
    canonical: PathBuf,
}

impl Access {
    pub(crate) fn new(options: &ReadOptions) -> Result<Self, VolumeError> {
        let folder = |named: &PathBuf| {
            let canonical = named.canonicalize().map_err(io_error(named))?;
            Ok(Folder { named: named.clone(), canonical })
        };
        let folder = options.confine.as_ref().map(folder).transpose()?;
        let limit = options.memory.unwrap_or_else(memory::default_limit);
        Ok(Self(Arc::new(Inner { folder, limit, reserved: AtomicU64::new(0), files: Mutex::default() })))
    }

    /// The path to open for a file or folder. If reading is confined, it has no links in it.
    ///
    /// # Errors
    /// If reading is confined and the path leads out of the folder, whether or not the file exists.
    pub(crate) fn resolve<'a>(&self, path: &'a Path) -> Result<Cow<'a, Path>, VolumeError> {
        let Some(folder) = &self.0.folder else { return Ok(Cow::Borrowed(path)) };
        let resolved = path.canonicalize();
        // For a path outside the folder the error does not reveal whether the file exists.
        let place = match &resolved {
            Ok(resolved) => Some(resolved.clone()),
            Err(_) => {
                let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty());
                parent.unwrap_or(Path::new(".")).canonicalize().ok().filter(|_| !path.is_symlink())
            }
        };
        if !place.is_some_and(|place| place.starts_with(&folder.canonical)) {
            let allowed = format!("files within {}, to which reading is confined", folder.named.display());
            return Err(invalid(path, "file", "a path that leads elsewhere", allowed));
        }
        resolved.map(Cow::Owned).map_err(io_error(path))
    }

    pub(super) fn open(&self, path: &Path) -> Result<Source, VolumeError> {
        let source = self.open_to_look(path)?;
        self.0.files.lock().unwrap_or_else(PoisonError::into_inner).insert(path.to_owned());
        Ok(source)
    }

    /// Opens a file only to determine its format.
    pub(super) fn open_to_look(&self, path: &Path) -> Result<Source, VolumeError> {
        Source::open(path, &self.resolve(path)?, self)
    }

    /// The files opened so far, without those of which only the format was determined.
    pub(crate) fn files(&self) -> Vec<PathBuf> {
        self.0.files.lock().unwrap_or_else(PoisonError::into_inner).iter().cloned().collect()
    }

    /// Reserves `bytes` of memory, before they are allocated, for what `found` describes.
    ///
    /// # Errors
    /// If fewer bytes are left of the limit.
    pub(crate) fn reserve(&self, path: &Path, field: &str, found: impl Display, bytes: u64) -> Result<(), VolumeError> {
        let Inner { limit, reserved, .. } = &*self.0;
        let add = |reserved: u64| reserved.checked_add(bytes).filter(|sum| sum <= limit);
        let Err(before) = reserved.fetch_update(Ordering::Relaxed, Ordering::Relaxed, add) else { return Ok(()) };
        let others = if before > 0 { format!(", of which {before} are taken") } else { String::new() };
        let allowed = format!("at most the memory limit of {limit} bytes{others}");
        Err(invalid(path, field, format!("{found}, which take {bytes} bytes of memory"), allowed))
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;

    #[test]
    fn memory_is_counted() {
        let access = Access::new(&ReadOptions::default().with_memory(100)).unwrap();
        let reserve = |bytes| access.clone().reserve(Path::new("a"), "data", "voxels", bytes);
        assert!(reserve(60).is_ok());
        let message = reserve(41).unwrap_err().to_string();
        let expected = "a: data: found voxels, which take 41 bytes of memory, allowed: at most the memory limit of 100 bytes, of which 60 are taken";
        assert_eq!(message, expected);
        assert!(reserve(u64::MAX).is_err());
        assert!(reserve(40).is_ok());
        assert!(reserve(1).is_err());
    }
}
