//! The economies of §8: `whole_below` and `resolution` omit the same as the f64 evaluation, and the change by `beta` stays within its
//! bound. They are off by default, and refused where they are not supported.

use glam::{DVec3, UVec3};
use sheetsplat::RenderError;
use sheetsplat::headless::{GpuHeadless, Rendering};
use sheetsplat::image::Image;
use sheetsplat::internals::reference;
use sheetsplat::scene::Scene;
use sheetsplat::settings::{Camera, Projection};
use sheetsplat::settings::{Compositing, Economies, FootprintForm, Method, Order, Rasterizer};
use sheetsplat::volume::{Volume, builtin};

use crate::common::compare::{self, assert_at_least, assert_at_most};
use crate::common::devices::gpu;
use crate::common::images::{largest_difference, rms};
use crate::common::{Random, camera, scene, transfer};

const NONE: Economies = Economies { whole_below: 0.0, beta: 1.0, resolution: 0.0 };

/// The tomato's tissues from faint to solid, or noise, seen obliquely.
fn cases() -> Vec<(&'static str, Volume, Scene)> {
    let mut random = Random(71);
    let values = (0..17 * 20 * 15).map(|_| random.uniform(0.0, 200.0) as f32).collect();
    let noise = Volume::new("noise", UVec3::new(17, 20, 15), DVec3::new(1.0, 1.0, 3.0), values).unwrap();
    let mut scene = Scene { camera: camera([0.3, 0.9, -0.4], 42.0), ..scene(90, 75) };
    scene.channels[0].transfer =
        transfer(&[(0.0, [0.2, 0.4, 1.0]), (200.0, [1.0, 0.8, 0.3])], &[(10.0, 0.0), (60.0, 0.05), (200.0, 0.9)]);
    scene.splatting.culling = false;
    let tomato = builtin::volume("tomato:40").unwrap();
    let mut of_tomato = scene.clone();
    of_tomato.camera = Camera { direction: DVec3::new(0.5, 0.6, 0.6), ..Camera::default() };
    vec![("noise", noise, scene), ("tomato", tomato, of_tomato)]
}

fn render(gpu: &GpuHeadless, volume: &Volume, scene: &Scene) -> Rendering {
    gpu.render_volume(volume.clone(), scene).unwrap()
}

fn twin(volume: &Volume, scene: &Scene) -> Image {
    reference::render(volume, &[scene.channels[0].transfer.resolve(volume)], scene).unwrap()
}

fn decibels(a: &Image, b: &Image) -> f64 {
    compare::decibels(rms(a, b))
}

fn eye() -> Projection {
    Projection::Perspective { fov_y: 35.0, distance: None, near: None }
}

#[test]
fn the_twin_economises_alike() {
    let gpu = gpu();
    let faint = Economies { whole_below: 0.3, ..NONE };
    let all = Economies { whole_below: 1.0, ..NONE };
    let fine = Economies { resolution: 1.0 / 256.0, ..NONE };
    let coarse = Economies { resolution: 0.05, whole_below: 0.1, ..NONE };
    for (name, volume, mut scene) in cases() {
        let orthographic = scene.camera.projection;
        let plain = twin(&volume, &scene);
        let everything = render(gpu, &volume, &scene).stats.counts.sections_rasterized;
        for (projection, compositing, order) in [
            (orthographic, Compositing::Linear, Order::FrontToBack),
            (orthographic, Compositing::Exponential, Order::BackToFront),
            (eye(), Compositing::Exponential, Order::FrontToBack),
            (eye(), Compositing::Xray, Order::FrontToBack),
            (eye(), Compositing::Maximum, Order::BackToFront),
            (orthographic, Compositing::Average, Order::FrontToBack),
        ] {
            for economies in [faint, all, fine, coarse] {
                scene.camera.projection = projection;
                (scene.splatting.compositing, scene.splatting.order) = (compositing, order);
                scene.splatting.experimental = economies;
                let (ours, expected) = (render(gpu, &volume, &scene), twin(&volume, &scene));
                let what = format!("{name}, {:?}, {economies:?}", scene.splatting);
                // A footprint drops to 0 at its rim, so rounding may include or exclude a pixel there.
                let worst = largest_difference(&ours.image, &expected);
                assert_at_most(worst, 2e-4 + economies.resolution / 8.0, &what);
                assert_at_least(decibels(&ours.image, &expected), 104.0, &what);
                let drawn = ours.stats.counts.sections_rasterized;
                assert!(drawn > 0 && drawn < everything, "{drawn} of {everything} sections: {what}");
                if projection == orthographic && compositing == Compositing::Linear {
                    let saved = largest_difference(&expected, &plain);
                    assert_at_least(saved, 4.5e-3, format_args!("nothing was saved: {what}"));
                }
            }
        }
    }
}

/// Voxels behind β change a pixel by at most 1 - β, and whatever is projected whole lies behind β wherever it is drawn.
#[test]
fn beta_keeps_its_bound() {
    let gpu = gpu();
    let mut changed = 0;
    for (name, volume, mut scene) in cases() {
        for (projection, compositing) in [
            (scene.camera.projection, Compositing::Linear),
            (scene.camera.projection, Compositing::Exponential),
            (eye(), Compositing::Linear),
        ] {
            scene.camera.projection = projection;
            scene.splatting.compositing = compositing;
            scene.splatting.experimental = NONE;
            let plain = render(gpu, &volume, &scene);
            let mut sections = plain.stats.counts.sections_rasterized;
            for beta in [0.98, 0.9, 0.6, 0.2] {
                scene.splatting.experimental.beta = beta;
                let economic = render(gpu, &volume, &scene);
                let worst = largest_difference(&economic.image, &plain.image);
                let what = format_args!("{name}, {projection:?}, {compositing:?}, β {beta}");
                assert_at_most(worst, 1.0 - beta + 2e-5, what);
                let fewer = economic.stats.counts.sections_rasterized;
                assert!(
                    fewer <= sections,
                    "{name}, {projection:?}, {compositing:?}, β {beta}: {fewer}, not {sections}"
                );
                changed += u32::from(fewer < sections);
                sections = fewer;
            }
        }
        // Nothing is hidden.
        scene.splatting.compositing = Compositing::Xray;
        let with = render(gpu, &volume, &scene).image;
        scene.splatting.experimental = NONE;
        assert_eq!(with, render(gpu, &volume, &scene).image, "{name}");
    }
    assert!(changed > 12, "β told only {changed} frames from others");
}

#[test]
fn off_by_default_and_by_tiles_only() {
    let gpu = gpu();
    let (_, volume, scene) = cases().remove(0);
    assert_eq!(scene.splatting.experimental, NONE);
    let refused = |change: &dyn Fn(&mut Scene)| {
        let mut scene = scene.clone();
        scene.splatting.experimental.resolution = 0.01;
        change(&mut scene);
        match gpu.render_volume(volume.clone(), &scene) {
            Err(RenderError::OutOfRange(error)) => (error.key, error.found.to_string()),
            other => panic!("{:?}", other.map(|rendering| rendering.stats)),
        }
    };
    let (key, found) = refused(&|scene| scene.splatting.rasterizer = Rasterizer::Quads);
    assert!(key == "splatting.rasterizer" && found.contains("resolution"), "{key}: {found}");
    let (key, found) = refused(&|scene| scene.splatting.footprint = FootprintForm::Sections);
    assert!(key == "splatting.rasterizer" && found.contains("sections"), "{key}: {found}");
    let (key, found) = refused(&|scene| scene.splatting.method = Method::CompositeEverySample);
    assert!(key == "splatting.rasterizer" && found.contains("composite-every-sample"), "{key}: {found}");
}
