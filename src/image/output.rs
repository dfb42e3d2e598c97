//! Output files: a regular file appears whole or not at all; pipes and devices are written directly.

use std::collections::BTreeMap;
use std::fs::{self, File, Metadata, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use sheetsplat_volume::internals::identity::{folder, resolved};
use tempfile::TempPath;

use crate::abandon::Abandoned;

/// The temporary files by name, which are removed when dropped. The lock is held while one is created, renamed or removed, so the
/// holder of the lock sees all of them.
static TEMPORARY: Mutex<BTreeMap<PathBuf, TempPath>> = Mutex::new(BTreeMap::new());

fn temporary() -> MutexGuard<'static, BTreeMap<PathBuf, TempPath>> {
    TEMPORARY.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes the temporary files of all outputs. While the result lives, no output can be created or committed.
pub fn remove_temporary() -> impl Sized {
    let mut temporary = temporary();
    temporary.clear();
    temporary
}

/// What a path leads to once links are followed.
pub enum Target {
    /// A regular file, and its owner and permissions if it exists.
    Regular(PathBuf, Option<Metadata>),
    /// A pipe or a device.
    Stream(PathBuf),
    /// What standard output or standard error is connected to.
    Standard(File),
}

impl Target {
    /// Determines what a path leads to, without opening a pipe or a device.
    ///
    /// # Errors
    /// If it leads to a folder, a socket, a file without write permission, or into a folder that does not exist.
    pub fn of(path: &Path) -> io::Result<Self> {
        let metadata = match fs::metadata(path) {
            Err(error) if error.kind() == ErrorKind::NotFound => {
                let path = resolved(path)?;
                fs::metadata(folder(&path))?;
                return Ok(Self::Regular(path, None));
            }
            metadata => metadata?,
        };
        if metadata.is_dir() {
            return Err(ErrorKind::IsADirectory.into());
        }
        if let Some(standard) = standard(&metadata)? {
            return Ok(Self::Standard(standard));
        }
        if metadata.is_file() {
            // A rename would replace the file even without permission to write it.
            OpenOptions::new().write(true).open(path)?;
            return Ok(Self::Regular(fs::canonicalize(path)?, Some(metadata)));
        }
        if is_socket(&metadata) {
            let message = "found a socket, allowed: a regular file, a pipe or a device";
            return Err(io::Error::new(ErrorKind::InvalidInput, message));
        }
        Ok(Self::Stream(path.to_owned()))
    }

    /// Whether what is written becomes visible immediately and cannot be undone.
    pub fn is_stream(&self) -> bool {
        !matches!(self, Self::Regular(..))
    }

    /// Checks that the folder of a regular file takes new files, before a long render.
    ///
    /// # Errors
    /// The operating system's error.
    pub fn check_folder(self) -> io::Result<()> {
        if self.is_stream() { Ok(()) } else { self.create().map(|_| ()) }
    }

    /// Opens a pipe or a device, which may wait for its reader, or creates a temporary file beside a regular file.
    ///
    /// # Errors
    /// The operating system's error.
    pub fn create(self) -> io::Result<Output> {
        match self {
            Self::Regular(path, replaced) => Output::aside(path, replaced.as_ref()),
            Self::Stream(path) => Ok(Output { file: OpenOptions::new().write(true).open(path)?, aside: None }),
            Self::Standard(file) => Ok(Output { file, aside: None }),
        }
    }
}

/// A file that is being written.
pub struct Output {
    file: File,
    aside: Option<Aside>,
}

/// A temporary file and the path that it will be renamed to.
struct Aside {
    temporary: PathBuf,
    target: PathBuf,
}

impl Output {
    fn aside(target: PathBuf, replaced: Option<&Metadata>) -> io::Result<Self> {
        let mut builder = tempfile::Builder::new();
        // Temporary files are private by default; an image is as readable as any file the user makes, or as the one it replaces.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(replaced.map_or(0o666, mode)));
        let mut all = temporary();
        // Asked under the lock: whoever removes what is abandoned at the end of a process finds every file that was made before.
        if Abandoned::here().is_true() {
            return Err(io::Error::other("nobody waits for this file"));
        }
        let (file, path) = builder.prefix(".sheetsplat-").tempfile_in(folder(&target))?.into_parts();
        let aside = Aside { temporary: path.to_path_buf(), target };
        all.insert(aside.temporary.clone(), path);
        drop(all);
        let output = Self { file, aside: Some(aside) };
        if let Some(replaced) = replaced {
            output.take_after(replaced)?;
        }
        Ok(output)
    }

    /// Gives the file the owner and group of the one that it replaces, as far as the user may, and its permissions.
    #[cfg(unix)]
    fn take_after(&self, replaced: &Metadata) -> io::Result<()> {
        use std::os::unix::fs::{MetadataExt, PermissionsExt, fchown};
        let own = self.file.metadata()?;
        if (own.uid(), own.gid()) != (replaced.uid(), replaced.gid()) {
            // Only the superuser may give files away; a group may be one of the user's.
            let both = fchown(&self.file, Some(replaced.uid()), Some(replaced.gid()));
            _ = both.or_else(|_| fchown(&self.file, None, Some(replaced.gid())));
        }
        // The process's umask may have removed some permissions.
        self.file.set_permissions(PermissionsExt::from_mode(mode(replaced)))
    }

    #[cfg(not(unix))]
    fn take_after(&self, replaced: &Metadata) -> io::Result<()> {
        self.file.set_permissions(replaced.permissions())
    }

    /// Waits until the bytes are on the disk, so that no crash leaves the file's name without them. [`Self::commit`] does it, too.
    ///
    /// # Errors
    /// The operating system's error.
    pub fn sync(&self) -> io::Result<()> {
        match self.file.sync_all() {
            // Some file systems have nothing to wait for.
            Err(error) if matches!(error.kind(), ErrorKind::InvalidInput | ErrorKind::Unsupported) => Ok(()),
            done => done,
        }
    }

    /// Renames the temporary files of completely written outputs, once they are on the disk, to their own names: all of them or none.
    ///
    /// # Errors
    /// The path of an output that cannot be renamed, and the operating system's error. The renames before it are undone, which restores
    /// the files they replaced.
    pub fn commit(outputs: Vec<Self>) -> Result<(), (PathBuf, io::Error)> {
        for output in &outputs {
            if let Some(aside) = &output.aside {
                output.sync().map_err(|error| (aside.target.clone(), error))?;
            }
        }
        let mut all = temporary();
        let mut renamed = Vec::new();
        for Aside { temporary, target } in outputs.iter().filter_map(|output| output.aside.as_ref()) {
            let Some(path) = all.remove(temporary) else { continue };
            // A single rename is atomic.
            let replaced = if outputs.len() > 1 { Replaced::keep(target) } else { Ok(Replaced::default()) };
            match replaced.and_then(|replaced| path.persist(target).map(|()| replaced).map_err(|error| error.error)) {
                Ok(replaced) => renamed.push((target, replaced)),
                Err(error) => {
                    renamed.into_iter().for_each(|(renamed, replaced)| replaced.put_back(renamed));
                    return Err((target.clone(), error));
                }
            }
        }
        Ok(())
    }
}

/// The permissions that a file's successor has: others' reading, writing and running, but not to run as its owner or group.
#[cfg(unix)]
fn mode(replaced: &Metadata) -> u32 {
    std::os::unix::fs::PermissionsExt::mode(&replaced.permissions()) & 0o777
}

/// The file at a path before an output replaced it, kept under a second name, if there was one.
#[derive(Default)]
struct Replaced(Option<TempPath>);

impl Replaced {
    fn keep(target: &Path) -> io::Result<Self> {
        if !fs::exists(target)? {
            return Ok(Self(None));
        }
        // Some file systems do not support links.
        let second = |path: &Path| fs::hard_link(target, path).or_else(|_| fs::copy(target, path).map(|_| ()));
        let kept = tempfile::Builder::new().prefix(".sheetsplat-").make_in(folder(target), second)?;
        Ok(Self(Some(kept.into_temp_path())))
    }

    /// Undoes a rename as far as possible. An error here is not reported, because the one that made it necessary is.
    fn put_back(self, target: &Path) {
        let _ = match self.0 {
            Some(kept) => kept.persist(target).map_err(io::Error::from),
            None => fs::remove_file(target),
        };
    }
}

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Drop for Output {
    /// Removes a temporary file that was not committed.
    fn drop(&mut self) {
        if let Some(aside) = &self.aside {
            temporary().remove(&aside.temporary);
        }
    }
}

/// Writes a whole file.
///
/// # Errors
/// The operating system's error.
pub fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut output = Target::of(path)?.create()?;
    output.write_all(bytes)?;
    Output::commit(vec![output]).map_err(|(_, error)| error)
}

/// Standard output or standard error, if that is the same file. A file that another program opened is written from its current position,
/// which is what `/dev/stdout` means.
#[cfg(unix)]
fn standard(metadata: &Metadata) -> io::Result<Option<File>> {
    use std::os::fd::AsFd;
    use std::os::unix::fs::MetadataExt;
    let (output, error) = (io::stdout(), io::stderr());
    for stream in [output.as_fd(), error.as_fd()] {
        let file = File::from(stream.try_clone_to_owned()?);
        let other = file.metadata()?;
        if (other.dev(), other.ino()) == (metadata.dev(), metadata.ino()) {
            return Ok(Some(file));
        }
    }
    Ok(None)
}

#[cfg(not(unix))]
fn standard(_: &Metadata) -> io::Result<Option<File>> {
    Ok(None)
}

#[cfg(unix)]
fn is_socket(metadata: &Metadata) -> bool {
    std::os::unix::fs::FileTypeExt::is_socket(&metadata.file_type())
}

#[cfg(not(unix))]
fn is_socket(_: &Metadata) -> bool {
    false
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;

    /// The third output's target becomes a folder after it was checked, so that a rename onto it fails.
    #[test]
    fn where_one_output_fails_those_before_it_are_undone() {
        let folder = tempfile::tempdir().unwrap();
        let [old, new, bad] = ["old", "new", "bad"].map(|name| folder.path().join(name));
        fs::write(&old, "before").unwrap();
        let written = |path: &PathBuf| {
            let mut output = Target::of(path).unwrap().create().unwrap();
            output.write_all(b"after").unwrap();
            output
        };
        let outputs: Vec<_> = [&old, &new, &bad].map(written).into();
        fs::create_dir(&bad).unwrap();
        let (path, _) = Output::commit(outputs).unwrap_err();
        assert_eq!(path, bad);
        assert_eq!(fs::read_to_string(&old).unwrap(), "before");
        let mut names: Vec<_> = fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        names.sort();
        assert_eq!(names, ["bad", "old"]);

        fs::remove_dir(&bad).unwrap();
        Output::commit([&old, &new, &bad].map(written).into()).unwrap();
        assert!([&old, &new, &bad].iter().all(|path| fs::read_to_string(path).unwrap() == "after"));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 3);
    }

    /// Nothing is left at the end of a process, whose last step is to remove what is there.
    #[test]
    fn work_that_nobody_waits_for_makes_no_file() {
        let folder = tempfile::tempdir().unwrap();
        let abandoned = std::sync::Arc::new(std::sync::atomic::AtomicBool::new(true));
        let made = crate::abandon::watch(&abandoned, || write(&folder.path().join("a"), b"after"));
        assert!(made.is_err());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[cfg(unix)]
    #[test]
    fn a_successor_has_the_owner_and_the_permissions() {
        use std::os::unix::fs::{MetadataExt, PermissionsExt, chown};
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        fs::write(&path, "before").unwrap();
        // Only the superuser may give files away.
        let is_given = chown(&path, Some(1234), Some(2345)).is_ok();
        fs::set_permissions(&path, PermissionsExt::from_mode(0o6751)).unwrap();
        let owner = |path: &Path| fs::metadata(path).map(|metadata| (metadata.uid(), metadata.gid())).unwrap();
        let before = owner(&path);
        assert_eq!(before == (1234, 2345), is_given);
        write(&path, b"after").unwrap();
        assert_eq!((fs::read(&path).unwrap(), owner(&path)), (b"after".to_vec(), before));
        assert_eq!(fs::metadata(&path).unwrap().mode() & 0o7777, 0o751);
    }
}
