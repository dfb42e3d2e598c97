//! Resampling onto the first channel's grid: labels by the nearest one, holes, and colours.

use std::fs;
use std::path::Path;

use glam::{DVec3, UVec3};
use sheetsplat::appearance::categories;
use sheetsplat::headless::Backend;
use sheetsplat::scene::Scene;
use sheetsplat::settings::Classification;
use sheetsplat::volume::Volume;

use super::draw;
use super::fusion::write;
use crate::common::compare::assert_at_most;

/// Voxels of the first channel, at whole numbers of millimetres.
const DIMS: UVec3 = UVec3::new(19, 17, 15);

/// Those of the second one, which is turned by 90°, coarser and elsewhere. No voxel of the first lies half way between two.
const OTHER: UVec3 = UVec3::new(7, 8, 6);
const ORIGIN: DVec3 = DVec3::new(16.3, 1.2, 2.4);
const STEPS: [DVec3; 3] = [DVec3::new(0.0, 2.3, 0.0), DVec3::new(-1.9, 0.0, 0.0), DVec3::new(0.0, 0.0, 2.1)];

/// Where a place lies between the second channel's voxels.
fn among_others(place: DVec3) -> DVec3 {
    let from = place - ORIGIN;
    DVec3::new(from.y / 2.3, -from.x / 1.9, from.z / 2.1)
}

/// Whether a place lies within the second channel's centres.
fn is_within(place: DVec3) -> bool {
    let at = among_others(place);
    at.cmpge(DVec3::splat(-1e-6)).all() && at.cmple(OTHER.as_dvec3() - 1.0 + 1e-6).all()
}

/// Four blocks of labels that are far apart as numbers.
fn label(place: DVec3) -> f64 {
    [3.0, 40.0, 0.0, 700.0][usize::from(place.x > 9.0) + 2 * usize::from(place.y > 8.0)]
}

/// A scene of a ball of values and a second volume, of which a function makes the samples.
fn scene(folder: &Path, keys: &str, of: impl Fn(DVec3) -> f64) -> Scene {
    let ball = |place: DVec3| 100.0 - 9.0 * place.distance(DVec3::new(9.0, 8.0, 7.0));
    write(&folder.join("mr.nrrd"), DIMS, (DVec3::ZERO, DVec3::AXES), ball);
    write(&folder.join("other.nrrd"), OTHER, (ORIGIN, STEPS), of);
    let text = format!("{keys}\n[[channel]]\nvolume.path = 'mr.nrrd'\n[[channel]]\nvolume.path = 'other.nrrd'\n");
    Scene::parse(&text, "scene.toml", folder, &["image={width=40,height=40}".to_owned()]).unwrap()
}

/// The places of the first channel's voxels, with the second one's values there.
fn samples(volume: &Volume) -> impl Iterator<Item = (DVec3, f32)> {
    let place = |index: usize| volume.grid().voxel_at(index as u32).as_dvec3();
    volume.channel(1).unwrap().values().iter().enumerate().map(move |(index, value)| (place(index), value))
}

#[test]
fn labels_are_those_of_the_nearest_voxel() {
    let folder = tempfile::tempdir().unwrap();
    let volume = scene(folder.path(), "", label).load_volume().unwrap();
    let mut found = std::collections::BTreeMap::<u16, usize>::new();
    for (place, value) in samples(&volume) {
        if !is_within(place) {
            assert!(value.is_nan(), "{place}: {value}");
            continue;
        }
        let nearest = among_others(place).round();
        let expected = label(ORIGIN + STEPS[0] * nearest.x + STEPS[1] * nearest.y + STEPS[2] * nearest.z);
        assert_eq!(f64::from(value), expected, "{place}");
        *found.entry(value as u16).or_default() += 1;
    }
    assert_eq!(found.keys().copied().collect::<Vec<_>>(), [0, 3, 40, 700]);
    assert!(found.values().all(|&count| count > 50), "{found:?}");
    // What is no label map has values in between.
    let waves = |place: DVec3| label(place) + (place.element_sum() * 3.7).sin();
    let amounts = scene(folder.path(), "", waves).load_volume().unwrap();
    assert!(samples(&amounts).any(|(_, value)| (100.0..600.0).contains(&value)));
    // Two values are a mask, which has a surface, unless the scene says that they are labels.
    let mask = |place: DVec3| if place.x > 9.0 { 7.0 } else { 0.0 };
    for (keys, has_between) in [("", true), ("preset = 'labels'", false)] {
        let scene = scene(folder.path(), keys, mask);
        let first = folder.path().join("mr.nrrd");
        // With this preset, the first channel's values must be labels too.
        write(&first, DIMS, (DVec3::ZERO, DVec3::AXES), |place| place.z);
        let volume = scene.load_volume().unwrap();
        let is_between = |value: f32| !value.is_nan() && value != 0.0 && value != 7.0;
        assert_eq!(samples(&volume).any(|(_, value)| is_between(value)), has_between, "{keys}");
    }
}

#[test]
fn labels_among_channels_keep_their_colours() {
    let folder = tempfile::tempdir().unwrap();
    for keys in ["", "preset = 'fusion'", "preset = 'mr-head'", "preset = 'confocal'"] {
        let scene = scene(folder.path(), keys, label);
        let volume = scene.load_volume().unwrap();
        let transfer = scene.resolve(&volume);
        for label in [3, 40, 700] {
            let of_label = &transfer[1];
            assert_eq!(of_label.color.at(label.into()), categories::color(label), "{keys} {label}");
            assert!(of_label.opacity.at(label.into()) >= 0.3 && of_label.opacity.at(0.0) == 0.0, "{keys} {label}");
        }
        assert_eq!(scene.classification(&volume), Classification::Before, "{keys}");
        assert_ne!(transfer[0].color, transfer[1].color, "{keys}");
        // A stated colour goes before it, and so does a stated opacity.
        let mut stated = scene.clone();
        stated.channels[1].transfer = crate::common::transfer(&[(0.0, [0.0, 1.0, 0.0])], &[(0.0, 0.0), (1.0, 0.125)]);
        stated.channels[1].transfer.preset = scene.channels[0].transfer.preset;
        let transfer = stated.resolve(&volume);
        assert_eq!((transfer[1].color.at(40.0), transfer[1].opacity.at(40.0)), (DVec3::Y, 0.125));
    }
    // Alone, the label map looks as it does among channels.
    let mut shown =
        scene(folder.path(), "shading.enabled = false\ncamera = {direction = [0, 0, 1], up = [0, 1, 0]}", label);
    shown.channels[0].visible = false;
    let volume = shown.load_volume().unwrap();
    let image = draw(Backend::Cpu, &volume, &shown).image;
    for label in [3, 40, 700] {
        let color = categories::color(label);
        let is_of_label = |pixel: &&[f32; 4]| {
            let [red, green, blue, _] = pixel.map(f64::from);
            DVec3::new(red, green, blue).distance(color) < 0.05
        };
        assert!(image.pixels.iter().filter(is_of_label).count() > 20, "{label}");
    }
    // In projections, numbers are amounts.
    let projected = scene(folder.path(), "preset = 'mip'", label);
    let transfer = projected.resolve(&projected.load_volume().unwrap());
    assert_eq!(transfer[1].color.at(40.0), DVec3::Y);
}

#[test]
fn beside_a_hole_is_a_hole() {
    let folder = tempfile::tempdir().unwrap();
    let hole = ORIGIN + STEPS[0] * 3.0 + STEPS[1] * 4.0 + STEPS[2] * 2.0;
    let amount = |place: DVec3| place.x + 0.25 * place.y;
    for of in [&label as &dyn Fn(DVec3) -> f64, &amount] {
        let punched = |place: DVec3| if place.distance(hole) < 0.1 { f64::NAN } else { of(place) };
        let volume = scene(folder.path(), "", punched).load_volume().unwrap();
        let mut holes = 0;
        for (place, value) in samples(&volume).filter(|(place, _)| is_within(*place)) {
            let distance = (among_others(place) - DVec3::new(3.0, 4.0, 2.0)).abs();
            let is_beside = distance.cmplt(DVec3::ONE).all();
            assert_eq!(value.is_nan(), is_beside, "{place}");
            holes += usize::from(is_beside);
        }
        assert!(holes > 30, "{holes}");
    }
}

#[test]
fn labels_of_a_volume_on_another_grid_follow_it() {
    let folder = tempfile::tempdir().unwrap();
    let mut scene = scene(folder.path(), "", |place| place.x + 2.0 * place.y + 0.1);
    write(&folder.path().join("labels.nrrd"), OTHER, (ORIGIN, STEPS), label);
    scene.channels[1].labels = Some(folder.path().join("labels.nrrd"));
    let volume = scene.load_volume().unwrap();
    let labels = volume.channel(1).unwrap().labels().unwrap();
    let mut inside = 0;
    for ((place, value), &found) in samples(&volume).zip(labels) {
        assert_eq!(value.is_nan(), !is_within(place), "{place}");
        if is_within(place) {
            // Values are resampled linearly all the same.
            assert_at_most((f64::from(value) - place.x - 2.0 * place.y - 0.1).abs(), 1e-4, place);
            let nearest = among_others(place).round();
            let expected = label(ORIGIN + STEPS[0] * nearest.x + STEPS[1] * nearest.y + STEPS[2] * nearest.z);
            assert_eq!(f64::from(found), expected, "{place}");
            inside += 1;
        }
    }
    assert!(inside > 500, "{inside}");
    // A label file on a grid other than its volume's is resampled by the nearest voxel: to the volume's grid, and with it to the first one's.
    write(&folder.path().join("labels.nrrd"), DIMS, (DVec3::ZERO, DVec3::AXES), label);
    let volume = scene.load_volume().unwrap();
    let labels = volume.channel(1).unwrap().labels().unwrap();
    for ((place, _), &found) in samples(&volume).zip(labels).filter(|((place, _), _)| is_within(*place)) {
        let nearest = among_others(place).round();
        let own = ORIGIN + STEPS[0] * nearest.x + STEPS[1] * nearest.y + STEPS[2] * nearest.z;
        assert_eq!(f64::from(found), label(own.round()), "{place}");
    }
}

#[test]
fn colours_are_resampled_linearly() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene(folder.path(), "", label);
    let color = |place: DVec3| DVec3::new(place.x * 10.0, 250.0 - place.y * 12.0, 20.0 + place.z * 11.0);
    let vector = |v: DVec3| format!("({},{},{})", v.x, v.y, v.z);
    let header = format!(
        "NRRD0005\ntype: float\ndimension: 4\nspace: left-posterior-superior\nsizes: 3 {} {} {}\nkinds: RGB-color domain domain domain\n\
         space directions: none {} {} {}\nspace origin: {}\nendian: little\nencoding: raw\n\n",
        OTHER.x,
        OTHER.y,
        OTHER.z,
        vector(STEPS[0]),
        vector(STEPS[1]),
        vector(STEPS[2]),
        vector(ORIGIN)
    );
    let mut bytes = header.into_bytes();
    for index in 0..OTHER.element_product() {
        let [i, j, k] = [index % OTHER.x, index / OTHER.x % OTHER.y, index / OTHER.x / OTHER.y].map(f64::from);
        let place = ORIGIN + STEPS[0] * i + STEPS[1] * j + STEPS[2] * k;
        // Floats are shares of 1.
        (color(place) / 255.0).to_array().iter().for_each(|&share| bytes.extend((share as f32).to_le_bytes()));
    }
    fs::write(folder.path().join("other.nrrd"), bytes).unwrap();
    let volume = scene.load_volume().unwrap();
    let colors = volume.channel(1).unwrap();
    let mut inside = 0;
    for (index, (place, value)) in (0..).zip(samples(&volume)) {
        assert_eq!(value.is_nan(), !is_within(place), "{place}");
        if is_within(place) {
            let found = colors.color(index).unwrap();
            let expected = (color(place) / 255.0).extend(1.0);
            // Numbers of 16 bits, rounded twice.
            assert_at_most((found - expected).abs().max_element(), 1.1 / 65535.0, place);
            inside += 1;
        }
    }
    assert!(inside > 500, "{inside}");
}
