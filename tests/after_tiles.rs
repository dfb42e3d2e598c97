//! Classification after splatting by tiles: whole frames against the f64 twin (SPEC §9).
#![expect(clippy::unwrap_used, reason = "tests")]

#[expect(dead_code, reason = "not every file needs all of it")]
mod common;

use glam::DVec3;
use sheetsplat::headless::Headless;
use sheetsplat::image::Image;
use sheetsplat::internals::reference;
use sheetsplat::scene::Scene;
use sheetsplat::settings::{Classification, Compositing, Projection, Ramp, Rasterizer};
use sheetsplat::volume::Volume;

use common::compare::{assert_at_least, decibels};
use common::images::rms;
use common::{BY_AMOUNTS, Random, gpu, random_volume, transfer};

/// A random volume, and a scene of it that classifies after splatting, orthographic.
fn random_case(random: &mut Random) -> (Volume, Scene) {
    let spacing = random.pick(&[[1.0, 1.0, 1.0], [1.0, 1.0, 3.0], [3.0, 1.0, 2.0]]);
    let volume = random_volume(random, (9.0, 30.0), spacing);
    let mut scene = common::scene(67, 50);
    scene.splatting.classification = Classification::After;
    scene.splatting.rasterizer = Rasterizer::Tiles;
    scene.splatting.culling = false;
    scene.image.background = [0.0; 4];
    scene.camera.direction = random.direction();
    scene.camera.up = DVec3::new(0.1, 0.2, 1.0);
    let half = (volume.grid().center() * volume.spacing()).length();
    let height = random.pick(&[1.0, 2.0, 6.0]) * half;
    scene.camera.projection = Projection::Orthographic { height: Some(height) };
    scene.splatting.slab_width = random.pick(&[0.5, 1.0, 1.0, 1.7]);
    scene.splatting.radius = random.pick(&[1.4, 2.0, 2.0, 2.7]);
    scene.transfer = transfer(
        &[(0.0, [0.2, 0.3, 0.9]), (120.0, [0.9, 0.6, 0.1]), (250.0, [1.0, 0.9, 0.8])],
        &[(15.0, 0.0), (40.0, 0.1), (130.0, 0.05), (200.0, 0.7)],
    );
    if random.bits() % 3 == 0 {
        scene.transfer.gradient_opacity = Some(Ramp::new(vec![(0.0, 0.1), (30.0, 1.0)]).unwrap());
    }
    (volume, scene)
}

/// The frame and what the twin makes of the scene.
fn frames(gpu: &Headless, volume: &Volume, scene: &Scene) -> [Image; 2] {
    let found = gpu.render_volume(volume.clone(), scene).unwrap();
    [found.image, reference::render(volume, &scene.transfer.resolve(volume), scene).unwrap()]
}

fn shown(image: &Image) -> usize {
    image.pixels.iter().filter(|pixel| pixel[3] > 0.02).count()
}

#[test]
fn random_frames_are_those_of_the_twin() {
    let gpu = gpu();
    let mut random = Random(17);
    for compositing in BY_AMOUNTS {
        let mut seen = 0;
        for case in 0..10 {
            let (volume, mut scene) = random_case(&mut random);
            scene.splatting.compositing = compositing;
            let [found, expected] = frames(&gpu, &volume, &scene);
            seen += shown(&expected);
            let psnr = decibels(rms(&found, &expected));
            println!("{compositing:?} case {case}: {psnr:.1} dB, {:?}", scene.splatting);
            assert_at_least(psnr, 60.0, format!("{compositing:?}, case {case}: {scene:?}"));
        }
        assert!(seen > 5000, "{compositing:?}: {seen}");
    }
}
