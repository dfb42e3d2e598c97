//! Light sheets on the GPU (SPEC §14): whole frames by both rasterizers against the f64 evaluation.
//! `cargo test --test gpu light:: -- --nocapture` prints the measurements.

use glam::DVec3;
use sheetsplat::Scene;
use sheetsplat::internals::reference;
use sheetsplat::scene::{Channel, VolumeSource};
use sheetsplat::settings::{Classification, Compositing, Light, Method, Projection, Ramp, Rasterizer};
use sheetsplat::volume::{Volume, builtin};

use crate::common::cases::in_turns;
use crate::common::compare::{assert_at_least, assert_at_most, decibels};
use crate::common::devices::{Drawing, gpu};
use crate::common::images::{largest_difference, rms};
use crate::common::{RASTERIZERS, lit_by_sheets, scene, transfer};

const CLASSIFICATIONS: [Classification; 2] = [Classification::Before, Classification::After];

/// A small head in the light of both kinds of sheets.
fn lit(classification: Classification) -> (Volume, Scene) {
    let mut scene = scene(72, 60);
    scene.camera.direction = DVec3::new(0.4, 0.9, -0.3);
    scene.splatting.culling = false;
    scene.splatting.classification = classification;
    scene.channels[0].transfer = transfer(
        &[(40.0, [0.9, 0.6, 0.4]), (120.0, [0.8, 0.3, 0.2]), (220.0, [1.0, 1.0, 0.9])],
        &[(30.0, 0.0), (80.0, 0.15), (130.0, 0.1), (200.0, 0.9)],
    );
    scene.shading = lit_by_sheets(scene.shading);
    (builtin::volume("head:24").unwrap(), scene)
}

fn check(what: &str, volume: &Volume, scene: &Scene, rasterizer: Rasterizer) {
    let expected = reference::render(volume, &scene.resolve(volume), scene).unwrap();
    let mut unlit = scene.clone();
    (unlit.shading.occlusion, unlit.shading.shadow) = (0.0, 0.0);
    let unlit = reference::render(volume, &unlit.resolve(volume), &unlit).unwrap();
    assert_at_least(rms(&unlit, &expected), 1e-3, format_args!("{what}: sheets change something"));
    let drawn = Drawing::By(rasterizer).render(gpu(), volume, scene);
    let psnr = decibels(rms(&drawn.image, &expected));
    println!("{what}, {rasterizer:?}: {psnr:.1} dB");
    assert_at_least(psnr, 100.0, format_args!("{what}, {rasterizer:?}"));
}

#[test]
fn frames_are_those_of_the_f64_evaluation() {
    let perspective = Projection::Perspective { fov_y: 40.0, distance: None, near: None };
    type Change = Box<dyn Fn(&mut Volume, &mut Scene)>;
    let changes: Vec<(&str, Change)> = vec![
        ("linear", Box::new(|_, _| {})),
        ("exponential", Box::new(|_, scene| scene.splatting.compositing = Compositing::Exponential)),
        ("maximum", Box::new(|_, scene| scene.splatting.compositing = Compositing::Maximum)),
        (
            "surface",
            Box::new(|_, scene| {
                scene.splatting.compositing = Compositing::Surface;
                scene.channels[0].transfer.opacity =
                    Some(Ramp::new(vec![(30.0, 0.0), (80.0, 0.6), (200.0, 0.9)]).unwrap());
            }),
        ),
        ("perspective", Box::new(move |_, scene| scene.camera.projection = perspective)),
        ("headlight", Box::new(|_, scene| scene.shading.light = Light::Headlight)),
        (
            "shadow alone",
            Box::new(|_, scene| {
                scene.shading.occlusion = 0.0;
                scene.shading.light = Light::Direction(DVec3::new(1.0, -2.0, 1.0));
            }),
        ),
        (
            "spacing and cut",
            Box::new(|volume, scene| {
                *volume = volume.clone().with_spacing("head", DVec3::new(1.0, 1.0, 3.0)).unwrap();
                scene.clip.planes = vec![[0.3, 1.0, -0.2, 2.0]];
            }),
        ),
        (
            "channels",
            Box::new(|volume, scene| {
                let mirrored = volume.values().iter().rev().collect();
                let mirrored = Volume::new("mirrored", volume.dims(), volume.spacing(), mirrored).unwrap();
                let mut channel = Channel::new(VolumeSource::Memory);
                channel.transfer = transfer(&[(0.0, [0.1, 0.9, 0.2])], &[(20.0, 0.0), (220.0, 0.8)]);
                scene.channels.push(channel);
                *volume = volume.clone().with_channels("two", vec![mirrored]).unwrap();
            }),
        ),
    ];
    for classification in CLASSIFICATIONS {
        for (number, (what, change)) in changes.iter().enumerate() {
            let (mut volume, mut scene) = lit(classification);
            change(&mut volume, &mut scene);
            for rasterizer in in_turns(number, RASTERIZERS) {
                check(&format!("{classification:?}, {what}"), &volume, &scene, rasterizer);
            }
        }
    }
    let (volume, mut scene) = lit(Classification::Before);
    scene.splatting.method = Method::CompositeEverySample;
    check("samples", &volume, &scene, Rasterizer::Quads);
}

/// A view that turns, and whose transfer function changes, has the light of a new one.
#[test]
fn views_keep_light_only_while_it_holds() {
    for classification in CLASSIFICATIONS {
        let (volume, mut scene) = lit(classification);
        scene.shading.light = Light::Direction(DVec3::new(1.0, -2.0, 1.0));
        let mut view = gpu().view(volume.clone(), &scene).unwrap();
        let mut same = |change: &dyn Fn(&mut sheetsplat::SceneView, &mut Scene)| {
            change(&mut view, &mut scene);
            let kept = gpu().draw(&mut view).unwrap().image;
            let new = gpu().render_volume(volume.clone(), &scene).unwrap().image;
            assert_at_most(largest_difference(&kept, &new), 0.0, format_args!("{classification:?}"));
        };
        same(&|_, _| {});
        same(&|view, scene| {
            scene.camera = scene.camera.turned(40.0);
            view.set_camera(scene.camera).unwrap();
        });
        same(&|view, scene| {
            scene.channels[0].transfer.iso_ranges = Some(vec![[100.0, 300.0]]);
            view.set_iso_ranges(scene.channels[0].transfer.iso_ranges.clone()).unwrap();
        });
        same(&|view, scene| {
            scene.clip.planes = vec![[0.3, 1.0, -0.2, 2.0]];
            view.set_clip(scene.clip.clone()).unwrap();
        });
        same(&|view, scene| {
            scene.shading.shadow = 0.2;
            view.set_shading(scene.shading).unwrap();
        });
        same(&|view, scene| {
            (scene.shading.occlusion, scene.shading.shadow) = (0.0, 0.0);
            view.set_shading(scene.shading).unwrap();
        });
    }
}

#[test]
fn memory_is_estimated() {
    for classification in CLASSIFICATIONS {
        let (volume, mut scene) = lit(classification);
        scene.clip.planes = vec![[0.3, 1.0, -0.2, 2.0]];
        for (occlusion, shadow) in [(0.8, 0.7), (0.0, 0.7), (0.8, 0.0), (0.0, 0.0)] {
            (scene.shading.occlusion, scene.shading.shadow) = (occlusion, shadow);
            let mut view = gpu().view(volume.clone(), &scene).unwrap();
            let estimated = gpu().renderer().estimate(&view).unwrap();
            gpu().draw(&mut view).unwrap();
            assert_eq!(view.gpu_bytes(), estimated, "{classification:?}, {occlusion}, {shadow}");
        }
    }
}
