//! First hits and picks: where they are, and what is refused.

use std::collections::BTreeMap;

use glam::{DVec3, UVec3};
use sheetsplat::cpu::CpuRenderer;
use sheetsplat::settings::{Classification, Compositing, Method, Order, Projection};
use sheetsplat::volume::{Labels, Volume};

use crate::common::{scene, transfer};

/// A ball of ones, opaque, with a voxel of two in front.
fn ball() -> (Volume, sheetsplat::Scene) {
    let dims = UVec3::splat(24);
    let at = |index: u32| UVec3::new(index % 24, index / 24 % 24, index / 576);
    let value = |index: u32| match at(index) {
        voxel if voxel == UVec3::new(12, 3, 12) => 2.0,
        voxel => f32::from(voxel.as_dvec3().distance(DVec3::splat(11.5)) < 8.0),
    };
    let labels = (0..dims.element_product()).map(|index| (value(index) as u16) * 10).collect();
    let values = (0..dims.element_product()).map(value).collect();
    let volume = Volume::new("ball", dims, DVec3::splat(2.0), values).unwrap();
    let mut scene = scene(97, 97);
    scene.channels[0].transfer = transfer(&[(0.0, [1.0; 3])], &[(0.5, 0.0), (1.0, 1.0)]);
    scene.camera.direction = DVec3::Y;
    let labels = Labels { origin: "labels".to_owned(), dims, spacing: None, values: labels, names: BTreeMap::new() };
    (volume.with_labels(labels).unwrap(), scene)
}

#[test]
fn a_pick_is_the_front_of_the_ball() {
    let (volume, mut scene) = ball();
    for projection in [
        Projection::Orthographic { height: Some(60.0) },
        Projection::Perspective { fov_y: 30.0, distance: Some(120.0), near: None },
    ] {
        scene.camera.projection = projection;
        let compositings = [Compositing::Linear, Compositing::Exponential, Compositing::Surface];
        let ways =
            compositings.map(|compositing| [Classification::Before, Classification::After].map(|at| (compositing, at)));
        for (compositing, classification) in ways.into_iter().flatten() {
            (scene.splatting.compositing, scene.splatting.classification) = (compositing, classification);
            let mut renderer = CpuRenderer::new(volume.clone(), &scene).unwrap();
            assert!(renderer.pick([48, 48]).unwrap_err().to_string().contains("[48, 48]"), "no frame yet");
            renderer.set_first_hit(Some(0.5)).unwrap();
            renderer.draw().unwrap();
            let what = format!("{compositing:?}, {classification:?}, {projection:?}");
            let pick = renderer.pick([48, 48]).unwrap().expect("the ball is in the middle");
            // The lone voxel lies before the ball, at y = -17.
            assert!(pick.position.y > -20.5 && pick.position.y < -13.0, "{what}: {pick:?}");
            let from = if let Projection::Perspective { .. } = projection { 120.0 } else { 0.0 };
            assert!((pick.depth - from - pick.position.y).abs() < 1e-3, "{what}: {pick:?}");
            let expected = volume.values().at(volume.grid().index_of(pick.voxel) as usize);
            assert_eq!((pick.value, pick.label), (expected, Some(expected as u16 * 10)), "{what}");
            assert_eq!(renderer.pick([1, 1]).unwrap(), None, "{what}: beside the ball");
            assert!(renderer.pick([97, 0]).unwrap_err().to_string().contains("97×97"), "{what}");
            let hits = renderer.first_hits().unwrap();
            assert_eq!((hits.len(), hits[0]), (97 * 97, f32::INFINITY), "{what}");
        }
    }
}

#[test]
fn first_hits_that_cannot_be_are_refused_by_name() {
    let (volume, plain) = ball();
    let refused = |opacity: f64, change: &dyn Fn(&mut sheetsplat::Scene), words: [&str; 2]| {
        let mut scene = plain.clone();
        change(&mut scene);
        let mut renderer = CpuRenderer::new(volume.clone(), &scene).unwrap();
        renderer.set_first_hit(Some(opacity)).unwrap();
        let message = renderer.draw().unwrap_err().to_string();
        words.iter().for_each(|word| assert!(message.contains(word), "no {word:?} in {message}"));
    };
    refused(0.5, &|scene| scene.splatting.compositing = Compositing::Minimum, ["splatting.compositing", "first hits"]);
    refused(0.5, &|scene| scene.splatting.order = Order::BackToFront, ["splatting.order", "first hits"]);
    refused(0.5, &|scene| scene.splatting.method = Method::CompositeEverySample, ["splatting.method", "first hits"]);
    refused(0.97, &|_| {}, ["first_hit", "opacity_threshold"]);
    let mut renderer = CpuRenderer::new(volume.clone(), &plain).unwrap();
    assert!(renderer.set_first_hit(Some(0.0)).unwrap_err().to_string().contains("first_hit"));
}
