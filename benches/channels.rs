//! What several channels cost (SPEC §10): frames of four channels of one volume against frames of one, by turns.
//!
//! `cargo bench --bench channels -- [ROUNDS] [SCENE]…` takes the number of frames of each, and scene files or builtin volumes. Every voxel is in all
//! channels, whose opacities together are those of the one, so that as much is hidden. The camera turns by a degree from frame to frame. Each scene is drawn
//! as it is, and as a haze that hides little.

#![expect(clippy::unwrap_used, reason = "a bench")]

#[expect(dead_code, reason = "not every bench needs all of it")]
mod common;

use std::time::Instant;

use glam::DVec3;
use sheetsplat::headless::{Backend, Headless, HeadlessOptions};
use sheetsplat::scene::{Channel, Scene, VolumeSource};
use sheetsplat::settings::{Classification, Compositing, Ramp, Rasterizer};
use sheetsplat::volume::Volume;

/// Pixels along the image's sides.
const SIDE: u32 = 512;
const COUNT: usize = 4;

/// What opacities are multiplied by: nothing, and for the haze.
const FACTORS: [f64; 2] = [1.0, 0.03];

/// What is compared, and how many times the frames of one channel those of four may cost.
const CASES: [(Classification, Backend, f64); 4] = [
    (Classification::Before, Backend::Cpu, 2.5),
    (Classification::Before, Backend::Gpu, 2.5),
    (Classification::After, Backend::Cpu, 4.0),
    (Classification::After, Backend::Gpu, 4.0),
];

fn main() {
    let (rounds, scenes) = common::arguments(9);
    let scenes = if scenes.is_empty() { vec!["builtin:head:128".to_owned()] } else { scenes };
    println!("| scene | classification | backend | one channel, ms | {COUNT} channels, ms | ratio | allowed |");
    println!("|---|---|---|---|---|---|---|");
    for (name, factor) in scenes.iter().flat_map(|name| FACTORS.map(|factor| (name, factor))) {
        let mut one = common::open(name);
        let volume = one.load_volume().unwrap();
        (one.image.width, one.image.height) = (SIDE, SIDE);
        one.splatting.compositing = Compositing::Exponential;
        one.splatting.rasterizer = Rasterizer::Tiles;
        one = one.explicit_all_around(&volume);
        one.channels[0].transfer.opacity = with_opacities(&one, |opacity| opacity * factor);
        let (all, several) = several(&volume, &one);
        for (classification, backend, allowed) in CASES {
            let of = |scene: &Scene| {
                let mut scene = scene.clone();
                scene.splatting.classification = classification;
                scene
            };
            let options = HeadlessOptions::default().with_backend(backend);
            let headless = Headless::for_scenes(&options, [&one]).unwrap();
            let cases = [(&volume, of(&one)), (&all, of(&several))];
            let [first, second] = by_turns(&headless, rounds, cases);
            let ratio = second / first;
            let [scene, backend] = [common::label(name), backend.to_string()];
            let scene = if factor < 1.0 { format!("{scene}, a haze") } else { scene };
            let classification = format!("{classification:?}").to_lowercase();
            println!("| {scene} | {classification} | {backend} | {first:.1} | {second:.1} | {ratio:.2} | {allowed} |");
        }
    }
}

/// A scene's opacities, changed.
fn with_opacities(scene: &Scene, change: impl Fn(f64) -> f64) -> Option<Ramp<f64>> {
    let points = scene.channels[0].transfer.opacity.as_ref().unwrap().points();
    Ramp::new(points.iter().map(|&(at, opacity)| (at, change(opacity))).collect()).ok()
}

/// The volume as several channels, and the scene that shows each in a colour of its own, with opacities that together are the scene's.
fn several(volume: &Volume, scene: &Scene) -> (Volume, Scene) {
    let all = volume.clone().with_channels("bench", vec![volume.clone(); COUNT - 1]).unwrap();
    let mut transfer = scene.channels[0].transfer.clone();
    transfer.opacity = with_opacities(scene, |opacity| 1.0 - (1.0 - opacity).powf(1.0 / COUNT as f64));
    let of_channel = |color: DVec3| {
        let mut transfer = transfer.clone();
        transfer.color = Some(Ramp::new(vec![(0.0, color)]).unwrap());
        transfer
    };
    let mut scene = scene.clone().with_transfer(of_channel(DVec3::X));
    for color in [DVec3::Y, DVec3::Z, DVec3::ONE] {
        let mut channel = Channel::new(VolumeSource::Memory);
        channel.transfer = of_channel(color);
        scene.channels.push(channel);
    }
    (all, scene)
}

/// The median milliseconds of the frames of two scenes.
fn by_turns(headless: &Headless, rounds: usize, cases: [(&Volume, Scene); 2]) -> [f64; 2] {
    let mut views = cases.map(|(volume, scene)| (headless.view(volume.clone(), &scene).unwrap(), scene.camera));
    let mut times = [Vec::new(), Vec::new()];
    for round in 0..=rounds {
        for ((view, camera), times) in views.iter_mut().zip(&mut times) {
            view.set_camera(camera.turned(round as f64)).unwrap();
            let start = Instant::now();
            headless.draw(view).unwrap();
            // The first frame also prepares what the others keep.
            if round > 0 {
                times.push((start.elapsed().as_secs_f64() * 1e3, ()));
            }
        }
    }
    times.map(|times| common::median(times).0)
}
