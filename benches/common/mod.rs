//! Helpers of the benches: arguments, scenes by name, times and medians.

use std::path::Path;
use std::time::Instant;

use sheetsplat::SceneView;
use sheetsplat::headless::GpuHeadless;
use sheetsplat::scene::{Scene, VolumeSource};
use sheetsplat::settings::{Camera, Splatting};
use sheetsplat::stats::Stats;

/// The optional number that comes first, and the names after it.
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
        Some(builtin) => whole(VolumeSource::Builtin(builtin.to_owned())),
        None if name.ends_with(".toml") => Scene::open(Path::new(name), &[]).unwrap(),
        None => whole(VolumeSource::File(name.into())),
    }
}

/// The whole volume is framed, and classified before splatting, as in the scene files that results are compared with.
fn whole(volume: VolumeSource) -> Scene {
    Scene { camera: Camera::default(), splatting: Splatting::default(), ..Scene::new(volume) }
}

/// A scene's name in tables.
pub(crate) fn label(name: &str) -> String {
    Path::new(name).file_stem().unwrap().display().to_string()
}

/// Draws a frame and returns the milliseconds from planning to read-back, and its statistics.
pub(crate) fn timed(headless: &GpuHeadless, view: &mut SceneView) -> (f64, Stats) {
    let start = Instant::now();
    let stats = headless.draw(view).unwrap().stats;
    (start.elapsed().as_secs_f64() * 1e3, stats)
}

/// The run with the median time.
pub(crate) fn median<T>(runs: impl IntoIterator<Item = (f64, T)>) -> (f64, T) {
    let mut runs: Vec<(f64, T)> = runs.into_iter().collect();
    runs.sort_by(|a, b| a.0.total_cmp(&b.0));
    runs.swap_remove(runs.len() / 2)
}
