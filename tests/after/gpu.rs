//! Images of the GPU against the twin.

use std::collections::BTreeMap;

use glam::DVec3;
use sheetsplat::scene::Scene;
use sheetsplat::settings::{Compositing, Gradient, Interpolation, LabelTables, Order, Ramp, Rasterizer};
use sheetsplat::volume::{Labels, Volume, builtin};

use crate::common::compare::{assert_at_least, assert_at_most, decibels};
use crate::common::images::{largest_difference, rms};
use crate::common::{camera, gpu, transfer};
use crate::{eye, render, scene};

/// A small head on a grid with such an aspect, semi-transparent, with a step in its opacity.
fn head(spacing: [f64; 3]) -> (Volume, Scene) {
    let mut scene = scene(70, 56);
    scene.transfer = transfer(
        &[(40.0, [0.9, 0.6, 0.4]), (255.0, [1.0, 1.0, 0.9])],
        &[(30.0, 0.0), (70.0, 0.3), (71.0, 0.02), (150.0, 0.0), (200.0, 0.8)],
    );
    (scene.splatting.culling, scene.splatting.rasterizer) = (false, Rasterizer::Quads);
    scene.camera = camera([0.4, 0.9, -0.3], 30.0);
    (builtin::volume("head:24").unwrap().with_spacing("head", DVec3::from(spacing)).unwrap(), scene)
}

/// The image of the GPU against the twin's, dB.
fn accuracy(volume: &Volume, scene: &Scene) -> f64 {
    let ours = gpu().render_volume(volume.clone(), scene).unwrap().image;
    decibels(rms(&ours, &render(volume, scene)))
}

#[test]
fn images_are_the_twins() {
    for spacing in [[1.0, 1.0, 1.0], [1.0, 1.0, 2.5]] {
        let (volume, base) = head(spacing);
        for compositing in [Compositing::Linear, Compositing::Exponential, Compositing::Xray] {
            for (interpolation, gradient, falloff) in
                [(Interpolation::Smooth, Gradient::Differences, 2.0), (Interpolation::Exact, Gradient::Kernel, 1.0)]
            {
                for projection in [base.camera.projection, eye(60.0), eye(9.0)] {
                    let mut scene = base.clone();
                    scene.camera.projection = projection;
                    (scene.splatting.compositing, scene.splatting.interpolation) = (compositing, interpolation);
                    (scene.shading.gradient, scene.splatting.falloff) = (gradient, falloff);
                    let measured = accuracy(&volume, &scene);
                    let case = format!("{spacing:?} {compositing:?} {interpolation:?} {projection:?}");
                    println!("{case}: {measured:.1} dB");
                    let required = if gradient == Gradient::Kernel { 55.0 } else { 60.0 };
                    assert_at_least(measured, required, case);
                }
            }
        }
    }
}

/// Another setting of a scene.
type Change = fn(&mut Scene);

/// Thin and thick slabs, minified voxels, the other order, gradient opacity, iso-ranges, cuts.
#[test]
fn settings_are_the_twins() {
    let cases: [(&str, Change); 8] = [
        ("thin", |scene| scene.splatting.slab_width = 0.3),
        ("thick", |scene| scene.splatting.slab_width = 3.0),
        ("minified", |scene| scene.camera = camera([0.4, 0.9, -0.3], 120.0)),
        ("back to front", |scene| scene.splatting.order = Order::BackToFront),
        ("unshaded", |scene| scene.shading.enabled = false),
        ("iso-ranges", |scene| scene.transfer.iso_ranges = Some(vec![[40.0, 90.0], [180.0, 230.0]])),
        ("planes", |scene| scene.clip.planes = vec![[0.3, 1.0, 0.2, 0.5]]),
        ("all tiles", |scene| scene.splatting.tiles = false),
    ];
    for projection in [None, Some(eye(50.0))] {
        for (name, change) in &cases {
            let (volume, mut scene) = head([1.0, 1.0, 1.5]);
            scene.splatting.compositing = Compositing::Exponential;
            change(&mut scene);
            scene.camera.projection = projection.unwrap_or(scene.camera.projection);
            let measured = accuracy(&volume, &scene);
            println!("{name} {projection:?}: {measured:.1} dB");
            assert_at_least(measured, 60.0, name);
        }
    }
}

/// With culling no channel differs by more than 1 - T, and something is left out.
#[test]
fn culling_keeps_its_promise() {
    for projection in [None, Some(eye(600.0))] {
        // Large enough for much to be hidden.
        let (volume, mut scene) = (builtin::volume("head:48").unwrap(), head([1.0, 1.0, 1.0]).1);
        scene.camera = camera([0.4, 0.9, -0.3], 300.0);
        scene.splatting.compositing = Compositing::Exponential;
        scene.splatting.opacity_threshold = 0.9;
        scene.transfer = transfer(&[(40.0, [0.9, 0.6, 0.4]), (255.0, [1.0, 1.0, 0.9])], &[(30.0, 0.0), (60.0, 0.9)]);
        scene.camera.projection = projection.unwrap_or(scene.camera.projection);
        let whole = gpu().render_volume(volume.clone(), &scene).unwrap();
        scene.splatting.culling = true;
        let culled = gpu().render_volume(volume, &scene).unwrap();
        let farthest = largest_difference(&whole.image, &culled.image);
        assert_at_most(farthest, 0.1 + 1e-5, format_args!("{projection:?}"));
        let [all, drawn] = [whole, culled].map(|rendering| rendering.stats.counts.sections_rasterized);
        assert!(drawn < all * 9 / 10, "{drawn} of {all}");
    }
}

/// Values that are holes, and labels with tables of their own, one of them invisible.
#[test]
fn holes_and_labels_are_the_twins() {
    let (volume, mut scene) = head([1.0, 1.0, 1.5]);
    let hollow = (0..).zip(volume.values()).map(|(at, &v)| if at % 97 < 3 { f32::NAN } else { v }).collect();
    let hollow = Volume::new("hollow", volume.dims(), volume.grid().spacing, hollow).unwrap();
    assert_at_least(accuracy(&hollow, &scene), 60.0, "holes");
    let values = (0..).zip(volume.values()).map(|(at, _)| (at / 9 % 4) as u16).collect();
    let (dims, origin) = (volume.dims(), "labels".to_owned());
    let labels = Labels { origin, dims, spacing: None, values, names: BTreeMap::new() };
    let labelled = volume.with_labels(labels).unwrap();
    let own =
        LabelTables { opacity: Some(Ramp::new(vec![(20.0, 0.0), (90.0, 0.7)]).unwrap()), ..LabelTables::default() };
    scene.transfer.labels = [(1, own), (2, LabelTables { visible: false, ..LabelTables::default() })].into();
    assert_at_least(accuracy(&labelled, &scene), 60.0, "labels");
}

/// What a frame will take is known before it is prepared.
#[test]
fn memory_is_estimated() {
    let gpu = gpu();
    for (interpolation, falloff) in [(Interpolation::Smooth, 2.0), (Interpolation::Exact, 1.0)] {
        let (volume, mut scene) = head([1.0, 1.0, 1.0]);
        (scene.splatting.interpolation, scene.splatting.falloff) = (interpolation, falloff);
        let mut view = gpu.view(volume, &scene).unwrap();
        let estimated = gpu.renderer().estimate(&view).unwrap();
        gpu.draw(&mut view).unwrap();
        assert_eq!(view.gpu_bytes(), estimated, "{interpolation:?}");
    }
}
