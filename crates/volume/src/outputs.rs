//! Files that are written, none of which may be read.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

use super::VolumeError;
use super::error::volume::invalid;
use super::identity::{Identity, place};

/// The files that a program will write while or after it reads a volume. To read one of them is an error, whatever name leads to it, because its
/// contents would be lost: a file with data that a header names, a slice of a folder, and whatever lies in the folder of a Zarr store.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Outputs(HashMap<Identity, Output>);

/// A file to be written.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Output {
    /// For messages.
    name: String,
    /// Where it is or will be; `None` if it has no path, as standard output.
    place: Option<PathBuf>,
}

impl Outputs {
    /// The files at these paths. A path that leads nowhere is reported when it is written.
    ///
    /// ```
    /// use std::path::Path;
    /// use sheetsplat_volume::{Outputs, ReadOptions, Volume};
    ///
    /// # let folder = tempfile::tempdir()?;
    /// let (header, data) = (folder.path().join("v.nhdr"), folder.path().join("v.raw"));
    /// std::fs::write(&header, "NRRD0001\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nencoding: raw\ndata file: v.raw\n")?;
    /// std::fs::write(&data, [0; 8])?;
    /// let options = ReadOptions::default().with_outputs(Outputs::new([&data]));
    /// assert!(Volume::open_with(&header, &options).is_err());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn new(paths: impl IntoIterator<Item = impl AsRef<Path>>) -> Self {
        let mut outputs = Self::default();
        for path in paths {
            let _ = outputs.insert(path.as_ref(), &path.as_ref().display().to_string());
        }
        outputs
    }

    /// Adds a file that messages call by a name.
    ///
    /// # Errors
    /// The name of the one that is the same file.
    #[doc(hidden)]
    pub fn insert(&mut self, path: &Path, name: &str) -> Result<(), String> {
        let Ok(identity) = Identity::of(path) else { return Ok(()) };
        self.add(identity, name, fs::canonicalize(path).or_else(|_| place(path)).ok())
    }

    /// As [`Self::insert`], a file that is open.
    #[cfg(unix)]
    #[doc(hidden)]
    pub fn insert_open(&mut self, file: &fs::Metadata, name: &str) -> Result<(), String> {
        self.add(Identity::of_file(file), name, None)
    }

    fn add(&mut self, identity: Identity, name: &str, place: Option<PathBuf>) -> Result<(), String> {
        match self.0.get(&identity) {
            Some(other) => Err(other.name.clone()),
            None => {
                self.0.insert(identity, Output { name: name.to_owned(), place });
                Ok(())
            }
        }
    }

    /// The name of the output that is the file at a path.
    #[doc(hidden)]
    pub fn at(&self, path: &Path) -> Option<&str> {
        if self.0.is_empty() {
            return None;
        }
        Identity::of(path).ok().and_then(|identity| self.0.get(&identity)).map(|output| output.name.as_str())
    }

    /// Checks that the file at a path is not an output. Errors call it `named`.
    ///
    /// # Errors
    /// If it is one.
    #[doc(hidden)]
    pub fn check_file(&self, named: &Path, path: &Path) -> Result<(), VolumeError> {
        self.at(path).map_or(Ok(()), |output| Err(would_be_lost(named, output)))
    }

    /// Checks that no file in a folder, or in a folder below it, is an output. Errors call the folder `named`.
    pub(super) fn check_folder(&self, named: &Path, path: &Path) -> Result<(), VolumeError> {
        self.within(path).map_or(Ok(()), |output| Err(would_be_lost(named, output)))
    }

    /// The name of an output that lies in a folder or one below it, or that a link there leads to.
    fn within(&self, folder: &Path) -> Option<&str> {
        if self.0.is_empty() {
            return None;
        }
        let root = fs::canonicalize(folder).ok()?;
        let is_within = |output: &&Output| output.place.as_ref().is_some_and(|place| place.starts_with(&root));
        if let Some(output) = self.0.values().find(is_within) {
            return Some(&output.name);
        }
        // Only a file that exists has other names, and few have more than one of their own.
        let existing = self.0.values().filter_map(|output| fs::metadata(output.place.as_ref()?).ok());
        let has_names: Vec<bool> = existing.map(|metadata| has_further_names(&metadata)).collect();
        if has_names.is_empty() { None } else { self.linked(&root, has_names.contains(&true)) }
    }

    /// The name of an output that a file in a folder, or in one below it, is too: a symbolic link, or any file if an output has further names. To list a
    /// folder costs little, but to look at each of its files would take minutes where a store has many chunks.
    fn linked(&self, folder: &Path, has_further_names: bool) -> Option<&str> {
        fs::read_dir(folder).ok()?.flatten().find_map(|entry| {
            let kind = entry.file_type().ok()?;
            if kind.is_dir() {
                self.linked(&entry.path(), has_further_names)
            } else if kind.is_symlink() || has_further_names {
                self.at(&entry.path())
            } else {
                None
            }
        })
    }
}

fn would_be_lost(path: &Path, output: &str) -> VolumeError {
    invalid(path, "file", format!("the input that {output} would replace"), "another file to write")
}

/// Whether a file may have another name of its own (a hard link).
fn has_further_names(file: &fs::Metadata) -> bool {
    #[cfg(unix)]
    return std::os::unix::fs::MetadataExt::nlink(file) > 1;
    #[cfg(not(unix))]
    return file.is_file();
}
