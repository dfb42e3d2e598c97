//! Normals of label maps (SPEC §15): gradients against the f64 evaluation, balls against their analytic normals, and whole frames.
//! `cargo test --test cpu membership:: -- --nocapture` prints what was measured.

use std::sync::Arc;

use glam::{DVec3, UVec3};
use sheetsplat::cpu::StreamRenderer;
use sheetsplat::internals::reference::{self, membership};
use sheetsplat::scene::Scene;
use sheetsplat::settings::{Classification, Gradient, LabelTables, Ramp};
use sheetsplat::volume::{Members, Volume, builtin};

use crate::common::compare::{assert_at_least, assert_at_most};
use crate::common::images::bits;
use crate::common::label_maps::{label_map, scene_of_labels, segmented};
use crate::common::store::{MemoryStore, streamed};
use crate::common::{Random, random_eye, scene};
use crate::native::{REQUIRED, draw, psnr};

#[test]
fn gradients_are_the_twins() {
    let mut random = Random(15);
    let (mut worst, mut shaped) = (0.0, 0);
    for case in 0..40 {
        let (volume, of) = match case % 2 {
            0 => (label_map(&mut random), Members::OfValues),
            _ => (segmented(&mut random), Members::OfLabels),
        };
        for index in 0..volume.values().len() as u32 {
            let voxel = volume.grid().voxel_at(index);
            let (ours, expected) = (volume.membership_gradient(of, voxel), membership::gradient(&volume, of, voxel));
            assert!(ours.is_finite() && expected.is_finite(), "case {case}, voxel {voxel}: {ours} and {expected}");
            worst = f64::max(worst, ((ours - expected) * volume.spacing()).length());
            shaped += usize::from(expected.length() > 1e-3);
        }
    }
    assert!(shaped > 10_000, "{shaped} voxels have a gradient");
    assert_at_most(worst, 1.2e-7, "membership per voxel");
}

/// A ball's own label, and all others, around it.
fn ball(center: DVec3, radius: f64) -> impl Fn(UVec3) -> bool {
    move |voxel: UVec3| voxel.as_dvec3().distance(center) < radius
}

/// The diffuse light of a headlight on voxels at the surfaces of two balls that touch is that of their analytic normals.
#[test]
fn balls_are_round() {
    let (dims, balls) =
        (UVec3::new(50, 36, 36), [(DVec3::new(15.2, 17.6, 17.9), 10.0), (DVec3::new(33.1, 18.2, 17.3), 8.0)]);
    let label = |voxel: UVec3| {
        (1..).zip(balls).find(|(_, (center, radius))| ball(*center, *radius)(voxel)).map_or(0, |(label, _)| label)
    };
    let grid = sheetsplat::volume::Grid::new(dims, DVec3::ONE);
    let values: Vec<u8> = (0..dims.element_product()).map(|index| label(grid.voxel_at(index))).collect();
    let volume = Volume::from_values("balls", dims, DVec3::ONE, values).unwrap();
    let (mut squares, mut before, mut count) = (0.0, 0.0, 0.0);
    for index in 0..dims.element_product() {
        let voxel = grid.voxel_at(index);
        let (own, at) = (label(voxel), voxel.as_dvec3());
        let neighbours = [DVec3::X, DVec3::Y, DVec3::Z].into_iter().flat_map(|axis| [at - axis, at + axis]);
        let (center, radius) = if own == 0 { continue } else { balls[own as usize - 1] };
        // Where the balls touch, the surface is not theirs alone.
        let other = balls[2 - own as usize];
        let is_open = at.distance(other.0) > other.1 + 4.0;
        if !is_open || !neighbours.into_iter().any(|at| at.distance(center) >= radius) {
            continue;
        }
        let expected = (at - center).normalize();
        for to_eye in [DVec3::new(0.0, 0.0, 1.0), DVec3::new(0.6, -0.48, 0.64), DVec3::new(1.0, 1.0, 1.0).normalize()] {
            let light = |normal: DVec3| normal.normalize_or_zero().dot(to_eye).abs();
            squares += (light(volume.membership_gradient(Members::OfValues, voxel)) - light(expected)).powi(2);
            before += (light(volume.gradient(voxel)) - light(expected)).powi(2);
            count += 1.0;
        }
    }
    let [rms, before]: [f64; 2] = [squares, before].map(|sum| f64::sqrt(sum / count));
    println!("rms {rms:.4}, by differences {before:.4}");
    assert!(count > 1000.0);
    assert_at_most(rms, 0.015, "rms of the diffuse light");
    assert_at_least(before, 4.0 * 0.015, "rms by differences");
}

/// Of label maps, segmented volumes, and label maps among channels.
#[test]
fn frames_are_the_twins() {
    let mut random = Random(53);
    let mut others = 0;
    for case in 0..24 {
        let mut scene = scene_of_labels(&mut random);
        let volume = match case % 3 {
            0 => label_map(&mut random),
            1 => {
                let own = |membership| LabelTables {
                    membership,
                    color: Some(Ramp::new(vec![(0.0, DVec3::ONE)]).unwrap()),
                    ..LabelTables::default()
                };
                scene.shading.gradient = Gradient::Differences;
                scene.channels[0].transfer.labels = [(1, own(true)), (2, own(true)), (3, own(false))].into();
                segmented(&mut random)
            }
            _ => {
                let first = label_map(&mut random);
                let scan: Vec<f32> = first.values().iter().map(|_| random.uniform(0.0, 3.0) as f32).collect();
                let scan = Volume::new("scan", first.dims(), first.spacing(), scan).unwrap();
                scene.channels.push(sheetsplat::scene::Channel::new(sheetsplat::scene::VolumeSource::Memory));
                scene.channels[1].transfer = scene.channels[0].transfer.clone();
                first.with_channels("channels", vec![scan]).unwrap()
            }
        };
        if case % 4 == 0 {
            scene.camera = random_eye(&mut random, volume.grid());
        }
        let expected = reference::render(&volume, &scene.resolve(&volume), &scene).unwrap();
        let drawn = draw(&volume, &scene).image;
        assert_at_least(psnr(&drawn, &expected), REQUIRED, format!("case {case}"));
        // Without it the picture is another.
        let mut plain = scene.clone();
        plain.shading.gradient = Gradient::Differences;
        plain.channels[0].transfer.labels.values_mut().for_each(|own| own.membership = false);
        others += usize::from(psnr(&draw(&volume, &plain).image, &expected) < 50.0);
    }
    assert!(others > 12, "{others} pictures differ from those by differences");
}

/// Streams of label maps are the volume in memory, byte by byte, whatever the chunks.
#[test]
fn streams_are_the_volume_in_memory() {
    let mut random = Random(54);
    for case in 0..12 {
        let volume = label_map(&mut random);
        let scene = scene_of_labels(&mut random);
        let whole = draw(&volume, &scene).image;
        for (chunk, memory) in [(UVec3::new(8, 12, 10), 1 << 17), (UVec3::splat(3), 1 << 30)] {
            let store = Arc::new(MemoryStore::new(&volume, chunk));
            let stream = StreamRenderer::new(streamed(store, 0, &volume, memory), &scene).unwrap();
            assert_eq!(bits(&stream.draw().unwrap().image), bits(&whole), "case {case}, chunks of {chunk}");
        }
    }
}

/// A label map has these normals unless a scene states others, and a scan never has them by itself.
#[test]
fn label_maps_have_them_by_default() {
    let volume = label_map(&mut Random(3));
    let mut own = scene_of_labels(&mut Random(3));
    own.shading.gradient = Gradient::Auto;
    let stated = Scene {
        shading: sheetsplat::settings::Shading { gradient: Gradient::Membership, ..own.shading },
        ..own.clone()
    };
    assert_eq!(bits(&draw(&volume, &own).image), bits(&draw(&volume, &stated).image));
    assert!(own.resolve(&volume)[0].membership);
    assert_eq!(own.explicit(&volume).shading.gradient, Gradient::Membership);
    own.splatting.classification = Classification::After;
    assert!(!own.resolve(&volume)[0].membership);
    assert_eq!(own.explicit(&volume).shading.gradient, Gradient::Differences);

    let head = builtin::volume("head:24").unwrap();
    let open = scene(40, 40);
    assert!(!open.resolve(&head)[0].membership);
    assert_eq!(open.explicit(&head).shading.gradient, Gradient::Differences);
}

/// A mask does not look like labels, so that only the preset says that it is one: also in a scene with everything stated, and in one that was saved.
#[test]
fn masks_are_label_maps_by_their_preset() {
    let dims = UVec3::splat(24);
    let grid = sheetsplat::volume::Grid::new(dims, DVec3::ONE);
    let in_ball = ball(DVec3::splat(11.0), 8.0);
    let values: Vec<u8> = (0..dims.element_product()).map(|index| u8::from(in_ball(grid.voxel_at(index)))).collect();
    let mask = Volume::from_values("mask", dims, DVec3::ONE, values).unwrap();
    let memory = || sheetsplat::scene::VolumeSource::Memory;
    let scene =
        Scene::from_volume(memory(), &["preset=labels", "image.width=40", "image.height=40"].map(str::to_owned));
    let scene = scene.unwrap();
    assert!(scene.resolve(&mask)[0].membership);
    let picture = bits(&draw(&mask, &scene).image);
    let explicit = scene.explicit(&mask);
    assert_eq!(bits(&draw(&mask, &explicit).image), picture, "everything stated");
    let text = explicit.to_toml(std::path::Path::new("")).unwrap();
    let saved = Scene::parse_for(memory(), &text, "saved", std::path::Path::new(""), &[]).unwrap();
    assert_eq!(bits(&draw(&mask, &saved).image), picture, "saved: {text}");
}

#[test]
fn what_has_no_labels_is_refused() {
    let head = builtin::volume("head:24").unwrap();
    let refused = |sets: &[&str]| {
        let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
        match Scene::from_volume(sheetsplat::scene::VolumeSource::Builtin("head:24".to_owned()), &sets) {
            Ok(scene) => sheetsplat::cpu::render(head.clone(), &scene).map(|_| ()).unwrap_err().to_string(),
            Err(error) => error.to_string(),
        }
    };
    assert_eq!(
        refused(&["shading.gradient=membership", "preset=none"]),
        "shading.gradient: found \"membership\" for values that are no labels, allowed: \"differences\" or \"kernel\", or a label map: for labels \
         beside values gradient in [[transfer.label]]"
    );
    assert_eq!(
        refused(&["shading.gradient=membership", "splatting.classification=after"]),
        "--set: shading.gradient: found \"membership\" with splatting.classification = \"after\", allowed: classification \"before\" with it, or \
         \"differences\""
    );
    assert_eq!(
        refused(&["transfer.label=[{label=3,gradient=\"membership\"}]", "splatting.classification=after"]),
        "--set: transfer.label[0].gradient: found \"membership\" with splatting.classification = \"after\", allowed: classification \"before\" \
         with it, or \"differences\""
    );
}
