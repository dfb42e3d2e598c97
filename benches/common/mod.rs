//! What the benches share: their arguments, and scenes by name.

use std::path::Path;

use sheetsplat::scene::{Scene, VolumeSource};

/// A number that may come first, and the names after it.
pub(crate) fn arguments(default: usize) -> (usize, Vec<String>) {
    // Cargo passes --bench.
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| !argument.starts_with("--")).collect();
    match arguments.split_first().map(|(first, rest)| (first.parse(), rest)) {
        Some((Ok(number), rest)) => (number, rest.to_vec()),
        _ => (default, arguments),
    }
}

/// A scene file, a volume file, or a builtin volume.
pub(crate) fn open(name: &str) -> Scene {
    match name.strip_prefix("builtin:") {
        Some(builtin) => Scene::new(VolumeSource::Builtin(builtin.to_owned())),
        None if name.ends_with(".toml") => Scene::open(Path::new(name), &[]).unwrap(),
        None => Scene::new(VolumeSource::File(name.into())),
    }
}

/// What a table calls it.
pub(crate) fn label(name: &str) -> String {
    Path::new(name).file_stem().unwrap().display().to_string()
}
