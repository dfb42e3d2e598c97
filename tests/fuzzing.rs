//! The fuzz targets without libFuzzer, for a limited time: see `tests/fuzz/README.md`.
#![expect(clippy::unwrap_used, reason = "tests")]

#[path = "hostile/mutate.rs"]
mod mutate;
#[path = "fuzz/targets.rs"]
mod targets;

use std::fs;
use std::panic::catch_unwind;
use std::path::Path;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use mutate::{Random, mutant};
use targets::TARGETS;

/// The number of inputs per target if no time is set.
const INPUTS: usize = 300;

fn number(variable: &str) -> Option<u64> {
    let text = std::env::var(variable).ok()?;
    Some(text.parse().unwrap_or_else(|error| panic!("{variable}: found {text:?}, allowed: a whole number: {error}")))
}

/// A target's initial inputs: its corpus, and the fixture volumes with its extension.
fn seeds(target: &str) -> Vec<Vec<u8>> {
    let tests = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests");
    let files = |folder: &Path| -> Vec<_> {
        let entries = fs::read_dir(folder).into_iter().flatten();
        entries.map(|entry| entry.unwrap().path()).filter(|path| path.is_file()).collect()
    };
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
    let mut paths = files(&tests.join("fixtures"));
    paths.retain(|path| path.extension().is_some_and(|extension| extensions.iter().any(|known| extension == *known)));
    paths.extend(files(&tests.join("fuzz/corpus").join(target)));
    paths.sort();
    paths.iter().map(|path| fs::read(path).unwrap()).collect()
}

#[test]
fn no_target_panics() {
    let seconds = number("SHEETSPLAT_FUZZ_SECONDS");
    let clock = || SystemTime::now().duration_since(UNIX_EPOCH).unwrap();
    let seed = number("SHEETSPLAT_FUZZ_SEED").or(seconds.map(|_| clock().as_secs()));
    println!("SHEETSPLAT_FUZZ_SEED={}", seed.unwrap_or_default());
    let mut random = Random::new();
    (0..seed.unwrap_or_default() % 65_536).for_each(|_| _ = random.below(2));
    for (name, run) in TARGETS {
        let seeds = seeds(name);
        assert!(!seeds.is_empty(), "{name} has no corpus");
        let try_one = |bytes: &[u8]| {
            if catch_unwind(|| run(bytes)).is_err() {
                let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("fuzz-{name}"));
                fs::write(&path, bytes).unwrap();
                panic!("{name}: a panic for {}", path.display());
            }
        };
        seeds.iter().for_each(|seed| try_one(seed));
        let end = seconds.map(|seconds| clock() + Duration::from_secs(seconds) / TARGETS.len() as u32);
        let mut inputs = 0;
        while end.map_or(inputs < INPUTS, |end| clock() < end) {
            let [whole, other] = [(); 2].map(|()| &seeds[random.below(seeds.len())]);
            try_one(&mutant(&mut random, whole, other));
            inputs += 1;
        }
        println!("{name}: {inputs} inputs from {} seeds", seeds.len());
    }
    targets::clean_up();
}
