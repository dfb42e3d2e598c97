//! The savings of early splat elimination and tiles (§6, Table 2): the same frame with and without, in interleaved pairs.
//!
//! `cargo bench --bench culling -- [PAIRS] [SCENE]…` takes scene files, volume files or builtin volumes. The default is builtin ones, the nerve
//! side-on (Table 2's worst case), and the scenes and the neuron beside the checkout, if they exist. Scenes in perspective are left out.

#![expect(clippy::unwrap_used, reason = "a bench")]

mod common;

use std::path::{Path, PathBuf};

use sheetsplat::headless::{GpuHeadless, HeadlessOptions};
use sheetsplat::scene::Scene;
use sheetsplat::settings::Projection;

const SIDE_ON: &str = "builtin:nerve, side-on";

fn main() {
    let (pairs, scenes) = common::arguments(7);
    let scenes = if scenes.is_empty() { default_scenes() } else { scenes };
    let headless = GpuHeadless::new(&HeadlessOptions::default()).unwrap();
    println!("| scene | without, ms | µs per section | with, ms | ratio | sections drawn | quads |");
    println!("|---|---|---|---|---|---|---|");
    let mut last = None;
    for name in &scenes {
        let mut scene = open(name);
        if matches!(scene.camera.projection, Projection::Perspective { .. }) {
            continue;
        }
        let mut view = headless.view(scene.load_volume().unwrap(), &scene).unwrap();
        let mut frame = |on: bool| {
            (scene.splatting.culling, scene.splatting.tiles) = (on, on);
            view.set_splatting(scene.splatting).unwrap();
            common::timed(&headless, &mut view)
        };
        // The first frame compiles shaders.
        frame(true);
        let (mut without, mut with) = (Vec::new(), Vec::new());
        for _ in 0..pairs {
            without.push(frame(false));
            with.push(frame(true));
        }
        let ((slow, all), (fast, stats)) = (common::median(without), common::median(with));
        let (all, drawn) = (all.counts, stats.counts);
        println!(
            "| {} | {slow:.0} | {:.2} | {fast:.0} | {:.1} | {:.1} % | {} |",
            common::label(name),
            slow * 1e3 / all.sections_rasterized as f64,
            slow / fast,
            100.0 * drawn.sections_rasterized as f64 / drawn.sections_total as f64,
            drawn.quads,
        );
        last = Some(stats);
    }
    if let Some(stats) = last {
        println!("\n{pairs} pairs; {} ({})", stats.adapter, stats.driver);
    }
}

fn open(name: &str) -> Scene {
    if name == SIDE_ON {
        let mut scene = common::open("builtin:nerve");
        scene.camera.direction = glam::DVec3::X;
        return scene;
    }
    common::open(name)
}

fn default_scenes() -> Vec<String> {
    let shared = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared");
    let entries = std::fs::read_dir(shared.join("scenes"));
    let mut files: Vec<PathBuf> =
        entries.map(|entries| entries.map(|entry| entry.unwrap().path()).collect()).unwrap_or_default();
    files.sort();
    files.extend(Some(shared.join("data/neuron.nrrd")).filter(|file| file.exists()));
    let builtin = ["builtin:head", "builtin:nerve", SIDE_ON, "builtin:tomato"].map(str::to_owned);
    builtin.into_iter().chain(files.iter().map(|file| file.display().to_string())).collect()
}
