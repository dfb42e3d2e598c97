//! The keys of a Zarr store and their bytes: files in a folder on disk, in memory or at an address, or in a ZIP archive.

use std::collections::BTreeMap;
use std::fmt::{self, Debug, Formatter};
use std::fs;
use std::io::{ErrorKind, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use super::super::VolumeError;
use super::super::access::Access;
use super::super::error::volume::{invalid, io_error};
use super::super::source::{MAX_HEADER, Source};
use super::super::zip::{Directory, Member};
#[cfg(feature = "http")]
use super::http::Http;
use super::listings::Listings;

/// A store's keys.
pub(super) struct Keys {
    /// The folder, the archive or the address.
    pub(super) path: PathBuf,
    place: Place,
    pub(super) access: Access,
    /// The maximum number of bytes that are read at once.
    limit: AtomicU64,
}

enum Place {
    Folder(Listings),
    /// An archive's files by their names, and what the names of the store's keys begin with.
    Archive(BTreeMap<String, Member>, String),
    #[cfg(feature = "http")]
    Address(Http),
}

impl Debug for Keys {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Keys").field(&self.path).finish()
    }
}

impl Keys {
    /// The keys of the files in a folder.
    pub(super) fn of_folder(path: &Path, access: &Access) -> Self {
        Self::new(path, Place::Folder(Listings::default()), access)
    }

    /// The keys of an archive's files whose names begin with those of a folder.
    pub(super) fn of_archive(path: &Path, folder: &str, access: &Access) -> Result<Self, VolumeError> {
        let mut file = access.open(path)?;
        let members = Directory::read(&mut file)?.members(&mut file, "")?;
        let members: BTreeMap<String, Member> =
            members.into_iter().map(|member| (member.name.clone(), member)).collect();
        let prefix = if folder.is_empty() { String::new() } else { format!("{folder}/") };
        Ok(Self::new(path, Place::Archive(members, prefix), access))
    }

    /// The keys of a store at an address.
    #[cfg(feature = "http")]
    pub(super) fn of_address(path: &Path, access: &Access) -> Result<Self, VolumeError> {
        Ok(Self::new(path, Place::Address(Http::new(path)?), access))
    }

    /// The error for a store at an address.
    #[cfg(not(feature = "http"))]
    pub(super) fn of_address(path: &Path, _: &Access) -> Result<Self, VolumeError> {
        Err(invalid(path, "format", "an address, which needs the feature `http`", "a folder or an archive"))
    }

    /// The keys of the group that holds this store, if it has a name, and the name of this store in it.
    pub(super) fn of_group(&self, group: &str) -> Option<(Self, String)> {
        let parts = |path: &Path| {
            let parent = path.parent().filter(|parent| parent.ends_with(group))?.to_owned();
            Some((parent, path.file_name()?.to_str()?.to_owned()))
        };
        match &self.place {
            Place::Folder(_) => parts(&self.path).map(|(parent, name)| (Self::of_folder(&parent, &self.access), name)),
            Place::Archive(members, prefix) => {
                let (parent, name) = parts(Path::new(prefix))?;
                let place = Place::Archive(members.clone(), format!("{}/", parent.to_str()?));
                Some((Self::new(&self.path, place, &self.access), name))
            }
            #[cfg(feature = "http")]
            Place::Address(_) => {
                let text = self.path.to_str()?;
                let (path, query) = text.split_at(text.find('?').unwrap_or(text.len()));
                let (parent, name) = parts(Path::new(path))?;
                let parent = PathBuf::from(format!("{}{query}", parent.to_str()?));
                Some((Self::of_address(&parent, &self.access).ok()?, name))
            }
        }
    }

    fn new(path: &Path, place: Place, access: &Access) -> Self {
        Self { path: path.to_owned(), place, access: access.clone(), limit: AtomicU64::new(MAX_HEADER) }
    }

    /// Permits to read this number of bytes at once.
    pub(super) fn permit(&self, bytes: u64) {
        self.limit.fetch_max(bytes, Ordering::Relaxed);
    }

    /// The place of a key, for errors.
    pub(super) fn file(&self, key: &str) -> PathBuf {
        match &self.place {
            Place::Folder(_) | Place::Archive(..) => self.path.join(key),
            #[cfg(feature = "http")]
            Place::Address(http) => http.place(key),
        }
    }

    /// A file of metadata; `None` if the store has none with this name.
    pub(super) fn metadata(&self, key: &str) -> Result<Option<Vec<u8>>, VolumeError> {
        #[cfg(feature = "http")]
        if let Place::Address(http) = &self.place {
            return http.whole(key, MAX_HEADER);
        }
        let Some(bytes) = self.bytes(key)? else { return Ok(None) };
        if bytes > MAX_HEADER {
            let found = format!("{bytes} bytes");
            return Err(invalid(&self.file(key), "metadata", found, format!("at most {MAX_HEADER} bytes")));
        }
        self.range(key, 0..bytes).map(Some)
    }

    /// Checks that a store at an address is still there, if it did not hold a key. A folder's listings tell that by themselves.
    pub(super) fn check_presence(&self) -> Result<(), VolumeError> {
        match &self.place {
            Place::Folder(_) | Place::Archive(..) => Ok(()),
            #[cfg(feature = "http")]
            Place::Address(http) => http.check_presence(),
        }
    }

    /// The length of a key's value; `None` if the store has no such key.
    pub(super) fn bytes(&self, key: &str) -> Result<Option<u64>, VolumeError> {
        match &self.place {
            Place::Folder(listings) => self.open(key, listings)?.map(|mut file| file.left()).transpose(),
            Place::Archive(members, prefix) => Ok(members.get(&format!("{prefix}{key}")).map(|member| member.bytes)),
            #[cfg(feature = "http")]
            Place::Address(http) => http.length(key),
        }
    }

    /// All bytes of a key; `None` if the store has no such key.
    pub(super) fn whole(&self, key: &str) -> Result<Option<Vec<u8>>, VolumeError> {
        #[cfg(feature = "http")]
        if let Place::Address(http) = &self.place {
            // The length need not be asked for first.
            let bytes = http.whole(key, self.limit.load(Ordering::Relaxed))?;
            self.count(bytes.as_deref());
            return Ok(bytes);
        }
        let bytes = self.bytes(key)?;
        bytes.map(|bytes| self.range(key, 0..bytes)).transpose()
    }

    /// Some bytes of a key that exists.
    pub(super) fn range(&self, key: &str, range: Range<u64>) -> Result<Vec<u8>, VolumeError> {
        let (path, count) = (self.file(key), range.end - range.start);
        let limit = self.limit.load(Ordering::Relaxed);
        if count > limit {
            return Err(invalid(&path, "chunk", format!("{count} bytes"), format!("at most {limit} bytes")));
        }
        let missing = || io_error(&path)(ErrorKind::NotFound.into());
        match &self.place {
            Place::Folder(listings) => {
                let mut file = self.open(key, listings)?.ok_or_else(missing)?;
                let mut bytes = Vec::new();
                file.reader.seek(SeekFrom::Start(range.start)).map_err(io_error(&path))?;
                file.reader.take(count).read_to_end(&mut bytes).map_err(io_error(&path))?;
                if bytes.len() as u64 == count {
                    return Ok(bytes);
                }
                Err(invalid(&path, "chunk", format!("{} bytes", bytes.len()), format!("{count} bytes")))
            }
            Place::Archive(members, prefix) => {
                let member = members.get(&format!("{prefix}{key}")).ok_or_else(missing)?;
                member.bytes(self.access.open_to_look(&self.path)?, range)
            }
            #[cfg(feature = "http")]
            Place::Address(_) if range.is_empty() => Ok(Vec::new()),
            #[cfg(feature = "http")]
            Place::Address(http) => {
                let bytes = http.range(key, &range)?;
                self.count(bytes.as_deref());
                bytes.ok_or_else(missing)
            }
        }
    }

    /// Counts bytes that came from an address; those of files count themselves.
    #[cfg(feature = "http")]
    fn count(&self, bytes: Option<&[u8]>) {
        if let (Some(read), Some(bytes)) = (self.access.bytes_read(), bytes) {
            read.add(bytes.len() as u64);
        }
    }

    /// Opens the file of a key in a folder; `None` if the folder has no such file.
    ///
    /// # Errors
    /// If the file cannot be opened, or has been removed since the store was opened.
    fn open(&self, key: &str, listings: &Listings) -> Result<Option<Source>, VolumeError> {
        let path = self.file(key);
        let is_listed = listings.have(key, &self.path, &self.access)?;
        if is_listed == Some(false) {
            return Ok(None);
        }
        if self.access.given().is_none() && is_missing(&path) {
            // A link that leads nowhere is refused as one that leads out of the folder to which reading is confined.
            let nearest = path.ancestors().find(|path| fs::symlink_metadata(path).is_ok());
            nearest.map(|nearest| self.access.resolve(nearest)).transpose()?;
            if is_listed == Some(true) && nearest != Some(&path) {
                return Err(io_error(&path)(ErrorKind::NotFound.into()));
            }
            return Ok(None);
        }
        match self.access.open(&path) {
            Ok(file) => Ok(Some(file)),
            Err(VolumeError::Io { source, .. }) if source.kind() == ErrorKind::NotFound && is_listed.is_none() => {
                Ok(None)
            }
            Err(error) => Err(error),
        }
    }
}

/// Whether no file has this path, or one of its folders is no folder.
fn is_missing(path: &Path) -> bool {
    let is_missing = |error: std::io::Error| matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory);
    fs::metadata(path).is_err_and(is_missing)
}
