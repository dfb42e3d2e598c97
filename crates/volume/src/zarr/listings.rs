//! The names in a store's folders, each of which is listed once: most chunks of a sparse store are missing, and asking the disk for each takes long.

use std::collections::{HashMap, HashSet};
use std::ffi::OsString;
use std::fs;
use std::io::ErrorKind;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use super::super::VolumeError;
use super::super::access::Access;
use super::super::error::volume::io_error;

/// The maximum number of names that are kept, of about 100 bytes each. Files of larger folders are looked for one by one.
const MAX_NAMES: usize = 1 << 18;

/// The names in the folders of a store, by the folders' keys. A name that was listed and is gone later has been removed while the store was read.
#[derive(Debug, Default)]
pub(super) struct Listings(Mutex<HashMap<String, Arc<Names>>>);

/// The names in a folder.
#[derive(Debug)]
enum Names {
    All(HashSet<OsString>),
    /// They may not be read, or are too many.
    Unknown,
}

impl Listings {
    /// Whether a store in a folder on disk has a key; `None` if only opening its file tells.
    ///
    /// # Errors
    /// If a folder cannot be listed because it has been removed, or lies outside the one to which reading is confined.
    pub(super) fn have(&self, key: &str, store: &Path, access: &Access) -> Result<Option<bool>, VolumeError> {
        // File systems may write other letters in ways of their own.
        let is_plain = key.is_ascii() && key.split('/').all(|part| !["", ".", ".."].contains(&part));
        if access.given().is_some() || !is_plain {
            return Ok(None);
        }
        let (folder, name) = key.rsplit_once('/').unwrap_or(("", key));
        let listed = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let known = listed().get(folder).cloned();
        let names = match known {
            Some(names) => names,
            None if !folder.is_empty() && self.have(folder, store, access)? == Some(false) => return Ok(Some(false)),
            None => {
                let names = Arc::new(Names::of(&store.join(folder), access)?);
                let mut listed = listed();
                if listed.values().map(|names| names.count()).sum::<usize>() + names.count() > MAX_NAMES {
                    listed.clear();
                }
                listed.insert(folder.to_owned(), Arc::clone(&names));
                names
            }
        };
        Ok(match &*names {
            Names::All(names) => Some(names.contains(name.as_ref() as &std::ffi::OsStr)),
            Names::Unknown => None,
        })
    }
}

impl Names {
    fn of(folder: &Path, access: &Access) -> Result<Self, VolumeError> {
        let entries = match fs::read_dir(access.resolve(folder)?) {
            Ok(entries) => entries,
            Err(error) if error.kind() == ErrorKind::NotADirectory => return Ok(Self::All(HashSet::new())),
            // A link that leads nowhere has nothing in it.
            Err(error) if error.kind() == ErrorKind::NotFound && fs::symlink_metadata(folder).is_ok() => {
                return Ok(Self::All(HashSet::new()));
            }
            Err(error) if error.kind() == ErrorKind::NotFound => return Err(io_error(folder)(error)),
            Err(_) => return Ok(Self::Unknown),
        };
        let mut names = HashSet::new();
        for entry in entries {
            match entry {
                Ok(entry) if names.len() < MAX_NAMES => _ = names.insert(entry.file_name()),
                _ => return Ok(Self::Unknown),
            }
        }
        Ok(Self::All(names))
    }

    /// The number of names, and one for the folder.
    fn count(&self) -> usize {
        1 + if let Self::All(names) = self { names.len() } else { 0 }
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::super::super::ReadOptions;
    use super::*;

    /// No file is looked for by itself: when the store is gone, the answers are the same.
    #[test]
    fn folders_are_listed_once() {
        let place = tempfile::tempdir().unwrap();
        let store = place.path().join("a.zarr");
        fs::create_dir_all(store.join("0/c/7")).unwrap();
        fs::write(store.join("0/c/7/1"), "chunk").unwrap();
        let access = Access::new(&ReadOptions::default()).unwrap();
        let listings = Listings::default();
        let have = |key: &str| listings.have(key, &store, &access);
        assert_eq!(have("0/c/7/1").unwrap(), Some(true));
        let listed = || listings.0.lock().unwrap().len();
        assert_eq!(listed(), 4);
        fs::rename(&store, place.path().join("gone")).unwrap();
        for chunk in 0..50_000 {
            let key = format!("0/c/{}/{chunk}", chunk % 300);
            assert_eq!(have(&key).unwrap(), Some(key == "0/c/7/1"), "{key}");
        }
        assert_eq!(listed(), 4);
        assert_eq!([have("0/c/7/é").unwrap(), have("../b").unwrap(), have("0//c").unwrap()], [None; 3]);
        // A store that is gone before a folder was listed is no store without chunks.
        let late = Listings::default();
        assert!(late.have("0/c/7/1", &store, &access).is_err());
    }
}
