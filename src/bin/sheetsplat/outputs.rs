//! Output files: none is an input, none is written twice, and either all are written or none.

use std::collections::HashMap;
use std::fs;
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};

use sheetsplat::image::output::{Output, Target, folder, resolved};

use crate::failure::Failure;
use crate::stdout::stdout;

/// A file to be written: the option that names it, and its path.
pub(crate) type Named<'a> = (&'static str, &'a Path);

/// The files that a run will write, including standard output if it prints, each with the option that names it and its path.
pub(crate) struct Outputs(HashMap<Identity, (&'static str, String)>);

impl Outputs {
    /// Checks, before anything is drawn, that every file is writable, and that none equals another one or an input that is named so far.
    /// [`Outputs::refuse`] checks the remaining inputs.
    pub(crate) fn check(files: &[Named<'_>], prints: bool, inputs: &[PathBuf]) -> Result<Self, Failure> {
        let outputs = Self::distinct(files.iter().map(|&(option, path)| (option, path.to_owned())), prints)?;
        outputs.refuse(inputs)?;
        files.iter().try_for_each(|(_, path)| check_writable(path))?;
        Ok(outputs)
    }

    /// Checks that no two paths lead to the same file.
    pub(crate) fn distinct(
        files: impl Iterator<Item = (&'static str, PathBuf)>,
        prints: bool,
    ) -> Result<Self, Failure> {
        let mut outputs = HashMap::new();
        if prints && let Some(identity) = Identity::of_standard_output() {
            outputs.insert(identity, ("standard output", "a file".to_owned()));
        }
        for (option, path) in files {
            // A path that leads nowhere is reported when it is written.
            let Ok(identity) = Identity::of(&path) else { continue };
            let found = path.display().to_string();
            if let Some((other, _)) = outputs.get(&identity) {
                return Err(invalid(option, &found, &format!("the file of {other}")));
            }
            outputs.insert(identity, (option, found));
        }
        Ok(Self(outputs))
    }

    /// Refuses outputs that equal one of these inputs.
    pub(crate) fn refuse(&self, inputs: &[PathBuf]) -> Result<(), Failure> {
        for input in inputs {
            if let Some((option, found)) = Identity::of(input).ok().and_then(|identity| self.0.get(&identity)) {
                return Err(invalid(option, found, &format!("the input {}", input.display())));
            }
        }
        Ok(())
    }
}

fn invalid(option: &str, found: &str, other: &str) -> Failure {
    Failure::Input(format!("{option}: found {found}, which is also {other}, allowed: another file"))
}

/// Checks that a path is writable.
pub(crate) fn check_writable(path: &Path) -> Result<(), Failure> {
    Target::of(path).map(|_| ()).map_err(failed(path))
}

/// Writes files and prints: all or nothing. Pipes, devices and standard output cannot be undone, so they are written last, before the
/// other files are renamed.
pub(crate) fn write(files: &[(&Path, Vec<u8>)], printed: &[u8]) -> Result<(), Failure> {
    let mut targets = Vec::new();
    for (path, bytes) in files {
        targets.push((path, bytes, Target::of(path).map_err(failed(path))?));
    }
    targets.sort_by_key(|(.., target)| target.is_stream());
    let mut outputs = Vec::new();
    for (path, bytes, target) in targets {
        let is_stream = target.is_stream();
        let mut output = target.create().map_err(failed(path))?;
        output.write_all(bytes).map_err(failed(path))?;
        // A pipe's reader waits for the end of the pipe.
        if !is_stream {
            outputs.push(output);
        }
    }
    stdout(printed)?;
    commit(outputs)
}

/// Renames completely written files to their own names.
pub(crate) fn commit(outputs: Vec<Output>) -> Result<(), Failure> {
    Output::commit(outputs).map_err(|(path, error)| failed(&path)(error))
}

/// The failure to write an output.
pub(crate) fn failed(path: &Path) -> impl Fn(io::Error) -> Failure {
    move |error| {
        let message = format!("{}: {error}", path.display());
        if error.kind() == ErrorKind::InvalidInput { Failure::Input(message) } else { Failure::Other(message) }
    }
}

/// The identity of a file, independent of its name.
#[derive(PartialEq, Eq, Hash)]
enum Identity {
    /// Its device and inode.
    #[cfg(unix)]
    Inode(u64, u64),
    /// The path at which the file is, or will be.
    Path(PathBuf),
}

impl Identity {
    fn of(path: &Path) -> io::Result<Self> {
        match fs::metadata(path) {
            Err(error) if error.kind() == ErrorKind::NotFound => {
                let path = resolved(path)?;
                let name = path.file_name().ok_or(ErrorKind::InvalidFilename)?;
                Ok(Self::Path(fs::canonicalize(folder(&path))?.join(name)))
            }
            #[cfg(unix)]
            metadata => metadata.map(|metadata| Self::of_file(&metadata)),
            #[cfg(not(unix))]
            metadata => metadata.and_then(|_| fs::canonicalize(path)).map(Self::Path),
        }
    }

    #[cfg(unix)]
    fn of_file(metadata: &fs::Metadata) -> Self {
        use std::os::unix::fs::MetadataExt;
        Self::Inode(metadata.dev(), metadata.ino())
    }

    /// The file or pipe connected to standard output; `None` for a terminal, which several outputs may share.
    #[cfg(unix)]
    fn of_standard_output() -> Option<Self> {
        use std::os::fd::AsFd;
        use std::os::unix::fs::FileTypeExt;
        let file = fs::File::from(io::stdout().as_fd().try_clone_to_owned().ok()?);
        let metadata = file.metadata().ok().filter(|metadata| !metadata.file_type().is_char_device())?;
        Some(Self::of_file(&metadata))
    }

    #[cfg(not(unix))]
    fn of_standard_output() -> Option<Self> {
        None
    }
}
