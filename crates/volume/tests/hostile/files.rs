//! Mutated fixtures.

use std::fs;
use std::path::{Path, PathBuf};

use glam::UVec3;
use sheetsplat_volume::{Labels, RawLayout, ReadOptions, SampleType, Volume, VolumeError};

use crate::bounded::{Count, alone, bounded};
use crate::fixtures;
use crate::mutate::{Random, mutant};

/// Asserts that no decoder panicked: readers make an error of it, so that it would pass for damage that they saw.
pub(crate) fn no_panic<T>(what: &str, result: &Result<T, VolumeError>) {
    if let Err(error) = result {
        let message = error.to_string();
        assert!(!message.contains("a decoder that gave up"), "{what}: {message}");
    }
}

/// The number of mutants for all readers together.
const FILES: usize = 20_000;

/// A file that is mutated, and the path to open then: the file, its header, or its folder.
struct Victim {
    file: PathBuf,
    open: PathBuf,
}

/// The fixtures, copied into a folder.
fn victims(folder: &Path) -> Vec<Victim> {
    let fixtures = fixtures();
    let mut victims = Vec::new();
    let mut files = |from: &Path, to: &Path| {
        let mut paths: Vec<PathBuf> = fs::read_dir(from).unwrap().map(|entry| entry.unwrap().path()).collect();
        paths.sort();
        for path in paths {
            let copy = to.join(path.file_name().unwrap());
            if path.is_dir() {
                fs::create_dir(&copy).unwrap();
            } else if path.extension().is_none_or(|extension| extension != "py") {
                fs::copy(&path, &copy).unwrap();
                let open = match copy.file_name().unwrap().to_str().unwrap() {
                    "flipped.raw" => to.join("flipped.mhd"),
                    "zlib.zraw" => to.join("zlib.mhd"),
                    "part0.bin" => to.join("list.mhd"),
                    "part1.bin" => to.join("pattern.nhdr"),
                    "two.npz" => to.join("two.npz:values"),
                    _ if to == folder || to.ends_with("channels") || to.ends_with("dicom") => copy.clone(),
                    _ => to.to_owned(),
                };
                victims.push(Victim { file: copy, open });
            }
        }
    };
    files(&fixtures, folder);
    for slices in ["series", "slices", "channels", "dicom"] {
        files(&fixtures.join(slices), &folder.join(slices));
    }
    // A store in an archive.
    let archive = folder.join("ngff.ozx");
    fs::copy(fixtures.join("zarr/ngff.ozx"), &archive).unwrap();
    victims.push(Victim { file: archive.clone(), open: archive });
    for name in STORES {
        let store = folder.join(name);
        copy_store(&fixtures.join(name), &store, &store, &mut victims);
    }
    victims
}

/// Zarr stores: of version 2, and of version 3 with shards.
const STORES: [&str; 2] = ["zarr/image-0.4.zarr", "zarr/ngff.zarr"];

/// Copies all files of a store, each of which is mutated while the store is opened.
fn copy_store(from: &Path, to: &Path, store: &Path, victims: &mut Vec<Victim>) {
    fs::create_dir_all(to).unwrap();
    let mut paths: Vec<PathBuf> = fs::read_dir(from).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    for path in paths {
        let copy = to.join(path.file_name().unwrap());
        if path.is_dir() {
            copy_store(&path, &copy, store, victims);
        } else {
            fs::copy(&path, &copy).unwrap();
            victims.push(Victim { file: copy, open: store.to_owned() });
        }
    }
}

/// The options for a path. A store may lack chunks, so that its size limits its values only where memory does.
fn options(path: &Path) -> ReadOptions {
    let is_store = path.extension().is_some_and(|extension| extension == "zarr" || extension == "ozx");
    if is_store { ReadOptions::default().with_memory(4 << 20) } else { ReadOptions::default() }
}

fn open(path: &Path) -> Result<Volume, VolumeError> {
    if path.extension().is_some_and(|extension| extension == "raw") {
        let layout = RawLayout { dims: UVec3::new(5, 4, 3), sample_type: SampleType::F32, big_endian: true, offset: 7 };
        return Volume::open_raw(path, &layout);
    }
    Volume::open_with(path, &options(path))
}

/// The size in bytes of a file, or of the files in a folder.
fn size(path: &Path) -> usize {
    if path.is_dir() {
        return fs::read_dir(path).unwrap().map(|entry| size(&entry.unwrap().path())).sum();
    }
    fs::metadata(path).map_or(0, |metadata| metadata.len() as usize)
}

#[test]
fn damaged_files_are_volumes_or_errors() {
    let _alone = alone();
    let mut random = Random::new();
    let folder = tempfile::tempdir().unwrap();
    let victims = victims(folder.path());
    let mut count = Count::default();
    let wholes: Vec<Vec<u8>> = victims.iter().map(|victim| fs::read(&victim.file).unwrap()).collect();
    for (Victim { file, open: path }, whole) in victims.iter().zip(&wholes) {
        for round in 0..FILES.div_ceil(victims.len()) {
            let other = &wholes[random.below(wholes.len())];
            let mutant = mutant(&mut random, whole, other);
            // Overwriting a file may wait for the disk; creating a new one does not.
            fs::remove_file(file).unwrap();
            fs::write(file, &mutant).unwrap();
            let what = format!("{}, mutant {round}", file.strip_prefix(folder.path()).unwrap().display());
            let values = |result: &Result<Volume, _>| result.as_ref().map_or(0, |volume| 4 * volume.values().len());
            let opened = bounded(&what, size(path), || open(path), values);
            no_panic(&what, &opened);
            match opened {
                Ok(volume) => {
                    assert_eq!(volume.values().len(), volume.dims().element_product() as usize, "{what}");
                    assert!(
                        volume.spacing().min_element() > 0.0 && volume.values().iter().any(|x| x.is_finite()),
                        "{what}"
                    );
                    count.accepted += 1;
                }
                // A damaged header may name any other file for the data.
                Err(error) => assert!(error.to_string().contains(": "), "{what}: {error}"),
            }
            if round % 4 == 0 {
                let labels = |result: &Result<Labels, _>| result.as_ref().map_or(0, |labels| 2 * labels.values.len());
                no_panic(&what, &bounded(&what, size(path), || Labels::open_with(path, &options(path)), labels));
            }
            count.inputs += 1;
        }
        fs::write(file, whole).unwrap();
    }
    count.assert_mixed(FILES);
}
