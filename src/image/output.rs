//! Output files: a regular file appears whole or not at all; pipes and devices are written directly.

use std::collections::BTreeMap;
use std::fs::{self, File, Metadata, OpenOptions, Permissions};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use sheetsplat_volume::internals::identity::{folder, resolved};
use tempfile::TempPath;

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
    /// A regular file, and its permissions if it exists.
    Regular(PathBuf, Option<Permissions>),
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
            return Ok(Self::Regular(fs::canonicalize(path)?, Some(metadata.permissions())));
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

    /// Opens a pipe or a device, which may wait for its reader, or creates a temporary file beside a regular file.
    ///
    /// # Errors
    /// The operating system's error.
    pub fn create(self) -> io::Result<Output> {
        match self {
            Self::Regular(path, permissions) => Output::aside(path, permissions),
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
    fn aside(target: PathBuf, permissions: Option<Permissions>) -> io::Result<Self> {
        let mut builder = tempfile::Builder::new();
        // Temporary files are private by default; an image is as readable as any file the user makes, or as the one it replaces.
        #[cfg(unix)]
        builder.permissions(permissions.clone().unwrap_or(std::os::unix::fs::PermissionsExt::from_mode(0o666)));
        let mut all = temporary();
        let (file, path) = builder.prefix(".sheetsplat-").tempfile_in(folder(&target))?.into_parts();
        let aside = Aside { temporary: path.to_path_buf(), target };
        all.insert(aside.temporary.clone(), path);
        drop(all);
        let output = Self { file, aside: Some(aside) };
        if let Some(permissions) = permissions {
            // The process's umask may have removed some permissions.
            output.file.set_permissions(permissions)?;
        }
        Ok(output)
    }

    /// Renames the temporary files of completely written outputs to their own names: all of them or none.
    ///
    /// # Errors
    /// The path of an output that cannot be renamed, and the operating system's error. The renames before it are undone, which restores
    /// the files they replaced.
    pub fn commit(outputs: Vec<Self>) -> Result<(), (PathBuf, io::Error)> {
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
}
