//! Mutated files: every reader, images' too, and the scene parser return a whole result or an error, without panicking or hanging, and
//! without using more memory than the file's size warrants.
//!
//! This is a single test, because the allocator counts for the whole process. `tests/fuzz` searches further.

#![expect(clippy::unwrap_used, reason = "tests")]

mod images;
mod mutate;
mod promises;

use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use glam::UVec3;
use peak_alloc::PeakAlloc;
use sheetsplat::scene::Scene;
use sheetsplat::volume::{Labels, RawLayout, ReadOptions, SampleType, Volume, VolumeError};

use mutate::{Random, mutant};

#[global_allocator]
static ALLOCATOR: PeakAlloc = PeakAlloc;

/// The number of mutants of files, for all readers together, and of scenes.
const FILES: usize = 20_000;
const SCENES: usize = 5_000;

/// The bytes that a load may use beyond four times the file's size and three times the values'. Users may be promised 64 MiB.
const ROOM: usize = 8 << 20;

/// The counts of a run.
#[derive(Default)]
struct Count {
    inputs: usize,
    accepted: usize,
}

/// A file that is mutated, and the path to open then: the file, its header, or its folder.
struct Victim {
    file: PathBuf,
    open: PathBuf,
}

/// The fixtures, copied into a folder.
fn victims(folder: &Path) -> Vec<Victim> {
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures");
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
                    _ if to == folder || to.ends_with("channels") => copy.clone(),
                    _ => to.to_owned(),
                };
                victims.push(Victim { file: copy, open });
            }
        }
    };
    files(&fixtures, folder);
    for slices in ["series", "slices", "channels"] {
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

/// Runs a function that must not panic or use more memory than `bytes` plus its result. CI ends runs that take too long.
fn bounded<T>(what: &str, bytes: usize, run: impl Fn() -> T, size: impl Fn(&T) -> usize) -> T {
    let before = ALLOCATOR.current_usage();
    ALLOCATOR.reset_peak_usage();
    let result = catch_unwind(AssertUnwindSafe(&run)).unwrap_or_else(|_| panic!("{what}: a panic"));
    let peak = ALLOCATOR.peak_usage().saturating_sub(before);
    let allowed = ROOM + 4 * bytes + 3 * size(&result);
    assert!(peak <= allowed, "{what}: {peak} bytes of memory, not {allowed}");
    result
}

fn mutate_files(random: &mut Random) -> Count {
    let folder = tempfile::tempdir().unwrap();
    let victims = victims(folder.path());
    let mut count = Count::default();
    let wholes: Vec<Vec<u8>> = victims.iter().map(|victim| fs::read(&victim.file).unwrap()).collect();
    for (Victim { file, open: path }, whole) in victims.iter().zip(&wholes) {
        for round in 0..FILES.div_ceil(victims.len()) {
            let other = &wholes[random.below(wholes.len())];
            let mutant = mutant(random, whole, other);
            // Overwriting a file may wait for the disk; creating a new one does not.
            fs::remove_file(file).unwrap();
            fs::write(file, &mutant).unwrap();
            let what = format!("{}, mutant {round}", file.strip_prefix(folder.path()).unwrap().display());
            let values = |result: &Result<Volume, _>| result.as_ref().map_or(0, |volume| 4 * volume.values().len());
            match bounded(&what, size(path), || open(path), values) {
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
                _ = bounded(&what, size(path), || Labels::open_with(path, &options(path)), labels);
            }
            count.inputs += 1;
        }
        fs::write(file, whole).unwrap();
    }
    count
}

fn mutate_scenes(random: &mut Random) -> Count {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let guide = fs::read_to_string(root.join("docs/guide/scene-files.md")).unwrap();
    let commented = guide.split("```toml\n").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
    let mut scenes = vec![commented.to_owned(), commented.replace("\n# ", "\n")];
    let paper = fs::read_dir(root.join("assets/paper")).unwrap().map(|entry| entry.unwrap().path());
    let mut paths: Vec<PathBuf> = paper.filter(|path| path.extension().is_some_and(|toml| toml == "toml")).collect();
    paths.sort();
    scenes.extend(paths.iter().map(|path| fs::read_to_string(path).unwrap()));
    let mut count = Count::default();
    for (number, whole) in scenes.iter().enumerate() {
        for round in 0..SCENES.div_ceil(scenes.len()) {
            let other = &scenes[random.below(scenes.len())];
            let mutant = mutant(random, whole.as_bytes(), other.as_bytes());
            let text = String::from_utf8_lossy(&mutant);
            let what = format!("scene {number}, mutant {round}");
            let parse = || Scene::parse(&text, "a scene", Path::new("."), &[]);
            match bounded(&what, text.len(), parse, |_| 0) {
                Ok(_) => count.accepted += 1,
                Err(error) => assert!(error.to_string().contains("a scene"), "{what}: {error}"),
            }
            count.inputs += 1;
        }
    }
    count
}

#[test]
fn damaged_files_are_volumes_or_errors() {
    let folder = tempfile::tempdir().unwrap();
    promises::are_refused(folder.path());
    promises::of_stores_are_refused(folder.path());
    let mut random = Random::new();
    for (what, least, count) in [
        ("files", FILES, mutate_files(&mut random)),
        ("scenes", SCENES, mutate_scenes(&mut random)),
        ("images", images::FILES, images::mutated(&mut random)),
    ] {
        let Count { inputs, accepted } = count;
        println!("{what}: {accepted} of {inputs} accepted");
        assert!(inputs >= least);
        // The mutants are neither harmless nor hopeless.
        assert!(20 * accepted > inputs && 20 * accepted < 19 * inputs, "{what}: {accepted} of {inputs}");
    }
}
