//! The growth of frame time with the volume (§6): the opaque builtin head at 64, 128, 256 and 512 voxels, in the same image.
//!
//! `cargo bench --bench growth -- [ROUNDS]` draws each of them once per round.

#![expect(clippy::unwrap_used, reason = "a bench")]

#[expect(dead_code, reason = "not every bench needs all of it")]
mod common;

use sheetsplat::headless::{GpuHeadless, HeadlessOptions};

fn main() {
    let (rounds, _) = common::arguments(7);
    let headless = GpuHeadless::new(&HeadlessOptions::default()).unwrap();
    let names = [64, 128, 256, 512].map(|side| format!("builtin:head:{side}"));
    let mut views = names.each_ref().map(|name| {
        let scene = common::open(name);
        headless.view(scene.load_volume().unwrap(), &scene).unwrap()
    });
    let mut times = [(); 4].map(|()| Vec::new());
    let mut last = None;
    for round in 0..=rounds {
        for (view, times) in views.iter_mut().zip(&mut times) {
            // The camera changes each time, so that buckets are part of the frame.
            view.turn(1.0).unwrap();
            let (ms, stats) = common::timed(&headless, view);
            // The first round compiles shaders and allocates.
            if round > 0 {
                times.push((ms, stats.counts));
            }
            last = Some(stats);
        }
    }
    println!("| volume | voxels in range | sections drawn | quads | ms per frame | relative to the previous line |");
    println!("|---|---|---|---|---|---|");
    let mut before: Option<f64> = None;
    for (name, times) in names.iter().zip(times) {
        let (ms, counts) = common::median(times);
        let ratio = before.map_or(String::new(), |before| format!("{:.2}", ms / before));
        println!(
            "| {name} | {} | {:.1} % | {} | {ms:.0} | {ratio} |",
            counts.voxels_in_range,
            100.0 * counts.sections_rasterized as f64 / counts.sections_total as f64,
            counts.quads,
        );
        before = Some(ms);
    }
    if let Some(stats) = last {
        println!("\n{rounds} rounds; {} ({})", stats.adapter, stats.driver);
    }
}
