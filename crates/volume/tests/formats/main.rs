//! Readers of all formats: files that other programs wrote (`tests/fixtures/make.py` of the workspace), voxel for voxel, and files that are damaged or
//! contradict themselves; and the procedural volumes.

#![expect(clippy::unwrap_used, reason = "tests")]

mod assumed;
mod boxes;
mod builtin;
mod colors;
#[cfg(unix)]
mod confined;
mod data_files;
mod dicom;
mod dispatch;
mod escapes;
mod holes;
#[cfg(feature = "http")]
mod http;
mod in_memory;
mod label_grids;
mod label_ids;
mod limits;
mod metaimage;
mod mgh;
mod nifti;
mod npy;
mod npz;
mod nrrd;
mod raw;
mod refused;
mod rounding;
#[cfg(feature = "http")]
#[path = "../../../../tests/common/http.rs"]
mod server;
mod several;
#[path = "../../../../tests/common/shared.rs"]
mod shared;
mod shear;
mod tiff;
mod tiff_planes;
mod turned;
mod units;
mod values;
mod vtk;
mod zarr;
mod zarr_axes;

use std::cell::RefCell;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Once;

use glam::{DMat3, DVec3, UVec3};
use sheetsplat_volume::{Orientation, Volume, VolumeError};
use tempfile::TempDir;

use refused::assert_refused;
use shared::shared;

/// The dimensions of every fixture.
const DIMS: UVec3 = UVec3::new(5, 4, 3);
/// The spacing of fixtures that have one.
const SPACING: DVec3 = DVec3::new(0.5, 2.0, 3.0);
const ORIGIN: DVec3 = DVec3::new(10.0, -20.5, 30.0);

/// The axes of rotated fixtures, which are those of no anatomical space.
fn rotation() -> DMat3 {
    let third = |x: f64, y: f64, z: f64| DVec3::new(x, y, z) / 3.0;
    DMat3::from_cols(third(2.0, 2.0, -1.0), third(-1.0, 2.0, 2.0), third(2.0, -1.0, 2.0))
}

/// The values of every fixture, before slope and intercept.
fn values() -> Vec<f32> {
    (0..60).map(|i| (i % 5 + 10 * (i / 5 % 4) + 100 * (i / 20)) as f32).collect()
}

fn fixture(name: &str) -> PathBuf {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/fixtures")).join(name)
}

/// Opens a fixture and compares every voxel.
#[track_caller]
fn open(name: &str) -> Volume {
    let volume = Volume::open(&fixture(name)).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!((volume.dims(), in_file_order(&volume)), (DIMS, values()), "{name}");
    volume
}

/// The values of a volume in its file's own order.
fn in_file_order(volume: &Volume) -> Vec<f32> {
    let at = |index: u32| volume.value(volume.grid().file_voxel(volume.grid().voxel_at(index)));
    (0..volume.dims().element_product()).map(at).collect()
}

#[track_caller]
fn assert_near(found: DVec3, expected: DVec3) {
    assert!((found - expected).abs().max_element() < 1e-5, "{found}, not {expected}");
}

/// Asserts spacing, and the file's axes and origin, these in RAS; the volume's own axes are right-handed.
#[track_caller]
fn assert_lies(volume: &Volume, axes: DMat3, origin: DVec3) {
    let Orientation { axes: found, origin: first } = volume.file_orientation().unwrap();
    assert_eq!(volume.grid().is_turned(), axes.determinant() < 0.0);
    assert!(!volume.orientation().unwrap().is_mirrored());
    for i in 0..3 {
        assert_near(found.col(i), axes.col(i));
    }
    assert_near(first, origin);
    assert_near(volume.spacing(), SPACING);
}

/// A folder for one test's files.
struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn write(&self, name: &str, parts: &[&[u8]]) -> PathBuf {
        let path = self.0.path().join(name);
        // Overwriting a file may wait for the disk; creating a new one does not.
        _ = fs::remove_file(&path);
        fs::write(&path, parts.concat()).unwrap();
        path
    }

    fn open(&self, name: &str, bytes: &[u8]) -> Result<Volume, VolumeError> {
        Volume::open(&self.write(name, &[bytes]))
    }
}

thread_local! {
    /// The readers' warnings on a test's thread.
    static WARNINGS: RefCell<Vec<String>> = const { RefCell::new(Vec::new()) };
}

struct Logger;

impl log::Log for Logger {
    fn enabled(&self, _: &log::Metadata<'_>) -> bool {
        true
    }

    fn log(&self, record: &log::Record<'_>) {
        WARNINGS.with_borrow_mut(|warnings| warnings.push(record.args().to_string()));
    }

    fn flush(&self) {}
}

/// The result of a function, and the readers' warnings during its run.
fn warned<T>(run: impl FnOnce() -> T) -> (T, Vec<String>) {
    static START: Once = Once::new();
    START.call_once(|| {
        log::set_logger(&Logger).unwrap();
        log::set_max_level(log::LevelFilter::Warn);
    });
    WARNINGS.take();
    (run(), WARNINGS.take())
}

/// Asserts that readers warn exactly once, with these words.
#[track_caller]
fn assert_warned(warnings: &[String], words: &str) {
    assert!(matches!(warnings, [warning] if warning.contains(words)), "{words:?}: {warnings:?}");
}

/// A fixture's bytes with some replaced.
fn patched(name: &str, at: usize, bytes: &[u8]) -> Vec<u8> {
    let mut all = fs::read(fixture(name)).unwrap();
    all[at..at + bytes.len()].copy_from_slice(bytes);
    all
}

/// A fixture's bytes with some text replaced.
#[track_caller]
fn replaced(name: &str, text: &str, instead: &str) -> Vec<u8> {
    let bytes = fs::read(fixture(name)).unwrap();
    let at = bytes.windows(text.len()).position(|window| window == text.as_bytes());
    let at = at.unwrap_or_else(|| panic!("{name}: no {text}"));
    [&bytes[..at], instead.as_bytes(), &bytes[at + text.len()..]].concat()
}

/// Asserts that no prefix of a file is a volume, and neither is a longer file.
fn assert_exact(name: &str, whole: &[u8]) {
    let folder = Folder::new();
    assert!(folder.open(name, whole).is_ok(), "{name}");
    for length in 0..whole.len() {
        let result = folder.open(name, &whole[..length]);
        assert!(result.is_err(), "{name}: {length} of {} bytes", whole.len());
    }
    let longer = [whole, b"\n"].concat();
    assert!(matches!(folder.open(name, &longer), Err(VolumeError::Invalid { .. })), "{name}: one byte more");
}
