//! Random frames by the tile rasterizer against the f64 evaluation.

use glam::DVec3;
use sheetsplat::image::Image;
use sheetsplat::internals::reference;
use sheetsplat::scene::Scene;
use sheetsplat::settings::{Classification, Compositing, Gradient, Projection, Ramp, Rasterizer, SlabProfile};
use sheetsplat::volume::Volume;

use crate::common::cases::cases;
use crate::common::compare::{assert_at_least, assert_at_most, decibels};
use crate::common::devices::gpu;
use crate::common::images::{largest_difference, rms};
use crate::common::{COMPOSITINGS, Random, SPACINGS, random_eye, random_volume, transfer};

/// A random volume, and a scene of it that classifies after splatting, unculled.
fn random_case(random: &mut Random, has_eye: bool) -> (Volume, Scene) {
    let spacing = random.pick(&SPACINGS);
    let volume = random_volume(random, (7.0, 24.0), spacing);
    let mut scene = crate::common::scene(61, 45);
    scene.splatting.classification = Classification::After;
    scene.splatting.rasterizer = Rasterizer::Tiles;
    scene.splatting.culling = false;
    scene.image.background = [0.0; 4];
    scene.camera.direction = random.direction();
    scene.camera.up = DVec3::new(0.1, 0.2, 1.0);
    let half = (volume.grid().center() * volume.spacing()).length();
    let height = random.pick(&[1.0, 2.0, 6.0]) * half;
    scene.camera.projection = Projection::Orthographic { height: Some(height) };
    if has_eye {
        scene.camera = random_eye(random, volume.grid());
    }
    scene.splatting.slab_width = random.pick(&[0.5, 1.0, 1.0, 1.7]);
    scene.splatting.radius = random.pick(&[1.4, 2.0, 2.7, 4.0]);
    scene.channels[0].transfer = transfer(
        &[(0.0, [0.2, 0.3, 0.9]), (120.0, [0.9, 0.6, 0.1]), (250.0, [1.0, 0.9, 0.8])],
        &[(15.0, 0.0), (40.0, 0.1), (130.0, 0.05), (200.0, 0.7)],
    );
    if random.bits().is_multiple_of(3) {
        scene.channels[0].transfer.gradient_opacity = Some(Ramp::new(vec![(0.0, 0.1), (30.0, 1.0)]).unwrap());
    }
    if random.bits().is_multiple_of(4) {
        scene.channels[0].transfer.iso_ranges = Some(vec![[20.0, 90.0], [140.0, 1000.0]]);
    }
    if random.bits().is_multiple_of(3) {
        let normal = random.direction();
        scene.clip.planes = vec![[normal.x, normal.y, normal.z, 0.2 * half]];
    }
    (volume, scene)
}

fn shown(image: &Image) -> usize {
    image.pixels.iter().filter(|pixel| pixel[3] > 0.02).count()
}

/// Draws random frames, changed by `change`, and compares them with the f64 evaluation.
fn compare(seed: u64, has_eye: bool, least: f64, change: impl Fn(&mut Random, &mut Volume, &mut Scene)) {
    let gpu = gpu();
    let mut random = Random(seed);
    for compositing in COMPOSITINGS {
        let mut worst = f64::INFINITY;
        let mut case = 0;
        for attempt in 0.. {
            let (mut volume, mut scene) = random_case(&mut random, has_eye);
            scene.splatting.compositing = compositing;
            // A cubic slab is empty or bent by whether its ends reach an opacity, which rounding decides here and there: `random` leaves such pixels out.
            scene.splatting.slab_profile = SlabProfile::Linear;
            change(&mut random, &mut volume, &mut scene);
            let expected = reference::render(&volume, &[scene.channels[0].transfer.resolve(&volume)], &scene).unwrap();
            // A picture that is nearly empty tests nothing.
            if shown(&expected) < 100 {
                assert!(attempt < 100, "{compositing:?}: too few cases show something");
                continue;
            }
            let found = gpu.render_volume(volume, &scene).unwrap().image;
            let psnr = decibels(rms(&found, &expected));
            println!("{compositing:?} case {case}: {psnr:.1} dB");
            worst = worst.min(psnr);
            assert_at_least(psnr, least, format!("{compositing:?}, case {case}: {scene:?}"));
            case += 1;
            if case == cases(2, 6) {
                break;
            }
        }
        println!("{compositing:?}: at least {worst:.1} dB");
    }
}

#[test]
fn orthographic_frames_agree_with_the_f64_evaluation() {
    compare(17, false, 80.0, |_, _, _| {});
}

#[test]
fn frames_with_an_eye_agree_with_the_f64_evaluation() {
    compare(18, true, 60.0, |_, _, _| {});
}

#[test]
fn frames_with_the_kernels_gradient_agree_with_the_f64_evaluation() {
    for has_eye in [false, true] {
        compare(19, has_eye, 55.0, |_, _, scene| scene.shading.gradient = Gradient::Kernel);
    }
}

#[test]
fn frames_with_holes_agree_with_the_f64_evaluation() {
    compare(20, false, 60.0, |random, volume, _| {
        let mut values = volume.values().to_vec();
        for value in &mut values {
            if random.bits().is_multiple_of(40) {
                *value = f32::NAN;
            }
        }
        *volume = Volume::new("holes", volume.dims(), volume.spacing(), values).unwrap();
    });
}

/// Where so much lies behind a patch that it is drawn in several dispatches.
#[test]
fn frames_of_many_dispatches_agree_with_the_f64_evaluation() {
    let gpu = gpu();
    let mut random = Random(22);
    for (slab_width, direction) in [(1.0, DVec3::Z), (1.0, DVec3::new(0.4, 0.9, -0.3)), (0.6, DVec3::X)] {
        let volume = random_volume(&mut random, (44.0, 49.0), SPACINGS[0]);
        let (_, mut scene) = random_case(&mut random, false);
        (scene.channels[0].transfer.iso_ranges, scene.channels[0].transfer.gradient_opacity) = (None, None);
        scene.clip.planes.clear();
        (scene.splatting.slab_width, scene.splatting.radius, scene.camera.direction) = (slab_width, 2.0, direction);
        let half = (volume.grid().center() * volume.spacing()).length();
        // Pixels as large as two voxels.
        scene.camera.projection = Projection::Orthographic { height: Some(2.0 * half) };
        scene.splatting.compositing = Compositing::Xray;
        let found = gpu.render_volume(volume.clone(), &scene).unwrap().image;
        let expected = reference::render(&volume, &[scene.channels[0].transfer.resolve(&volume)], &scene).unwrap();
        assert!(shown(&expected) > 100, "{}", shown(&expected));
        assert_at_least(decibels(rms(&found, &expected)), 80.0, format!("{slab_width} {direction}"));
    }
}

/// With any threshold `T` no channel of any pixel changes by more than `1 - T`.
#[test]
fn culling_keeps_its_guarantee() {
    let gpu = gpu();
    let mut random = Random(21);
    let (mut fewer, mut seen) = (0, 0);
    for case in 0..8 {
        let (volume, mut scene) = random_case(&mut random, case % 2 == 1);
        scene.splatting.compositing = [Compositing::Linear, Compositing::Exponential][case / 2 % 2];
        scene.channels[0].transfer.opacity = Some(Ramp::new(vec![(15.0, 0.0), (40.0, 0.5), (200.0, 1.0)]).unwrap());
        let whole = gpu.render_volume(volume.clone(), &scene).unwrap();
        seen += shown(&whole.image);
        for threshold in [0.8, 1.0] {
            (scene.splatting.culling, scene.splatting.opacity_threshold) = (true, threshold);
            let culled = gpu.render_volume(volume.clone(), &scene).unwrap();
            let allowed = 1.0 - threshold + 1e-6;
            assert_at_most(largest_difference(&culled.image, &whole.image), allowed, format!("case {case}: {scene:?}"));
            let drawn = [&culled, &whole].map(|frame| frame.stats.counts.sections_rasterized);
            fewer += usize::from(drawn[0] < drawn[1]);
        }
    }
    assert!(fewer > 4 && seen > 2000, "{fewer}, {seen} pixels");
}
