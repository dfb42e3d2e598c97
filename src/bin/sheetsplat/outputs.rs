//! Output files: none is an input, none is written twice, and either all are written or none.

use std::fs;
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};

use sheetsplat::image::output::{Output, Target};
use sheetsplat::internals::identity;
use sheetsplat::volume;

use crate::failure::Failure;
use crate::stdout::stdout;

/// A file to be written: the option that names it, and its path.
pub(crate) type Named<'a> = (&'static str, &'a Path);

/// The files that a run will write, including standard output if it prints.
pub(crate) struct Outputs(volume::Outputs);

impl Outputs {
    /// Checks, before anything is drawn, that every file is writable, and that none equals another one or an input that is named so far. Readers
    /// are told of [`Outputs::written`], and refuse the remaining inputs.
    pub(crate) fn check(files: &[Named<'_>], prints: bool, inputs: &[PathBuf]) -> Result<Self, Failure> {
        let outputs = Self::distinct(files.iter().map(|&(option, path)| (option, path.to_owned())), prints)?;
        outputs.refuse(inputs)?;
        files.iter().try_for_each(|(_, path)| check_writable(path).and_then(|()| check_folder(path)))?;
        Ok(outputs)
    }

    /// Checks that no two paths lead to the same file.
    pub(crate) fn distinct(
        files: impl Iterator<Item = (&'static str, PathBuf)>,
        #[cfg_attr(not(unix), expect(unused_variables, reason = "standard output has no identity"))] prints: bool,
    ) -> Result<Self, Failure> {
        let mut outputs = volume::Outputs::default();
        #[cfg(unix)]
        if prints && let Some(file) = standard_output() {
            outputs.insert_open(&file, "standard output").map_err(Failure::Other)?;
        }
        for (option, path) in files {
            let name = format!("{option} {}", path.display());
            outputs.insert(&path, &name).map_err(|other| invalid(&name, &other))?;
        }
        Ok(Self(outputs))
    }

    /// Refuses outputs that equal one of these inputs.
    pub(crate) fn refuse(&self, inputs: &[PathBuf]) -> Result<(), Failure> {
        match inputs.iter().find_map(|input| self.0.at(input).map(|name| (name, input))) {
            Some((name, input)) => Err(invalid(name, &format!("the input {}", input.display()))),
            None => Ok(()),
        }
    }

    /// The same files, for readers, which refuse to read them.
    pub(crate) fn written(&self) -> volume::Outputs {
        self.0.clone()
    }
}

fn invalid(name: &str, other: &str) -> Failure {
    Failure::Input(format!("{name}: found the same file as {other}, allowed: another file"))
}

/// Checks that a path leads to a file that may be written, or to none, in a folder that exists.
pub(crate) fn check_writable(path: &Path) -> Result<(), Failure> {
    check(path, |_| Ok(()))
}

/// Checks that the folder of a file takes new files.
pub(crate) fn check_folder(path: &Path) -> Result<(), Failure> {
    check(path, Target::check_folder)
}

/// Checks what a path leads to. A folder that is missing or may not be written is bad usage.
fn check(path: &Path, check: impl Fn(Target) -> io::Result<()>) -> Result<(), Failure> {
    let is_new = fs::symlink_metadata(path).is_err();
    let target = match Target::of(path) {
        Err(error) if is_new => return Err(bad_folder(path, &error)),
        target => target.map_err(failed(path))?,
    };
    check(target).map_err(|error| bad_folder(path, &error))
}

fn bad_folder(path: &Path, error: &io::Error) -> Failure {
    let folder = identity::folder(path).display();
    Failure::Input(format!("{}: the folder {folder}: {error}, allowed: a folder that takes new files", path.display()))
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

/// The file or pipe connected to standard output; `None` for a terminal, which several outputs may share.
#[cfg(unix)]
fn standard_output() -> Option<fs::Metadata> {
    use std::os::fd::AsFd;
    use std::os::unix::fs::FileTypeExt;
    let file = fs::File::from(io::stdout().as_fd().try_clone_to_owned().ok()?);
    file.metadata().ok().filter(|metadata| !metadata.file_type().is_char_device())
}
