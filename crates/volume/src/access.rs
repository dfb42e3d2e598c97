//! Limits on reading: which files may be opened, and how much memory their values may use.

use std::borrow::Cow;
use std::fmt::{self, Debug, Display, Formatter};
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::string::FromUtf8Error;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use glam::DVec3;

use super::VolumeError;
use super::address;
use super::error::volume::{invalid, io_error};
use super::file::{BytesRead, Files};
use super::inputs::Inputs;
use super::located::{Located, Notes};
use super::memory;
use super::outputs::Outputs;
use super::rounding::Rounding;
use super::sample_type::SampleType;
use super::series::Selection;
use super::voxels::Wanted;

/// Options for reading volumes, labels and scenes. By default files may lie anywhere.
///
/// ```
/// use sheetsplat_volume::ReadOptions;
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
    /// The number, from 0, of the only channel to read of a file with several; `None` reads all.
    pub channel: Option<u32>,
    /// The number, from 0, of the time to read of a file with several; `None` reads the first.
    pub time: Option<u32>,
    /// The level, from 0 for the finest, to read of a store with several; `None` reads the one that a renderer's
    /// scene chooses, and without a scene the finest, which must fit in memory.
    pub level: Option<u32>,
    /// The series to read of a folder, or of a DICOM file, with several: its number, from 0, or its `SeriesInstanceUID`; `None` reads the largest.
    pub series: Option<String>,
    /// The file with the ranges of the values in a store's chunks, made by `sheetsplat index` ([`StoreIndex`](super::StoreIndex)). Where a scene's volume is
    /// streamed, chunks without visible values are not read.
    pub index: Option<PathBuf>,
    /// Files in memory, which are read instead of the disk's; `None` reads the disk.
    pub files: Option<Files>,
    /// The counter of bytes read, for programs that show progress.
    pub bytes_read: Option<BytesRead>,
    /// The files that will be written, which may not be read.
    pub outputs: Outputs,
    /// The list in which the files that are read are noted, for programs that write files later.
    pub inputs: Option<Inputs>,
}

impl ReadOptions {
    /// These options with files confined to this folder.
    pub fn confined_to(self, folder: impl Into<PathBuf>) -> Self {
        Self { confine: Some(folder.into()), ..self }
    }

    /// These options with one channel of a file with several, counted from 0.
    pub fn with_channel(self, channel: u32) -> Self {
        Self { channel: Some(channel), ..self }
    }

    /// These options with another time of a file with several, counted from 0.
    pub fn with_time(self, time: u32) -> Self {
        Self { time: Some(time), ..self }
    }

    /// These options with another level of a store with several, counted from 0 for the finest.
    pub fn with_level(self, level: u32) -> Self {
        Self { level: Some(level), ..self }
    }

    /// These options with a series of a folder with several: its number, counted from 0, or its `SeriesInstanceUID`.
    pub fn with_series(self, series: impl Into<String>) -> Self {
        Self { series: Some(series.into()), ..self }
    }

    /// These options with an index of the store's chunks. An index that cannot be read, or is another store's, is an error, however small the volume is.
    pub fn with_index(self, index: impl Into<PathBuf>) -> Self {
        Self { index: Some(index.into()), ..self }
    }

    /// These options with files in memory instead of the disk's, where a program has no disk, as in a browser, or does not trust paths. Whatever
    /// names a file then names one of these: a scene, its volumes and labels, and headers with separate data.
    ///
    /// ```
    /// use std::path::Path;
    /// use sheetsplat_volume::Volume;
    /// use sheetsplat_volume::ReadOptions;
    ///
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// let header = "NRRD0001\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nencoding: raw\ndata file: a.raw\n";
    /// let files = [("a.nhdr", header.as_bytes()), ("a.raw", &[0, 1, 2, 3, 4, 5, 6, 7])];
    /// let volume = Volume::open_with(Path::new("a.nhdr"), &ReadOptions::default().with_files(files.into_iter().collect()))?;
    /// assert_eq!(volume.values().at(5), 5.0);
    /// # Ok(())
    /// # }
    /// ```
    pub fn with_files(self, files: Files) -> Self {
        Self { files: Some(files), ..self }
    }

    /// These options with a count of the bytes that are read.
    pub fn counted_by(self, bytes_read: &BytesRead) -> Self {
        Self { bytes_read: Some(bytes_read.clone()), ..self }
    }

    /// The limit of [`Self::memory`], or the default.
    pub fn memory_limit(&self) -> u64 {
        self.memory.unwrap_or_else(memory::default_limit)
    }

    /// The bytes of a memory limit as text: a number, alone or with a unit, as in `2GiB`.
    ///
    /// # Errors
    /// If it is no such text; the error tells what is allowed.
    pub fn parse_memory(text: &str) -> Result<u64, String> {
        memory::parse_size(text)
    }

    /// These options with files that will be written, which may not be read.
    pub fn with_outputs(self, outputs: Outputs) -> Self {
        Self { outputs, ..self }
    }

    /// These options with a list in which the files that are read are noted.
    pub fn noted_in(self, inputs: &Inputs) -> Self {
        Self { inputs: Some(inputs.clone()), ..self }
    }

    /// These options with another memory limit in bytes.
    pub fn with_memory(self, bytes: u64) -> Self {
        Self { memory: Some(bytes), ..self }
    }
}

/// [`ReadOptions`] while a volume and its labels are read. Clones share the memory limit.
#[derive(Clone)]
pub struct Access(Arc<Inner>, Selection, Option<Arc<Notes>>, Option<Arc<str>>, Option<DVec3>, Wanted);

struct Inner {
    given: Option<Files>,
    folder: Option<Folder>,
    limit: u64,
    reserved: AtomicU64,
    bytes_read: Option<BytesRead>,
    outputs: Outputs,
    inputs: Option<Inputs>,
    /// The errors of samples that were read since the last warning.
    rounding: Mutex<Rounding>,
    /// Whether a file that is read by boxes has warned of that.
    has_warned: AtomicBool,
}

/// The folder to which files are confined.
struct Folder {
    /// The path in the options, for errors.
    named: PathBuf,
    canonical: PathBuf,
}

impl Access {
    #[doc(hidden)]
    pub fn new(options: &ReadOptions) -> Result<Self, VolumeError> {
        let folder = |named: &PathBuf| {
            let canonical = named.canonicalize().map_err(io_error(named))?;
            Ok(Folder { named: named.clone(), canonical })
        };
        let given = options.files.clone();
        let folder = options.confine.as_ref().filter(|_| given.is_none()).map(folder).transpose()?;
        let limit = options.memory_limit();
        let (reserved, bytes_read) = (AtomicU64::new(0), options.bytes_read.clone());
        let (outputs, inputs) = (options.outputs.clone(), options.inputs.clone());
        let (rounding, has_warned) = Default::default();
        let inner = Inner { given, folder, limit, reserved, bytes_read, outputs, inputs, rounding, has_warned };
        Ok(Self(
            Arc::new(inner),
            Selection { channel: options.channel, time: options.time, level: options.level },
            None,
            options.series.as_deref().map(Arc::from),
            None,
            Wanted::Values,
        ))
    }

    /// The same access for readers that only note where samples are, and read none.
    pub(super) fn noting(&self) -> (Self, Arc<Notes>) {
        let notes = Arc::new(Notes::default());
        (Self(Arc::clone(&self.0), self.1, Some(Arc::clone(&notes)), self.3.clone(), self.4, self.5), notes)
    }

    /// Whether readers note where samples are, and read none.
    pub(super) fn is_noting(&self) -> bool {
        self.2.is_some()
    }

    /// Notes where samples are.
    pub(super) fn note(&self, located: Located) {
        if let Some(notes) = &self.2 {
            notes.lock().unwrap_or_else(PoisonError::into_inner).push(located);
        }
    }

    /// Notes what samples have lost.
    pub(super) fn note_rounding(&self, rounding: Rounding) {
        if rounding != Rounding::default() {
            let mut all = self.0.rounding.lock().unwrap_or_else(PoisonError::into_inner);
            *all = all.max(rounding);
        }
    }

    /// The errors of samples that were read since the last call.
    pub(super) fn take_rounding(&self) -> Rounding {
        std::mem::take(&mut self.0.rounding.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Warns at the first box of a store with whole numbers that were rounded.
    pub(super) fn warn_of_box(&self, path: &Path, kind: SampleType, values: &[f32]) {
        let rounding = self.take_rounding();
        if rounding.is_of_whole_numbers() && !self.0.has_warned.swap(true, Ordering::Relaxed) {
            rounding.warn(path, kind, values.into());
        }
    }

    /// The volumes that are read from files with several.
    pub(crate) fn selection(&self) -> Selection {
        self.1
    }

    /// The same access to files of one volume, at a level.
    #[doc(hidden)]
    pub fn whole_at(&self, level: u32) -> Self {
        let selection = Selection { level: Some(level), ..Selection::default() };
        Self(Arc::clone(&self.0), selection, None, None, None, self.5)
    }

    /// The same access to other volumes of a file. What the options select goes before it.
    #[doc(hidden)]
    pub fn selecting(&self, other: Selection) -> Self {
        let Selection { channel, time, level } = self.1;
        let (channel, time, level) = (channel.or(other.channel), time.or(other.time), level.or(other.level));
        Self(Arc::clone(&self.0), Selection { channel, time, level }, self.2.clone(), self.3.clone(), self.4, self.5)
    }

    /// The same access to a series of a folder. The one that the options choose goes before it.
    #[doc(hidden)]
    pub fn of_series(&self, series: Option<&str>) -> Self {
        let series = self.3.clone().or_else(|| series.map(Arc::from));
        Self(Arc::clone(&self.0), self.1, self.2.clone(), series, self.4, self.5)
    }

    /// The same access to a file in place of whose spacing the scene states another.
    #[doc(hidden)]
    pub fn of_spacing(&self, spacing: Option<DVec3>) -> Self {
        Self(Arc::clone(&self.0), self.1, self.2.clone(), self.3.clone(), spacing, self.5)
    }

    /// The same access to files whose samples become values, or ids of labels.
    pub(super) fn wanting(&self, wanted: Wanted) -> Self {
        Self(Arc::clone(&self.0), self.1, self.2.clone(), self.3.clone(), self.4, wanted)
    }

    /// The numbers that samples become.
    pub(super) fn wanted(&self) -> Wanted {
        self.5
    }

    /// The spacing that the scene states in place of the file's.
    pub(super) fn spacing(&self) -> Option<DVec3> {
        self.4
    }

    /// The series that is read of a folder with several; `None` for the largest.
    pub(super) fn series(&self) -> Option<&str> {
        self.3.as_deref()
    }

    /// The path to open for a file or folder. If reading is confined, it has no links in it.
    ///
    /// # Errors
    /// If reading is confined and the path leads out of the folder, whether or not the file exists.
    #[doc(hidden)]
    pub fn resolve<'a>(&self, path: &'a Path) -> Result<Cow<'a, Path>, VolumeError> {
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

    /// The counter of bytes read.
    pub(super) fn bytes_read(&self) -> Option<BytesRead> {
        self.0.bytes_read.clone()
    }

    /// The files in memory that are read instead of the disk's.
    pub(super) fn given(&self) -> Option<&Files> {
        self.0.given.as_ref()
    }

    /// Whether a path is the address of a store that is read over HTTP.
    ///
    /// # Errors
    /// If it is, and reading is confined to a folder.
    pub(super) fn is_address(&self, path: &Path) -> Result<bool, VolumeError> {
        if self.given().is_some() || !address::is_address(path) {
            return Ok(false);
        }
        let Some(folder) = &self.0.folder else { return Ok(true) };
        let allowed = format!("files within {}, to which reading is confined", folder.named.display());
        Err(invalid(path, "file", "an address", allowed))
    }

    /// Whether a path is that of a folder.
    ///
    /// # Errors
    /// As for [`Self::resolve`].
    pub(super) fn is_folder(&self, path: &Path) -> Result<bool, VolumeError> {
        match self.given() {
            Some(files) => Ok(files.in_folder(path).next().is_some()),
            None => Ok(self.resolve(path)?.is_dir()),
        }
    }

    /// A file's text, of which no more than the maximum length in bytes is read.
    ///
    /// # Errors
    /// If reading is confined and the path leads out of the folder, or the file is longer; within, if the file cannot be read or is not UTF-8.
    #[doc(hidden)]
    pub fn text(&self, path: &Path, most: u64) -> Result<io::Result<String>, VolumeError> {
        let read = || {
            let mut bytes = Vec::new();
            let file = File::open(self.resolve(path)?).map_err(io_error(path))?;
            file.take(most.saturating_add(1)).read_to_end(&mut bytes).map_err(io_error(path))?;
            Ok(bytes)
        };
        let bytes = match self.given() {
            Some(files) => files.get(path).map(|bytes| bytes.to_vec()).map_err(io_error(path)),
            None => self.check_input(path).and_then(|()| read()),
        };
        let bytes = match bytes.map_err(VolumeError::into_parts) {
            Ok(bytes) => bytes,
            Err(Ok((_, error))) => return Ok(Err(error)),
            Err(Err([origin, field, found, allowed])) => {
                return Err(VolumeError::invalid(origin, field, found, allowed));
            }
        };
        if bytes.len() as u64 > most {
            return Err(invalid(path, "size", format!("more than {most} bytes"), format!("at most {most} bytes")));
        }
        let not_utf8 = |error: FromUtf8Error| format!("found text that is not UTF-8: {}", error.utf8_error());
        Ok(String::from_utf8(bytes).map_err(|error| io::Error::new(io::ErrorKind::InvalidData, not_utf8(error))))
    }

    /// Checks that a file is not one that will be written, and notes that it is read.
    ///
    /// # Errors
    /// If it will.
    #[doc(hidden)]
    pub fn check_input(&self, path: &Path) -> Result<(), VolumeError> {
        self.0.outputs.check_file(path, path)?;
        self.note_input(path, false);
        Ok(())
    }

    /// Checks that none of the files in a folder, or in those below it, will be written, and notes that they are read.
    ///
    /// # Errors
    /// If one will.
    #[cfg(feature = "zarr")]
    pub(super) fn check_folder(&self, path: &Path) -> Result<(), VolumeError> {
        self.0.outputs.check_folder(path, path)?;
        self.note_input(path, true);
        Ok(())
    }

    fn note_input(&self, path: &Path, is_folder: bool) {
        if let Some(inputs) = self.0.inputs.as_ref().filter(|_| self.given().is_none()) {
            inputs.note(path, is_folder);
        }
    }

    /// The number of bytes of memory that are left.
    #[cfg(feature = "zarr")]
    pub(super) fn memory_left(&self) -> u64 {
        self.0.limit.saturating_sub(self.0.reserved.load(Ordering::Relaxed))
    }

    /// Reserves `bytes` of memory, before they are allocated, for what `found` describes.
    ///
    /// # Errors
    /// If fewer bytes are left of the limit.
    #[doc(hidden)]
    pub fn reserve(&self, path: &Path, field: &str, found: impl Display, bytes: u64) -> Result<(), VolumeError> {
        let Inner { limit, reserved, .. } = &*self.0;
        let add = |reserved: u64| reserved.checked_add(bytes).filter(|sum| sum <= limit);
        let Err(before) = reserved.fetch_update(Ordering::Relaxed, Ordering::Relaxed, add) else { return Ok(()) };
        let others = if before > 0 { format!(", of which {before} are taken") } else { String::new() };
        let allowed = format!("at most the memory limit of {limit} bytes{others}");
        Err(invalid(path, field, format!("{found}, which take {bytes} bytes of memory"), allowed))
    }
}

impl Debug for Access {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Access").field(&self.1).finish()
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
