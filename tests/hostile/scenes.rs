//! Mutated scenes: those of the guide and of the paper's figures.

use std::fs;
use std::path::{Path, PathBuf};

use sheetsplat::scene::Scene;

use crate::bounded::{Count, alone, bounded};
use crate::mutate::{Random, mutant};

/// The number of mutants.
const SCENES: usize = 5_000;

#[test]
fn damaged_scenes_are_scenes_or_errors() {
    let _alone = alone();
    let mut random = Random::new();
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
            let mutant = mutant(&mut random, whole.as_bytes(), other.as_bytes());
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
    count.assert_mixed(SCENES);
}
