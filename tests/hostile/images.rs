//! Mutated images, as `compare` and goldens read them.

use std::fs;
use std::path::{Path, PathBuf};

use sheetsplat::golden::Picture;

use crate::bounded::{Count, alone, bounded};
use crate::mutate::{Random, mutant};

/// The number of mutants of all kinds together.
const FILES: usize = 6_000;

/// The maximum number of bytes allocated per byte of a PNG or EXR file: deflate's best compression, in the smallest pixels, each of which a
/// palette turns into four bytes.
const PER_BYTE: usize = 8 * 1032 * 4;

/// The images that are damaged, copied into a folder.
fn victims(folder: &Path) -> Vec<PathBuf> {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fuzz/corpus");
    let mut paths = Vec::new();
    for kind in ["png-image", "exr-image", "npy-image"] {
        for entry in fs::read_dir(corpus.join(kind)).unwrap() {
            let entry = entry.unwrap();
            let path = folder.join(entry.file_name());
            fs::copy(entry.path(), &path).unwrap();
            paths.push(path);
        }
    }
    paths.sort();
    paths
}

#[test]
fn damaged_images_are_images_or_errors() {
    let _alone = alone();
    let mut random = Random::new();
    let folder = tempfile::tempdir().unwrap();
    let paths = victims(folder.path());
    let wholes: Vec<Vec<u8>> = paths.iter().map(|path| fs::read(path).unwrap()).collect();
    let mut count = Count::default();
    for (path, whole) in paths.iter().zip(&wholes) {
        for round in 0..FILES.div_ceil(paths.len()) {
            let other = &wholes[random.below(wholes.len())];
            let mut mutant = mutant(&mut random, whole, other);
            // A wrong checksum would end the reading of most of them.
            if round % 2 == 0 && path.extension().is_some_and(|extension| extension == "png") {
                mend_checksums(&mut mutant);
            }
            fs::remove_file(path).unwrap();
            fs::write(path, &mutant).unwrap();
            let what = format!("{}, mutant {round}", path.file_name().unwrap().display());
            let pixels =
                |result: &Result<Picture, _>| result.as_ref().map_or(0, |picture| 16 * picture.image.pixels.len());
            match bounded(&what, mutant.len() * PER_BYTE / 4, || Picture::open(path), pixels) {
                Ok(Picture { image, .. }) => {
                    assert_eq!(image.pixels.len(), image.width as usize * image.height as usize, "{what}");
                    count.accepted += 1;
                }
                Err(error) => assert!(error.to_string().contains(": "), "{what}: {error}"),
            }
            count.inputs += 1;
        }
    }
    count.assert_mixed(FILES);
}

/// Gives a PNG's chunks the checksums of their contents.
fn mend_checksums(bytes: &mut [u8]) {
    let mut at = 8;
    while let Some(&length) = bytes.get(at..).and_then(|rest| rest.first_chunk()) {
        let end = at.saturating_add(8 + u32::from_be_bytes(length) as usize);
        let Some(chunk) = bytes.get(at + 4..end) else { return };
        let mut crc = flate2::Crc::new();
        crc.update(chunk);
        let Some(checksum) = bytes.get_mut(end..end + 4) else { return };
        checksum.copy_from_slice(&crc.sum().to_be_bytes());
        at = end + 4;
    }
}
