//! Fuzz targets without libFuzzer, for a limited number of inputs or a limited time: see `crates/volume/tests/fuzz/README.md`.

use std::fs;
use std::panic::catch_unwind;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use crate::input::{Target, clean_up};
use crate::mutate::{Random, mutant};

/// The number of inputs per target if no time is set.
const INPUTS: usize = 300;

fn number(variable: &str) -> Option<u64> {
    let text = std::env::var(variable).ok()?;
    Some(text.parse().unwrap_or_else(|error| panic!("{variable}: found {text:?}, allowed: a whole number: {error}")))
}

/// The files in a folder, in order; none if there is no such folder.
pub(crate) fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten();
    let mut paths: Vec<_> = entries.map(|entry| entry.unwrap().path()).filter(|path| path.is_file()).collect();
    paths.sort();
    paths
}

/// Runs every target on its seeds and on mutants of them.
pub(crate) fn run(targets: &[(&str, Target)], seeds: impl Fn(&str) -> Vec<PathBuf>) {
    let seconds = number("SHEETSPLAT_FUZZ_SECONDS");
    let new_seed = || SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_secs();
    let seed = number("SHEETSPLAT_FUZZ_SEED").or(seconds.map(|_| new_seed()));
    println!("SHEETSPLAT_FUZZ_SEED={}", seed.unwrap_or_default());
    let mut random = Random::new();
    (0..seed.unwrap_or_default() % 65_536).for_each(|_| _ = random.below(2));
    for (name, run) in targets {
        let seeds: Vec<Vec<u8>> = seeds(name).iter().map(|path| fs::read(path).unwrap()).collect();
        assert!(!seeds.is_empty(), "{name} has no corpus");
        let try_one = |bytes: &[u8]| {
            if catch_unwind(|| run(bytes)).is_err() {
                let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("fuzz-{name}"));
                fs::write(&path, bytes).unwrap();
                panic!("{name}: a panic for {}", path.display());
            }
        };
        seeds.iter().for_each(|seed| try_one(seed));
        let end = seconds.map(|seconds| Instant::now() + Duration::from_secs(seconds) / targets.len() as u32);
        let mut inputs = 0;
        while end.map_or(inputs < INPUTS, |end| Instant::now() < end) {
            let [whole, other] = [(); 2].map(|()| &seeds[random.below(seeds.len())]);
            try_one(&mutant(&mut random, whole, other));
            inputs += 1;
        }
        println!("{name}: {inputs} inputs from {} seeds", seeds.len());
    }
    clean_up();
}
