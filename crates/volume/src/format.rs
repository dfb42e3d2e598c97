//! File formats and how a file's format is determined.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::{Arc, PoisonError};

use super::access::Access;
use super::address::archive_and_inner;
use super::error::volume::invalid;
use super::guard::guarded;
use super::head::{head, is_bare_dicom};
use super::loaded::Loaded;
use super::seek::FileStore;
use super::store::Store;
use super::{Grid, VolumeError, folder, nrrd, turned};

type Reader = fn(&Path, &Access) -> Result<Loaded, VolumeError>;

/// Reads a volume from a folder, given those of its files that are of the format.
type FolderReader = fn(&Path, &[PathBuf], &Access) -> Result<Loaded, VolumeError>;

/// A format and its reader.
struct Format {
    name: &'static str,
    /// The extensions of its files.
    extensions: &'static [&'static str],
    /// Whether a file that begins with these bytes is certainly of this format.
    is_magic: fn(&[u8]) -> bool,
    /// The reader, or the feature that would compile it.
    read: Result<Reader, &'static str>,
    /// The reader of a folder of slices, if the format has them.
    read_folder: Option<FolderReader>,
}

/// A module's reader, or the feature that would compile it.
macro_rules! reader {
    ($feature:literal, $read:path) => {{
        #[cfg(feature = $feature)]
        let read: Result<_, &'static str> = Ok($read as _);
        #[cfg(not(feature = $feature))]
        let read = Err($feature);
        read
    }};
}

/// A module's reader of folders, if it is compiled.
macro_rules! folder_reader {
    ($feature:literal, $read:path) => {{
        #[cfg(feature = $feature)]
        let read: Option<FolderReader> = Some($read as _);
        #[cfg(not(feature = $feature))]
        let read = None;
        read
    }};
}

const DICOM: &str = "DICOM";
const NPZ: &str = "NPZ";
const ZARR: &str = "Zarr";

/// Formats whose files, if they are uncompressed, are read by boxes.
const SEEKABLE: [&str; 4] = ["NRRD", "NIfTI", "MetaImage", "NPY"];

/// The allowed choice of volumes whose format has no series.
const NO_SERIES: &str = "no series, which only DICOM has";

/// Formats with one slice per file of a folder.
const SLICES: [&str; 2] = ["TIFF", DICOM];

static FORMATS: [Format; 11] = [
    // The preamble before `DICM` may be the beginning of any other file, often of a TIFF (PS3.10 7.1), so that this format comes first. The group of
    // the element after it tells it from another format's text.
    Format {
        name: DICOM,
        extensions: &[".dcm"],
        is_magic: |head| head.get(128..134) == Some(b"DICM\x02\0"),
        read: reader!("dicom", super::dicom::read),
        read_folder: folder_reader!("dicom", super::dicom::read_folder),
    },
    Format {
        name: "NRRD",
        extensions: &[".nrrd", ".nhdr"],
        is_magic: |head| head.starts_with(b"NRRD000"),
        read: Ok(nrrd::read),
        read_folder: None,
    },
    Format {
        name: "NIfTI",
        extensions: &[".nii", ".nii.gz", ".hdr", ".img", ".hdr.gz", ".img.gz"],
        // Other files may hold the magic, which is not at their beginning, among their data.
        is_magic: |head| {
            let [size, swapped] =
                head.first_chunk().map_or([0; 2], |&size| [u32::from_le_bytes(size), u32::from_be_bytes(size)]);
            let is_sized = |bytes: u32| size == bytes || swapped == bytes;
            is_sized(348) && matches!(head.get(344..348), Some(b"n+1\0" | b"ni1\0"))
                || is_sized(540) && matches!(head.get(4..8), Some(b"n+2\0" | b"ni2\0"))
        },
        read: reader!("nifti", super::nifti::read),
        read_folder: None,
    },
    Format {
        name: "MGH",
        extensions: &[".mgh", ".mgz", ".mgh.gz"],
        // The file begins with its version, 1, and may be gzipped.
        is_magic: |_| false,
        read: reader!("mgh", super::mgh::read),
        read_folder: None,
    },
    Format {
        name: "MetaImage",
        extensions: &[".mha", ".mhd"],
        is_magic: |head| head.starts_with(b"ObjectType = Image"),
        read: reader!("metaimage", super::metaimage::read),
        read_folder: None,
    },
    Format {
        name: "NPY",
        extensions: &[".npy"],
        is_magic: |head| head.starts_with(b"\x93NUMPY"),
        read: reader!("npy", super::npy::read),
        read_folder: None,
    },
    Format {
        name: ZARR,
        extensions: &[".zip", ".ozx"],
        // A store is a folder, or an archive that begins like other ZIP archives.
        is_magic: |_| false,
        read: reader!("zarr", super::zarr::read),
        read_folder: None,
    },
    Format {
        name: NPZ,
        extensions: &[".npz"],
        is_magic: |head| head.starts_with(b"PK\x03\x04"),
        read: reader!("npy", super::npz::read),
        read_folder: None,
    },
    Format {
        name: "TIFF",
        extensions: &[".tif", ".tiff"],
        is_magic: |head| matches!(head.get(..4), Some(b"II*\0" | b"MM\0*" | b"II+\0" | b"MM\0+")),
        read: reader!("tiff", super::tiff::read),
        read_folder: folder_reader!("tiff", super::tiff::read_folder),
    },
    Format {
        name: "VTI",
        extensions: &[".vti", ".vtr"],
        // Other texts may hold the element's name, too.
        is_magic: |head| {
            let text = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head).trim_ascii_start();
            text.starts_with(b"<") && text.windows(8).any(|window| window == b"<VTKFile")
        },
        read: reader!("vtk", super::vtk::read_image_data),
        read_folder: None,
    },
    Format {
        name: "VTK",
        extensions: &[".vtk"],
        is_magic: |head| head.starts_with(b"# vtk DataFile"),
        read: reader!("vtk", super::vtk::read_legacy),
        read_folder: None,
    },
];

/// Reads a file and returns the name of its format, determined by its first bytes or else by its name; or reads a folder of slices,
/// whose format the first bytes of all its files determine.
pub(super) fn read(path: &Path, access: &Access) -> Result<(&'static str, Loaded), VolumeError> {
    let (file, _) = archive_and_inner(path);
    let format = format_at(path, access)?;
    if let Some(level) = access.selection().level.filter(|&level| level > 0 && format.is_none_or(|of| of.name != ZARR))
    {
        return Err(invalid(path, "level", level, "0, the only one"));
    }
    if let Some(series) = access.series().filter(|_| format.is_some_and(|of| of.name != DICOM)) {
        return Err(invalid(path, "series", series, NO_SERIES));
    }
    let found = match format {
        None if access.is_folder(file)? => return read_folder(path, access),
        Some(Format { name, read: Ok(read), .. }) => return Ok((name, guarded(path, || read(path, access))?)),
        Some(Format { name, read: Err(feature), .. }) => needs(name, feature),
        None => match path.extension() {
            Some(extension) => format!("\".{}\"", extension.display()),
            None => "none".to_owned(),
        },
    };
    let list = |compiled: bool| {
        let formats = FORMATS.iter().filter(|format| format.read.is_ok() == compiled);
        let names = formats.map(|Format { name, extensions, .. }| format!("{name} ({})", extensions.join(", ")));
        names.collect::<Vec<_>>().join(", ")
    };
    let mut allowed = format!("{}, or raw samples by `volume.dims` and `volume.type`", list(true));
    if FORMATS.iter().any(|format| format.read.is_err()) {
        allowed = format!("{allowed}; not compiled in: {}", list(false));
    }
    Err(invalid(path, "format", found, allowed))
}

/// Opens the selected channels of a file that is read by boxes.
pub(super) fn open_stores(path: &Path, access: &Access) -> Result<Vec<Arc<dyn Store>>, VolumeError> {
    let format = format_at(path, access)?;
    if let Some(series) = access.series().filter(|_| format.is_some_and(|of| of.name != DICOM)) {
        return Err(invalid(path, "series", series, NO_SERIES));
    }
    let found = match format {
        #[cfg(feature = "zarr")]
        Some(Format { name: ZARR, .. }) => {
            let stores = super::zarr::open(path, ZARR, access)?;
            let is_left_handed = stores.iter().any(|store| turned::is_left_handed(&**store));
            return Ok(turned::all(stores, is_left_handed));
        }
        Some(Format { name, read: Err(feature), .. }) => needs(name, feature),
        Some(Format { name, read: Ok(read), .. }) if SEEKABLE.contains(name) => {
            let (noting, notes) = access.noting();
            let loaded = guarded(path, || read(path, &noting))?;
            let notes = notes.lock().unwrap_or_else(PoisonError::into_inner);
            let stores = FileStore::of_header(path, (name, &loaded), &notes, access)?;
            return Ok(turned::all(stores, loaded.is_left_handed()));
        }
        Some(Format { name, .. }) => (*name).to_owned(),
        None => "another".to_owned(),
    };
    let allowed = format!("one that is read by boxes: {ZARR}, and uncompressed {}", SEEKABLE.join(", "));
    Err(invalid(path, "format", found, allowed))
}

/// The grids of a store's levels, from the finest; empty for files of other formats.
pub fn levels(path: &Path, access: &Access) -> Result<Vec<Grid>, VolumeError> {
    match format_at(path, access)? {
        #[cfg(feature = "zarr")]
        Some(Format { name: ZARR, .. }) => super::zarr::grids(path, access),
        _ => Ok(Vec::new()),
    }
}

/// The format of a file or of a Zarr store; `None` if it is unknown, or for another folder.
fn format_at(path: &Path, access: &Access) -> Result<Option<&'static Format>, VolumeError> {
    if access.is_address(path)? {
        return Ok(FORMATS.iter().find(|format| format.name == ZARR));
    }
    let (file, _) = archive_and_inner(path);
    if access.is_folder(file)? {
        let is_store = is_zarr(file, access)?;
        return Ok(FORMATS.iter().find(|format| format.name == ZARR && is_store));
    }
    let head = head(file, access)?;
    Ok(format_of(file, &head).map(|(format, _)| format))
}

/// Whether a folder holds the metadata of a Zarr store.
fn is_zarr(folder: &Path, access: &Access) -> Result<bool, VolumeError> {
    for name in ["zarr.json", ".zgroup", ".zattrs", ".zarray"] {
        match access.open_to_look(&folder.join(name)) {
            Ok(_) => return Ok(true),
            Err(VolumeError::Io { source, .. }) if source.kind() == ErrorKind::NotFound => {}
            Err(error) => return Err(error),
        }
    }
    Ok(false)
}

/// A file's format, and whether its first bytes determined it.
fn format_of(path: &Path, head: &[u8]) -> Option<(&'static Format, bool)> {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    let is_named = |format: &Format| format.extensions.iter().any(|extension| name.ends_with(extension));
    let named = FORMATS.iter().find(|format| is_named(format));
    // Ambiguous first bytes count only if the name does not contradict them.
    let is_bare =
        |format: &Format| format.name == DICOM && is_bare_dicom(head) && named.is_none_or(|named| named.name == DICOM);
    let is_other_archive = |format: &Format| format.name == NPZ && named.is_some_and(|named| named.name == ZARR);
    let by_head = |format: &&Format| (format.is_magic)(head) && !is_other_archive(format) || is_bare(format);
    FORMATS.iter().find(by_head).map(|format| (format, true)).or(named.map(|format| (format, false)))
}

fn read_folder(path: &Path, access: &Access) -> Result<(&'static str, Loaded), VolumeError> {
    let mut slices: Vec<(&Format, Vec<PathBuf>)> = Vec::new();
    let files = folder::files(path, access)?;
    let count = files.len();
    let is_of_slices = |format: &Format| SLICES.contains(&format.name);
    let mut left_out = Vec::new();
    for file in files {
        let head = head(&file, access)?;
        let format = match format_of(&file, &head) {
            Some((format, true)) if is_of_slices(format) => format,
            other => {
                let name = file.file_name().unwrap_or_default().to_string_lossy();
                // Slices often have names without an extension, or names that end with a number.
                let extension = file.extension().unwrap_or_default().to_string_lossy();
                let may_be_slice = !name.starts_with('.') && extension.bytes().all(|byte| byte.is_ascii_digit());
                if other.map_or(may_be_slice, |(format, _)| is_of_slices(format)) {
                    left_out.push(name.into_owned());
                }
                continue;
            }
        };
        match slices.iter_mut().find(|(other, _)| other.name == format.name) {
            Some((_, files)) => files.push(file),
            None => slices.push((format, vec![file])),
        }
    }
    if !left_out.is_empty() && !slices.is_empty() {
        let (path, count, names) = (path.display(), left_out.len(), &left_out[..left_out.len().min(8)].join(", "));
        let more = if count > 8 { ", …" } else { "" };
        log::warn!("{path}: {count} files are not slices and are left out: {names}{more}");
    }
    let found = match slices.as_slice() {
        [] => format!("{count} files, no slices among them"),
        [(Format { name, read_folder: Some(read), .. }, files)] => {
            if let Some(series) = access.series().filter(|_| *name != DICOM) {
                return Err(invalid(path, "series", series, NO_SERIES));
            }
            return Ok((name, guarded(path, || read(path, files, access))?));
        }
        [(Format { name, read: Err(feature), .. }, _)] => needs(name, feature),
        several => {
            let counts = several.iter().map(|(Format { name, .. }, files)| format!("{} {name} files", files.len()));
            counts.collect::<Vec<_>>().join(" and ")
        }
    };
    let allowed = format!("a volume file, or a folder with the slices of one volume, {}", SLICES.join(" or "));
    Err(invalid(path, "folder", found, allowed))
}

fn needs(name: &str, feature: &str) -> String {
    format!("{name}, which needs the feature `{feature}`")
}

#[cfg(all(test, not(feature = "nifti")))]
mod tests {
    use std::path::Path;

    use crate::Volume;

    #[test]
    fn formats_left_out_are_named() {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/fixtures/sform.nii");
        let message = Volume::open(&file).unwrap_err().to_string();
        for part in
            ["format: found NIfTI, which needs the feature `nifti`, allowed: NRRD (", "not compiled in: NIfTI (.nii"]
        {
            assert!(message.contains(part), "{message}");
        }
    }
}
