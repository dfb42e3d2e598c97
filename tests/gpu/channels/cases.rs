//! Random cases of several channels with what else a scene may have: culling, label tables, cuts, other methods and kernels.

use std::collections::BTreeMap;

use glam::DVec3;
use sheetsplat::headless::Backend;
use sheetsplat::scene::Scene;
use sheetsplat::settings::{Classification, Clip, Compositing, Interpolation, LabelTables, Method, Ramp};
use sheetsplat::volume::{Labels, Volume};

use super::{CLASSIFICATIONS, NATIVE, draw, random_case, single};
use crate::common::compare::{assert_at_least, assert_at_most, decibels};
use crate::common::images::{largest_difference, rms};
use crate::common::{COMPOSITINGS, Random};

/// Asserts that the native backend draws what the f64 evaluation draws (SPEC §12), and that both show something.
fn assert_like_the_twin(volume: &Volume, scene: &Scene, what: &str) {
    let [actual, expected] = NATIVE.map(|backend| draw(backend, volume, scene));
    let required = match (scene.splatting.classification, scene.splatting.compositing) {
        // A surface is there or not, which rounding decides at its rim.
        (Classification::After, Compositing::Surface) => 40.0,
        (Classification::After, _) => 60.0,
        _ => 80.0,
    };
    if actual.image != expected.image {
        assert_at_least(decibels(rms(&actual.image, &expected.image)), required, what);
    }
    assert_eq!(actual.stats.counts.voxels_in_range, expected.stats.counts.voxels_in_range, "{what}");
    assert_eq!(actual.stats.counts.sheets, expected.stats.counts.sheets, "{what}");
}

/// Labels for two of three channels, different ones, and tables for some labels.
fn label(random: &mut Random, volume: &Volume, scene: &mut Scene) -> Volume {
    let labelled = |channel: &Volume, period: u32| {
        let values = (0..channel.values().len() as u32)
            .map(|index| (channel.grid().voxel_at(index).element_sum() / period % 4) as u16)
            .collect();
        let (dims, names) = (channel.dims(), BTreeMap::new());
        channel.clone().with_labels(Labels { origin: "labels".to_owned(), dims, spacing: None, values, names }).unwrap()
    };
    let channels: Vec<Volume> = volume.channels().map(single).collect();
    let others = vec![labelled(&channels[1], 3), channels[2].clone()];
    let mut tables = || {
        let color = DVec3::from([(); 3].map(|()| random.uniform(0.0, 1.0)));
        let ramp = vec![(10.0, 0.0), (180.0, random.uniform(0.2, 0.9))];
        let shown = LabelTables {
            color: Some(Ramp::new(vec![(0.0, color)]).unwrap()),
            opacity: Some(Ramp::new(ramp).unwrap()),
            ..LabelTables::default()
        };
        BTreeMap::from([(1, shown), (2, LabelTables { visible: false, ..LabelTables::default() })])
    };
    scene.channels[0].transfer.labels = tables();
    scene.channels[1].transfer.labels = tables();
    labelled(&channels[0], 5).with_channels("test", others).unwrap()
}

#[test]
fn label_tables_are_each_channels_own() {
    let mut random = Random(61);
    let mut shown = 0;
    for (classification, compositing) in
        CLASSIFICATIONS.into_iter().flat_map(|c| COMPOSITINGS.map(|compositing| (c, compositing)))
    {
        let (volume, mut scene) = random_case(&mut random, 3);
        (scene.splatting.classification, scene.splatting.compositing) = (classification, compositing);
        // Otherwise the middles of rays through an even number of voxels lie between two of them, and rounding chooses one.
        let half = (volume.dims().as_dvec3() - 1.0) * volume.spacing() / 2.0;
        scene.clip.crop = Some([half * -0.83, half * 0.91]);
        let plain = draw(Backend::Cpu, &volume, &scene).image;
        let labelled = label(&mut random, &volume, &mut scene);
        let what = format!("{classification:?} {compositing:?}");
        assert_like_the_twin(&labelled, &scene, &what);
        shown += usize::from(draw(Backend::Cpu, &labelled, &scene).image != plain);
    }
    // Some cameras look past the volume.
    assert!(shown > 10, "tables have an effect on {shown} images");
}

#[test]
fn what_is_cut_away_is_cut_from_all_channels() {
    let mut random = Random(62);
    for (classification, compositing) in
        CLASSIFICATIONS.into_iter().flat_map(|c| COMPOSITINGS.map(|compositing| (c, compositing)))
    {
        let (volume, mut scene) = random_case(&mut random, 3);
        (scene.splatting.classification, scene.splatting.compositing) = (classification, compositing);
        let half = (volume.dims().as_dvec3() - 1.0) * volume.spacing() / 2.0;
        let normal = random.direction();
        let planes = vec![[normal.x, normal.y, normal.z, random.uniform(0.0, 0.4) * half.min_element()]];
        scene.clip = Clip { planes, crop: Some([half * -0.9, half * random.uniform(0.3, 0.8)]), ..Clip::default() };
        assert_like_the_twin(&volume, &scene, &format!("{classification:?} {compositing:?}"));
    }
}

#[test]
fn methods_without_slabs_take_sums_too() {
    let mut random = Random(63);
    for (method, compositing) in COMPOSITINGS.map(|compositing| (Method::AxisAligned, compositing)).into_iter().chain([
        (Method::CompositeEverySample, Compositing::Linear),
        (Method::CompositeEverySample, Compositing::Exponential),
    ]) {
        let (volume, mut scene) = random_case(&mut random, 3);
        (scene.splatting.method, scene.splatting.compositing) = (method, compositing);
        assert_like_the_twin(&volume, &scene, &format!("{method:?} {compositing:?}"));
    }
}

#[test]
fn every_channel_is_interpolated_exactly() {
    let mut random = Random(64);
    for compositing in COMPOSITINGS {
        let (volume, mut scene) = random_case(&mut random, 3);
        (scene.splatting.classification, scene.splatting.compositing) = (Classification::After, compositing);
        let smooth = draw(Backend::Cpu, &volume, &scene).image;
        scene.splatting.interpolation = Interpolation::Exact;
        assert_like_the_twin(&volume, &scene, &format!("{compositing:?}"));
        assert!(draw(Backend::Cpu, &volume, &scene).image != smooth, "{compositing:?}: it has an effect");
    }
}

#[test]
fn culling_keeps_its_guarantee_over_sums() {
    let mut random = Random(65);
    let (mut all_sections, mut seen_sections) = (0, 0);
    for round in 0..8 {
        let (volume, mut scene) = random_case(&mut random, 2 + round % 3);
        scene.splatting.classification = CLASSIFICATIONS[round % 2];
        scene.splatting.compositing = [Compositing::Linear, Compositing::Exponential][round / 2 % 2];
        // Opaque together, though not each alone.
        let faint = vec![(20.0, 0.0), (60.0, 0.35)];
        scene.channels[0].transfer.opacity = Some(Ramp::new(faint.clone()).unwrap());
        for channel in &mut scene.channels[1..] {
            channel.transfer.opacity = Some(Ramp::new(faint.clone()).unwrap());
        }
        let whole = draw(Backend::Cpu, &volume, &scene);
        scene.splatting.culling = true;
        let all = whole.stats.counts.sections_rasterized;
        for threshold in [0.4, 0.7, 0.9, 0.99, 1.0] {
            scene.splatting.opacity_threshold = threshold;
            let culled = draw(Backend::Cpu, &volume, &scene);
            let what = format!("round {round}, T = {threshold}");
            assert_at_most(largest_difference(&culled.image, &whole.image), 1.0 - threshold + 1e-5, &what);
            let seen = culled.stats.counts.sections_rasterized;
            assert!(seen <= all, "{what}: {seen} of {all} sections");
            if threshold == 0.7 {
                (all_sections, seen_sections) = (all_sections + all, seen_sections + seen);
            }
        }
    }
    assert!(seen_sections * 10 < all_sections * 9, "{seen_sections} of {all_sections} sections are drawn");
}
