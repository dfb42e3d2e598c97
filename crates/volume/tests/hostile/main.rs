//! Hostile files: every reader returns a whole volume or an error, without panicking or hanging, and without using more memory than the file's size
//! warrants. The fuzz targets search further.

#![expect(clippy::unwrap_used, reason = "tests")]

mod bounded;
mod files;
mod fuzzing;
#[path = "../fuzz/input.rs"]
mod input;
mod mutate;
mod promises;
#[path = "../fuzz/targets.rs"]
mod targets;

use std::fs;
use std::path::PathBuf;

use sheetsplat_volume::Volume;

/// The folder of the workspace's fixtures.
fn fixtures() -> PathBuf {
    concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/fixtures").into()
}

/// Starts from each target's corpus and from the fixtures with its extension.
#[test]
fn no_target_panics() {
    let _alone = bounded::alone();
    let corpus = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fuzz/corpus"));
    fuzzing::run(&targets::TARGETS, |target| {
        let extensions: &[&str] = match target {
            "nrrd" => &["nrrd", "nhdr"],
            "nifti" => &["nii"],
            "metaimage" => &["mha"],
            "mgh" => &["mgh"],
            "npy" => &["npy"],
            "tiff" => &["tif"],
            "dicom" => &["dcm"],
            "vti" => &["vti", "vtr"],
            "vtk" => &["vtk"],
            _ => &[],
        };
        let mut paths = fuzzing::files(&fixtures());
        paths.extend(["dicom", "dicom/icons"].iter().flat_map(|folder| fuzzing::files(&fixtures().join(folder))));
        paths.retain(|path| path.extension().is_some_and(|found| extensions.iter().any(|known| found == *known)));
        paths.extend(fuzzing::files(&corpus.join(target)));
        paths
    });
}

/// Folders of DICOM files of several series, times and places, some of which are damaged.
#[test]
fn no_folder_panics() {
    let _alone = bounded::alone();
    let names =
        ["series/IM1", "series/IM2", "dicom/icons/0.dcm", "dicom/icons/1.dcm", "dicom/times.dcm", "dicom/nuclear.dcm"];
    let whole = names.map(|name| fs::read(fixtures().join(name)).unwrap());
    let temporary = tempfile::tempdir().unwrap();
    let mut random = mutate::Random::new();
    let mut read = 0;
    for _ in 0..200 {
        for (at, bytes) in whole.iter().enumerate() {
            let path = temporary.path().join(at.to_string());
            _ = fs::remove_file(&path);
            // Most folders lack some of the files.
            if random.below(3) == 0 {
                continue;
            }
            let other = &whole[random.below(whole.len())];
            let is_damaged = random.below(2) == 0;
            let bytes = if is_damaged { mutate::mutant(&mut random, bytes, other) } else { bytes.clone() };
            fs::write(path, bytes).unwrap();
        }
        if let Ok(volume) = Volume::open(temporary.path()) {
            assert_eq!(volume.values().len(), volume.dims().element_product() as usize);
            read += 1;
        }
    }
    assert!(read > 0);
}
