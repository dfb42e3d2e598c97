//! The cost of changes (§5.1): touched voxels and time of every setter, compared with making the view again; the iso-range's binary search;
//! and the lists' memory compared with Table 1's claim.
//!
//! `cargo bench --bench lists -- [PAIRS] [SCENE]…` takes scene files or builtin volumes. The default is the bonsai and the CT head if they
//! exist, or else builtin ones.

#![expect(clippy::unwrap_used, reason = "a bench")]

#[path = "../common/mod.rs"]
#[expect(dead_code, reason = "not every bench needs all of it")]
mod common;
mod slice_lists;

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use glam::DVec3;
use sheetsplat::SceneView;
use sheetsplat::headless::{GpuHeadless, HeadlessOptions};
use sheetsplat::internals::gpu::classified_volume::Touched;
use sheetsplat::internals::iso_range::ValueSet;
use sheetsplat::internals::value_list::ValueList;
use sheetsplat::scene::Scene;
use sheetsplat::settings::Light;
use sheetsplat::settings::{Ramp, TransferFunction};

use crate::slice_lists::SliceLists;

/// A change with its name. The number of the repetition makes it differ each time; the last argument holds percentiles of the scene's values.
type Change = (&'static str, fn(&mut SceneView, usize, &[f64]) -> Touched);

const CHANGES: [Change; 7] = [
    ("light", |view, at, _| {
        view.set_light(Light::Direction(DVec3::new(at as f64, 1.0, 2.0))).unwrap();
        Touched::default()
    }),
    ("colour", |view, at, _| {
        let color = Ramp::new(vec![(0.0, DVec3::splat(at as f64 / 100.0)), (255.0, DVec3::ONE)]).unwrap();
        view.set_transfer_function(TransferFunction { color, ..view.volume().transfer().clone() }).unwrap()
    }),
    ("opacity, same support", |view, at, _| {
        let opacity = view.volume().transfer().opacity.points();
        let opacity = opacity.iter().map(|&(value, y)| (value, y * (1.0 - at as f64 / 1000.0))).collect();
        let opacity = Ramp::new(opacity).unwrap();
        view.set_transfer_function(TransferFunction { opacity, ..view.volume().transfer().clone() }).unwrap()
    }),
    ("gradient opacity", |view, at, _| {
        let gradient_opacity = Some(Ramp::new(vec![(at as f64, 0.0), (at as f64 + 20.0, 1.0)]).unwrap());
        view.set_transfer_function(TransferFunction { gradient_opacity, ..view.volume().transfer().clone() }).unwrap()
    }),
    ("iso-range, by 1 %", |view, at, of| view.set_iso_ranges(Some(vec![[of[50 + at % 50], 1e9]])).unwrap()),
    ("iso-range, by half", |view, at, of| view.set_iso_ranges(Some(vec![[of[25 + 50 * (at % 2)], 1e9]])).unwrap()),
    ("camera", |view, _, _| {
        view.turn(3.0).unwrap();
        Touched::default()
    }),
];

fn main() {
    let (pairs, scenes) = common::arguments(7);
    let scenes = if scenes.is_empty() { default_scenes() } else { scenes };
    let headless = GpuHeadless::new(&HeadlessOptions::default()).unwrap();
    for name in &scenes {
        bench(&headless, &common::open(name), &common::label(name), pairs);
    }
}

fn bench(headless: &GpuHeadless, scene: &Scene, name: &str, pairs: usize) {
    let volume = Arc::new(scene.load_volume().unwrap());
    let start = Instant::now();
    let list = ValueList::new(volume.values());
    let sort_ms = milliseconds(start);
    let share = list.bytes() as f64 / (4 * volume.values().len()) as f64;
    println!(
        "\n{name}: sorting by value, once, took {sort_ms:.0} ms; the list takes {:.0} % of its values as f32.",
        100.0 * share
    );

    let transfer = scene.resolve(&volume);
    let set = ValueSet::of(&transfer);
    let search = common::median((0..pairs).map(|_| {
        let start = Instant::now();
        let found = list.within(volume.values(), &set).len();
        (milliseconds(start), found as u64)
    }));
    println!("Extracting the scene's iso-range, {} voxels: {:.2} ms.\n", search.1, search.0);

    // Slice by slice, as in [8] for axis-aligned sheets.
    let start = Instant::now();
    let slices = SliceLists::new(volume.values(), volume.grid(), 2);
    let sort_ms = milliseconds(start);
    let search = common::median((0..pairs).map(|_| {
        let start = Instant::now();
        let of_slice = |slice| slices.within(volume.values(), slice, &set).map(<[u32]>::len).sum::<usize>();
        let found: usize = (0..slices.len()).map(of_slice).sum();
        (milliseconds(start), found as u64)
    }));
    println!("Slice by slice across z: sorted in {sort_ms:.0} ms; {} voxels found in {:.2} ms.\n", search.1, search.0);

    let found = list.within(volume.values(), &set);
    let mut values: Vec<f64> = found.iter().map(|&voxel| volume.values().at(voxel as usize).into()).collect();
    values.sort_by(f64::total_cmp);
    let of: Vec<f64> = (0..=100).map(|percent| values[(values.len() - 1) * percent / 100]).collect();

    println!("| change | voxels entering | leaving | change and prepare, ms | making the view again, ms | ratio |");
    println!("|---|---|---|---|---|---|");
    for (what, change) in CHANGES {
        let mut view = headless.view(volume.clone(), scene).unwrap();
        view.volume().value_list();
        prepare(headless, &mut view);
        // The first change may have to make room.
        change(&mut view, 0, &of);
        prepare(headless, &mut view);
        let mut touched = Touched::default();
        let (mut changed, mut anew) = (Vec::new(), Vec::new());
        for at in 1..=pairs {
            let start = Instant::now();
            touched = change(&mut view, at, &of);
            prepare(headless, &mut view);
            changed.push((milliseconds(start), 0));
            let start = Instant::now();
            prepare(headless, &mut headless.view(volume.clone(), scene).unwrap());
            anew.push((milliseconds(start), 0));
        }
        let (changed, anew) = (common::median(changed).0, common::median(anew).0);
        let rebuilt = if touched.rebuilt { " (rebuilt)" } else { "" };
        println!(
            "| {what}{rebuilt} | {} | {} | {changed:.2} | {anew:.0} | {:.0} |",
            touched.entered,
            touched.left,
            anew / changed
        );
    }
}

/// Prepares a frame, and submits the resulting writes.
fn prepare(headless: &GpuHeadless, view: &mut SceneView) {
    headless.renderer().prepare(headless.device(), headless.queue(), view).unwrap();
    headless.queue().submit([]);
    headless.device().poll(sheetsplat::wgpu::PollType::wait_indefinitely()).unwrap();
}

fn milliseconds(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}

fn default_scenes() -> Vec<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/scenes");
    let scenes = ["bonsai-gradient.toml", "ct-head-opaque.toml"].map(|name| folder.join(name));
    match scenes.iter().all(|scene| scene.exists()) {
        true => scenes.map(|scene| scene.display().to_string()).to_vec(),
        false => ["builtin:head", "builtin:tomato"].map(str::to_owned).to_vec(),
    }
}
