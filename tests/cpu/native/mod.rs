//! The native CPU backend: whole frames against the f64 twin, the same bytes with any number of threads, and early splat elimination.
//! `cargo test --test cpu native:: -- --nocapture` prints what was measured.

mod after;
mod chunks;
#[cfg(feature = "zarr")]
mod levels;
mod modes;
mod picks;
mod random;
mod regions;
mod same_bytes;
mod scenes;
#[cfg(feature = "zarr")]
mod stores;
mod streams;
mod surfaces;
mod values;

use glam::{DVec3, UVec3};
use sheetsplat::cpu;
use sheetsplat::headless::Rendering;
use sheetsplat::image::Image;
use sheetsplat::internals::reference;
use sheetsplat::scene::Scene;
use sheetsplat::settings::{Clip, Economies, Light, Method, Order, Projection, Ramp};
use sheetsplat::volume::{Volume, builtin};

use crate::common::images::{bits, largest_difference};
use crate::common::{BY_AMOUNTS, Random, SPACINGS, camera, random_eye, random_volume, scene, transfer};

/// PSNR that is asked for, dB (SPEC §12 asks for 80).
pub(crate) const REQUIRED: f64 = 100.0;

/// What f32 sums may differ by.
const ROUNDING: f64 = 2e-5;

pub(crate) fn draw(volume: &Volume, scene: &Scene) -> Rendering {
    let rendering = cpu::render(volume.clone(), scene).unwrap();
    let is_finite = rendering.image.pixels.as_flattened().iter().all(|channel| channel.is_finite());
    assert!(is_finite, "not finite: {scene:?}");
    rendering
}

pub(crate) fn twin(volume: &Volume, scene: &Scene) -> Image {
    reference::render(volume, &[scene.channels[0].transfer.resolve(volume)], scene).unwrap()
}

/// PSNR of premultiplied RGBA, peak 1, over all pixels.
pub(crate) fn psnr(actual: &Image, expected: &Image) -> f64 {
    assert_eq!((actual.width, actual.height), (expected.width, expected.height));
    let (actual, expected) = (actual.pixels.as_flattened(), expected.pixels.as_flattened());
    let squares = actual.iter().zip(expected).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2));
    -10.0 * (squares.sum::<f64>() / actual.len() as f64).log10()
}

/// How much of an image shows something.
pub(crate) fn shown(image: &Image) -> f64 {
    let background = image.pixels.iter().filter(|pixel| **pixel == [0.0, 0.0, 0.0, 1.0]).count();
    1.0 - background as f64 / image.pixels.len() as f64
}

pub(crate) fn head() -> (Volume, Scene) {
    let mut scene = scene(96, 80);
    scene.camera.direction = DVec3::new(0.4, 0.9, -0.3);
    scene.splatting.culling = false;
    scene.channels[0].transfer = transfer(
        &[(40.0, [0.9, 0.6, 0.4]), (120.0, [0.8, 0.3, 0.2]), (220.0, [1.0, 1.0, 0.9])],
        &[(30.0, 0.0), (80.0, 0.15), (130.0, 0.1), (200.0, 0.9)],
    );
    (builtin::volume("head:24").unwrap(), scene)
}

/// Any view, orthographic or in perspective, of any settings that this backend draws.
pub(crate) fn random_case(random: &mut Random) -> (Volume, Scene) {
    let spacing = random.pick(&SPACINGS);
    let volume = random_volume(random, (9.0, 19.0), spacing);
    let mut scene = scene(random.uniform(33.0, 90.0) as u32, random.uniform(33.0, 90.0) as u32);
    scene.camera.direction = random.direction();
    scene.camera.up = random.direction();
    match random.bits() % 5 {
        0 => {}
        1 => {
            // Close by: the object reaches beyond every edge of the image.
            let height = random.uniform(3.0, 12.0);
            scene.camera.projection = Projection::Orthographic { height: Some(height) };
            scene.camera.center = Some(random.within(DVec3::splat(-4.0), DVec3::splat(4.0)));
        }
        // From afar: pixels are larger than voxels.
        2 => scene.camera.projection = Projection::Orthographic { height: Some(random.uniform(100.0, 400.0)) },
        _ => scene.camera = random_eye(random, volume.grid()),
    }
    let (haze, solid) = (random.pick(&[0.0, 0.01, 0.2]), random.pick(&[0.3, 0.9, 1.0]));
    let opacity = [(5.0, 0.0), (20.0, haze), (200.0, solid)];
    scene.channels[0].transfer = transfer(&[(0.0, [0.2, 0.5, 1.0]), (200.0, [1.0, 1.0, 1.0])], &opacity);
    if random.bits().is_multiple_of(3) {
        scene.channels[0].transfer.gradient_opacity = Some(Ramp::new(vec![(0.0, 0.1), (60.0, 1.0)]).unwrap());
    }
    scene.image.background = random.pick(&[[0.0, 0.0, 0.0, 1.0], [1.0, 0.5, 0.2, 0.4], [0.0; 4]]);
    if random.bits().is_multiple_of(3) {
        let normal = random.direction();
        scene.clip.planes = vec![[normal.x, normal.y, normal.z, random.uniform(-2.0, 4.0)]];
    }
    if random.bits().is_multiple_of(4) {
        let half = volume.grid().center() * volume.spacing();
        scene.clip.crop = Some([-0.5 * half, random.uniform(0.3, 2.0) * half]);
    }
    scene.shading.enabled = !random.bits().is_multiple_of(4);
    scene.shading.light = random.pick(&[Light::Headlight, Light::Direction(DVec3::new(1.0, -2.0, 3.0))]);
    let (aligned, sliced) = (Method::ImageAligned, Method::AxisAligned);
    scene.splatting.method = random.pick(&[aligned, aligned, aligned, sliced, Method::CompositeEverySample]);
    if scene.splatting.method == Method::CompositeEverySample {
        scene.clip = Clip::default();
    }
    scene.splatting.compositing = random.pick(&BY_AMOUNTS);
    scene.splatting.order = random.pick(&[Order::FrontToBack, Order::FrontToBack, Order::BackToFront]);
    scene.splatting.opacity_threshold = random.pick(&[0.5, 0.8, 0.95, 0.999]);
    scene.splatting.slab_width = random.pick(&[0.05, 0.3, 0.5, 1.0, 2.0, 8.0]);
    scene.splatting.radius = random.pick(&[1.0, 1.4, 2.0, 3.0, 4.0]);
    scene.splatting.falloff = random.pick(&[2.0, 2.0, 0.01, 16.0]);
    (volume, scene)
}

#[test]
fn settings_one_by_one_against_the_twin() {
    let (volume, plain) = head();
    let mut worst = f64::INFINITY;
    let mut check = |what: &str, volume: &Volume, change: &dyn Fn(&mut Scene)| {
        for compositing in BY_AMOUNTS {
            let mut scene = plain.clone();
            scene.splatting.compositing = compositing;
            change(&mut scene);
            let expected = twin(volume, &scene);
            assert!(shown(&expected) > 0.05, "{what} shows nothing");
            let psnr = psnr(&draw(volume, &scene).image, &expected);
            assert!(psnr > REQUIRED, "{what}, {compositing:?}: {psnr} dB");
            worst = worst.min(psnr);
        }
    };
    check("defaults", &volume, &|_| {});
    for aspect in SPACINGS {
        let volume = volume.clone().with_spacing("head", DVec3::from(aspect)).unwrap();
        check(&format!("spacing {aspect:?}"), &volume, &|_| {});
        check(&format!("spacing {aspect:?} in perspective"), &volume, &|scene| {
            scene.camera.projection = Projection::Perspective { fov_y: 40.0, distance: None, near: None };
        });
    }
    for slab_width in [0.05, 0.4, 3.0, 8.0] {
        check(&format!("slab width {slab_width}"), &volume, &|scene| scene.splatting.slab_width = slab_width);
        check(&format!("slab width {slab_width} in perspective"), &volume, &|scene| {
            scene.camera.projection = Projection::Perspective { fov_y: 40.0, distance: None, near: None };
            scene.splatting.slab_width = slab_width;
        });
    }
    for (radius, falloff) in [(1.0, 2.0), (1.4, 0.5), (3.0, 1.0), (4.0, 0.3), (4.0, 16.0)] {
        check(&format!("radius {radius}, falloff {falloff}"), &volume, &|scene| {
            (scene.splatting.radius, scene.splatting.falloff) = (radius, falloff);
        });
    }
    for height in [0.5, 4.0, 300.0] {
        check(&format!("height {height}"), &volume, &|scene| {
            scene.image.width = if height > 100.0 { 20 } else { 96 };
            scene.image.height = if height > 100.0 { 12 } else { 80 };
            scene.camera = camera([0.3, 0.8, -0.5], if height > 100.0 { 45.0 } else { height });
        });
    }
    for order in [Order::FrontToBack, Order::BackToFront] {
        check(&format!("cut, {order:?}"), &volume, &|scene| {
            let half = volume.grid().center() * volume.spacing();
            scene.clip.planes = vec![[0.3, 1.0, -0.2, 0.3 * half.y], [-1.0, 0.2, 0.1, 0.6 * half.x]];
            scene.clip.crop = Some([-0.8 * half, 0.71 * half]);
            scene.splatting.order = order;
        });
    }
    for (method, order) in [
        (Method::AxisAligned, Order::FrontToBack),
        (Method::AxisAligned, Order::BackToFront),
        (Method::CompositeEverySample, Order::FrontToBack),
        (Method::CompositeEverySample, Order::BackToFront),
    ] {
        let set = |scene: &mut Scene| (scene.splatting.method, scene.splatting.order) = (method, order);
        check(&format!("{method:?}, {order:?}"), &volume, &set);
        check(&format!("{method:?}, {order:?} in perspective"), &volume, &|scene| {
            set(scene);
            scene.camera.projection = Projection::Perspective { fov_y: 40.0, distance: Some(60.0), near: Some(40.0) };
        });
    }
    check("slices cut", &volume, &|scene| {
        scene.splatting.method = Method::AxisAligned;
        scene.clip.planes = vec![[0.3, 1.0, -0.2, 1.0]];
    });
    check("back to front", &volume, &|scene| scene.splatting.order = Order::BackToFront);
    check("unshaded", &volume, &|scene| scene.shading.enabled = false);
    check("fixed light", &volume, &|scene| scene.shading.light = Light::Direction(DVec3::new(1.0, -1.0, 0.5)));
    check("sharp highlight", &volume, &|scene| (scene.shading.shininess, scene.shading.specular) = (200.0, 1.0));
    check("gradient opacity", &volume, &|scene| {
        scene.channels[0].transfer.gradient_opacity = Some(Ramp::new(vec![(0.0, 0.0), (20.0, 1.0)]).unwrap());
    });
    println!("worst: {worst:.1} dB");
}

#[test]
fn holes_and_labels_against_the_twin() {
    let (volume, mut scene) = head();
    let mut values = volume.values().to_vec();
    values.iter_mut().step_by(11).for_each(|value| *value = f32::NAN);
    let holey = Volume::new("holey", volume.dims(), volume.spacing(), values).unwrap();
    assert!(psnr(&draw(&holey, &scene).image, &twin(&holey, &scene)) > REQUIRED);
    let label = sheetsplat::settings::LabelTables {
        opacity: Some(Ramp::new(vec![(0.0, 0.4)]).unwrap()),
        color: Some(Ramp::new(vec![(0.0, DVec3::new(0.1, 0.9, 0.3))]).unwrap()),
        ..Default::default()
    };
    scene.channels[0].transfer.labels.insert(2, label);
    assert!(psnr(&draw(&volume, &scene).image, &twin(&volume, &scene)) > REQUIRED);
}

/// Draws cases with culling, without, and with T = 1, asserts what SPEC §6 promises of each, and gives the number of cases in which anything is culled.
fn culled_cases(cases: usize, mut next: impl FnMut() -> (Volume, Scene)) -> usize {
    let mut culled = 0;
    for case in 0..cases {
        let (volume, mut scene) = next();
        let [with, without] = [true, false].map(|culling| {
            scene.splatting.culling = culling;
            draw(&volume, &scene)
        });
        let allowed = 1.0 - scene.splatting.opacity_threshold + ROUNDING;
        let difference = largest_difference(&with.image, &without.image);
        assert!(difference <= allowed, "case {case}: {difference} > {allowed} with {scene:?}");
        let [few, all] = [&with, &without].map(|rendering| rendering.stats.counts.sections_rasterized);
        assert!(few <= all && all <= with.stats.counts.sections_total, "case {case}: {few}, {all} with {scene:?}");
        culled += usize::from(few < all);
        scene.splatting.opacity_threshold = 1.0;
        scene.splatting.culling = true;
        assert_eq!(bits(&draw(&volume, &scene).image), bits(&without.image), "case {case}, T = 1, with {scene:?}");
    }
    culled
}

#[test]
fn culling_keeps_its_guarantee() {
    let mut random = Random(1999);
    let culled = culled_cases(60, || random_case(&mut random));
    assert!(culled > 15, "only {culled} cases cull anything");
}

#[test]
fn counts_are_the_twins() {
    let mut random = Random(8);
    for case in 0..20 {
        let (volume, mut scene) = random_case(&mut random);
        scene.splatting.culling = false;
        let counts = draw(&volume, &scene).stats.counts;
        let expected = reference::count(&volume, &[scene.channels[0].transfer.resolve(&volume)], &scene).unwrap();
        assert_eq!(counts.voxels_total, expected.voxels_total, "case {case}");
        assert_eq!(counts.voxels_in_range, expected.voxels_in_range, "case {case}");
        assert_eq!(counts.sections_total, expected.sections_total, "case {case}");
        assert_eq!(counts.sheets, expected.sheets, "case {case}");
        assert_eq!(counts.tiles_total, expected.tiles_total, "case {case}");
        assert!(counts.tiles_composited <= counts.tiles_total, "case {case}");
        assert!(counts.voxels_shaded <= counts.voxels_in_range, "case {case}");
    }
    let (volume, scene) = head();
    let counts = draw(&volume, &scene).stats.counts;
    assert_eq!(counts.sections_rasterized, counts.sections_total, "all is on the screen");
    assert_eq!(counts.voxels_shaded, counts.voxels_in_range);
}

#[test]
fn what_is_not_drawn_yet_is_refused_by_name() {
    let (volume, plain) = head();
    let refused = |change: &dyn Fn(&mut Scene), words: [&str; 2]| {
        let mut scene = plain.clone();
        change(&mut scene);
        let message = cpu::render(volume.clone(), &scene).unwrap_err().to_string();
        words.iter().for_each(|word| assert!(message.contains(word), "no {word:?} in {message}"));
    };
    refused(
        &|scene| {
            scene.splatting.method = Method::CompositeEverySample;
            scene.clip.planes = vec![[0.0, 1.0, 0.0, 0.0]];
        },
        ["splatting.method", "clip planes"],
    );
    let economies = Economies { beta: 0.5, ..Economies::default() };
    refused(&|scene| scene.splatting.experimental = economies, ["splatting.experimental.beta", "0.5"]);
    refused(&|scene| scene.image.width = 40_000, ["image.width", "40000"]);
}

#[test]
fn nothing_to_draw_is_the_background() {
    let (_, mut scene) = head();
    let volume = Volume::new("empty", UVec3::splat(5), DVec3::ONE, vec![0.0; 125]).unwrap();
    scene.image.background = [0.5, 0.25, 1.0, 0.5];
    let image = draw(&volume, &scene).image;
    assert!(image.pixels.iter().all(|pixel| *pixel == [0.25, 0.125, 0.5, 0.5]));
}
