#![no_main]

use std::path::Path;

use sheetsplat::Scene;

// A line of override, then a scene.
libfuzzer_sys::fuzz_target!(|text: &str| {
    let (set, scene) = text.split_once('\0').unwrap_or(("", text));
    let sets = if set.is_empty() { vec![] } else { vec![set.to_owned()] };
    _ = Scene::parse(scene, "a scene", Path::new("."), &sets);
});
