//! The native backend compared with the f64 evaluation.

use std::sync::Arc;

use sheetsplat::cpu::CpuRenderer;
use sheetsplat::headless::Backend;
use sheetsplat::settings::{Classification, Compositing};

use super::{CLASSIFICATIONS, draw, joined, random_case};
use crate::common::compare::{assert_at_least, assert_at_most, decibels};
use crate::common::images::{largest_difference, rms};
use crate::common::{COMPOSITINGS, Random};

#[test]
fn whole_frames_of_several_channels_are_those_of_the_twin() {
    let mut random = Random(21);
    for round in 0..2 {
        for (classification, compositing) in
            CLASSIFICATIONS.into_iter().flat_map(|c| COMPOSITINGS.map(|compositing| (c, compositing)))
        {
            let count = 2 + 2 * round;
            let (volume, mut scene) = random_case(&mut random, count);
            (scene.splatting.classification, scene.splatting.compositing) = (classification, compositing);
            let [actual, expected] = super::NATIVE.map(|backend| draw(backend, &volume, &scene));
            let what = format!("{count} channels, {classification:?} {compositing:?}");
            // SPEC §12: 80 dB, after splatting 60 dB. A surface is there or not, which rounding decides at its rim.
            let required = match (classification, compositing) {
                (Classification::After, Compositing::Surface) => 40.0,
                (Classification::After, _) => 60.0,
                _ => 80.0,
            };
            if actual.image != expected.image {
                assert_at_least(decibels(rms(&actual.image, &expected.image)), required, &what);
            }
            let (counts, twin) = (actual.stats.counts, expected.stats.counts);
            assert_eq!(counts.voxels_total, twin.voxels_total, "{what}");
            assert_eq!(counts.voxels_in_range, twin.voxels_in_range, "{what}");
            assert_eq!(counts.sections_total, twin.sections_total, "{what}");
            assert_eq!(counts.sheets, twin.sheets, "{what}");
        }
    }
}

#[test]
fn the_order_of_channels_does_not_matter() {
    let mut random = Random(5);
    for (classification, compositing) in
        CLASSIFICATIONS.into_iter().flat_map(|c| COMPOSITINGS.map(|compositing| (c, compositing)))
    {
        let (volume, mut scene) = random_case(&mut random, 3);
        (scene.splatting.classification, scene.splatting.compositing) = (classification, compositing);
        let channels: Vec<_> = volume.channels().collect();
        let settings: Vec<_> = scene.channels.iter().map(|channel| channel.transfer.clone()).collect();
        let images = |backend: Backend| {
            [[0, 1, 2], [2, 0, 1], [1, 0, 2]].map(|order| {
                let mut scene = scene.clone();
                super::set_transfers(&mut scene, &order.map(|number| settings[number].clone()));
                draw(backend, &joined(&order.map(|number| channels[number])), &scene).image
            })
        };
        for backend in super::NATIVE {
            let [first, second, third] = images(backend);
            for other in [second, third] {
                assert_at_most(
                    largest_difference(&first, &other),
                    1e-6,
                    format!("{backend} {classification:?} {compositing:?}"),
                );
            }
        }
    }
}

#[test]
fn what_opaque_sums_hide_is_culled() {
    let mut random = Random(77);
    for classification in CLASSIFICATIONS {
        let (volume, mut scene) = random_case(&mut random, 3);
        scene.splatting.classification = classification;
        scene.splatting.compositing = Compositing::Exponential;
        for channel in &mut scene.channels[1..] {
            channel.transfer.gradient_opacity = None;
        }
        let whole = draw(Backend::Cpu, &volume, &scene);
        scene.splatting.culling = true;
        for threshold in [0.5, 0.8, 0.95, 1.0] {
            scene.splatting.opacity_threshold = threshold;
            let culled = draw(Backend::Cpu, &volume, &scene);
            let difference = largest_difference(&culled.image, &whole.image);
            assert_at_most(difference, 1.0 - threshold + 1e-5, format!("{classification:?} {threshold}"));
            let (some, all) = (culled.stats.counts.sections_rasterized, whole.stats.counts.sections_rasterized);
            assert!(threshold == 1.0 || some < all, "{classification:?} {threshold}: {some} of {all} sections");
        }
    }
}

#[test]
fn a_changed_scene_of_several_channels_is_drawn_as_a_new_one() {
    let mut random = Random(8);
    let (volume, mut scene) = random_case(&mut random, 3);
    let volume = Arc::new(volume);
    let mut renderer = CpuRenderer::new(volume.clone(), &scene).unwrap();
    for step in 0..24 {
        match step % 4 {
            0 => scene.splatting.compositing = random.pick(&COMPOSITINGS),
            1 => scene.channels[1].visible = !scene.channels[1].visible,
            2 => scene.splatting.classification = random.pick(&CLASSIFICATIONS),
            _ => scene.channels[2].transfer.iso_ranges = Some(vec![[random.uniform(0.0, 100.0), 200.0]]),
        }
        renderer.set_scene(&scene).unwrap();
        assert_eq!(renderer.draw().unwrap().image, draw(Backend::Cpu, &volume, &scene).image, "step {step}");
    }
}
