//! Files that have been read, none of which may be written over.

use std::path::{self, Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::VolumeError;
use super::outputs::Outputs;

/// The files, and the folders of Zarr stores, that readers open, noted as they do, so that a program can check what it writes later. Clones share
/// the list.
///
/// ```
/// use sheetsplat_volume::{Inputs, Outputs, ReadOptions, Volume};
///
/// # let folder = tempfile::tempdir()?;
/// let path = folder.path().join("v.nrrd");
/// std::fs::write(&path, "NRRD0001\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nencoding: raw\n\n01234567")?;
/// let inputs = Inputs::default();
/// let volume = Volume::open_with(&path, &ReadOptions::default().noted_in(&inputs))?;
/// assert!(inputs.check(&Outputs::new([&path])).is_err());
/// assert_eq!((inputs.files(), inputs.folders()), (vec![path], vec![]));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct Inputs(Arc<Mutex<Vec<Input>>>);

/// A file or a folder.
#[derive(Debug)]
struct Input {
    /// For messages.
    named: PathBuf,
    /// Wherever the program's working folder is by then.
    absolute: PathBuf,
    is_folder: bool,
}

impl Inputs {
    fn all(&self) -> MutexGuard<'_, Vec<Input>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Notes a file or a folder, unless it is known or lies in a folder that is.
    pub(super) fn note(&self, named: &Path, is_folder: bool) {
        let mut all = self.all();
        let is_known = |known: &Input| known.named == named || known.is_folder && named.starts_with(&known.named);
        if all.last().is_some_and(is_known) || all.iter().any(|known| known.is_folder && is_known(known)) {
            return;
        }
        let absolute = path::absolute(named).unwrap_or_else(|_| named.to_owned());
        all.push(Input { named: named.to_owned(), absolute, is_folder });
    }

    /// The files, in the order in which they were opened, each once, wherever the program's working folder is now.
    pub fn files(&self) -> Vec<PathBuf> {
        self.paths(false)
    }

    /// The folders of Zarr stores, as for [`Self::files`].
    pub fn folders(&self) -> Vec<PathBuf> {
        self.paths(true)
    }

    fn paths(&self, of_folders: bool) -> Vec<PathBuf> {
        let mut paths = Vec::new();
        for Input { absolute, .. } in self.all().iter().filter(|input| input.is_folder == of_folders) {
            if !paths.contains(absolute) {
                paths.push(absolute.clone());
            }
        }
        paths
    }

    /// Checks that none of them is a file that will be written.
    ///
    /// # Errors
    /// If one is, whatever name leads to it, as for readers with [`ReadOptions::with_outputs`](super::ReadOptions::with_outputs).
    pub fn check(&self, outputs: &Outputs) -> Result<(), VolumeError> {
        self.all().iter().try_for_each(|Input { named, absolute, is_folder }| match is_folder {
            false => outputs.check_file(named, absolute),
            true => outputs.check_folder(named, absolute),
        })
    }
}

impl PartialEq for Inputs {
    /// Whether both share one list.
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl Eq for Inputs {}
