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

use std::path::PathBuf;

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
            "vti" => &["vti"],
            "vtk" => &["vtk"],
            _ => &[],
        };
        let mut paths = fuzzing::files(&fixtures());
        paths.retain(|path| path.extension().is_some_and(|found| extensions.iter().any(|known| found == *known)));
        paths.extend(fuzzing::files(&corpus.join(target)));
        paths
    });
}
