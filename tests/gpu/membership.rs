//! Normals of label maps on the GPU (SPEC §15): whole frames by everything that draws them against the f64 evaluation.

use glam::DVec3;
use sheetsplat::internals::reference;
use sheetsplat::scene::Scene;
use sheetsplat::settings::{Compositing, Gradient, LabelTables, Method, Ramp, Rasterizer};
use sheetsplat::volume::Volume;

use crate::common::compare::{assert_at_least, assert_at_most};
use crate::common::devices::{Drawing, gpu};
use crate::common::images::largest_difference;
use crate::common::label_maps::{label_map, scene_of_labels, segmented};
use crate::common::{Random, random_eye};

fn check(name: &str, volume: &Volume, scene: &Scene) {
    let transfer = scene.resolve(volume);
    let expected = reference::render(volume, &transfer, scene).unwrap();
    let rasterizers: &[Rasterizer] = match scene.splatting.method {
        Method::CompositeEverySample => &[Rasterizer::Quads],
        _ => &[Rasterizer::Quads, Rasterizer::Tiles],
    };
    for &rasterizer in rasterizers {
        let drawn = Drawing::By(rasterizer).render(gpu(), volume, scene);
        let allowed = if rasterizer == Rasterizer::Quads { 1e-3 } else { 2.4e-4 };
        assert_at_most(largest_difference(&drawn.image, &expected), allowed, format!("{name} {rasterizer:?}"));
    }
}

#[test]
fn frames_of_label_maps_are_the_twins() {
    let mut random = Random(91);
    for case in 0..6 {
        let (volume, mut scene) = (label_map(&mut random), scene_of_labels(&mut random));
        if case % 3 == 0 {
            scene.camera = random_eye(&mut random, volume.grid());
        }
        scene.splatting.compositing = Compositing::Exponential;
        check(&format!("case {case}"), &volume, &scene);
        let plain = reference::render(&volume, &[scene.channels[0].transfer.resolve(&volume)], &scene).unwrap();
        let own = reference::render(&volume, &scene.resolve(&volume), &scene).unwrap();
        assert_at_least(largest_difference(&plain, &own), 0.02, format!("case {case}: by differences"));
    }
    let (volume, mut scene) = (label_map(&mut random), scene_of_labels(&mut random));
    scene.splatting.method = Method::CompositeEverySample;
    check("every sample", &volume, &scene);
}

/// The gradients count in what a frame takes.
#[test]
fn memory_is_estimated() {
    let mut random = Random(94);
    let own = LabelTables { membership: true, ..LabelTables::default() };
    let mut scene = scene_of_labels(&mut random);
    for (name, volume) in [("a label map", label_map(&mut random)), ("a segmented volume", segmented(&mut random))] {
        if volume.labels().is_some() {
            scene.shading.gradient = Gradient::Differences;
            scene.channels[0].transfer.labels = [(1, own.clone())].into();
        }
        let mut view = gpu().view(volume, &scene).unwrap();
        let estimated = gpu().renderer().estimate(&view).unwrap();
        gpu().draw(&mut view).unwrap();
        assert_eq!(view.gpu_bytes(), estimated, "{name}");
    }
}

/// Of labels beside values some have their own normals, others those of the values.
#[test]
fn frames_of_segmented_volumes_are_the_twins() {
    let mut random = Random(92);
    let own = |membership, rgb| LabelTables {
        membership,
        color: Some(Ramp::new(vec![(0.0, rgb)]).unwrap()),
        ..LabelTables::default()
    };
    for case in 0..3 {
        let (volume, mut scene) = (segmented(&mut random), scene_of_labels(&mut random));
        scene.shading.gradient = Gradient::Differences;
        scene.channels[0].transfer.labels =
            [(1, own(true, DVec3::X)), (2, own(true, DVec3::Y)), (3, own(false, DVec3::ONE))].into();
        check(&format!("case {case}"), &volume, &scene);
    }
}

/// A label map among channels, after a scan and before it.
#[test]
fn frames_of_channels_are_the_twins() {
    let mut random = Random(93);
    let (map, mut scene) = (label_map(&mut random), scene_of_labels(&mut random));
    let values = map.values().iter().map(|_| random.uniform(0.0, 3.0) as f32).collect();
    let scan = Volume::new("scan", map.dims(), map.spacing(), values).unwrap();
    let mut channel = sheetsplat::scene::Channel::new(sheetsplat::scene::VolumeSource::Memory);
    channel.transfer = scene.channels[0].transfer.clone();
    scene.channels.push(channel);
    for (name, volume) in [
        ("a scan behind", map.clone().with_channels("channels", vec![scan.clone()]).unwrap()),
        ("a scan before", scan.with_channels("channels", vec![map]).unwrap()),
    ] {
        check(name, &volume, &scene);
        scene.splatting.compositing = Compositing::Average;
        check(&format!("{name}, of its own sheets"), &volume, &scene);
        scene.splatting.compositing = Compositing::Linear;
    }
}
