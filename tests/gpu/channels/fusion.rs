//! Volumes on different grids in one space, and what is known about a point of several channels.

use std::fs;
use std::path::Path;

use glam::{DVec3, UVec3};
use sheetsplat::headless::{Backend, Headless, HeadlessOptions};
use sheetsplat::scene::Scene;
use sheetsplat::settings::{Classification, Compositing};
use sheetsplat::volume::Volume;

use crate::common::compare::assert_at_most;

/// Writes a NRRD of a function of the place in space, LPS.
pub(super) fn write(path: &Path, dims: UVec3, (origin, steps): (DVec3, [DVec3; 3]), of: impl Fn(DVec3) -> f64) {
    let vector = |v: DVec3| format!("({},{},{})", v.x, v.y, v.z);
    let header = format!(
        "NRRD0005\ntype: float\ndimension: 3\nspace: left-posterior-superior\nsizes: {} {} {}\nspace directions: {} {} {}\n\
         space origin: {}\nendian: little\nencoding: raw\n\n",
        dims.x,
        dims.y,
        dims.z,
        vector(steps[0]),
        vector(steps[1]),
        vector(steps[2]),
        vector(origin)
    );
    let mut bytes = header.into_bytes();
    for index in 0..dims.element_product() {
        let [i, j, k] = [index % dims.x, index / dims.x % dims.y, index / dims.x / dims.y].map(f64::from);
        let place = origin + steps[0] * i + steps[1] * j + steps[2] * k;
        bytes.extend((of(place) as f32).to_le_bytes());
    }
    fs::write(path, bytes).unwrap();
}

/// A CT-like volume, and a PET-like one that is turned by 90°, mirrored, coarser and elsewhere, of which the second shows a linear function.
fn phantom(folder: &Path, offset: DVec3) -> Scene {
    let ball = |place: DVec3| if place.distance(DVec3::new(10.0, 12.0, 8.0)) < 9.0 { 100.0 } else { -1000.0 };
    write(&folder.join("ct.nrrd"), UVec3::new(21, 25, 17), (DVec3::ZERO, DVec3::AXES), ball);
    let steps = [DVec3::new(0.0, 2.5, 0.0), DVec3::new(-2.0, 0.0, 0.0), DVec3::new(0.0, 0.0, 3.0)];
    let origin = DVec3::new(19.0, -4.0, -2.0) + offset;
    write(&folder.join("pet.nrrd"), UVec3::new(12, 8, 9), (origin, steps), linear);
    let text = "preset = 'fusion'\n[[channel]]\nvolume.path = 'ct.nrrd'\n[[channel]]\nname = 'uptake'\nvolume.path = 'pet.nrrd'\n";
    Scene::parse(text, "fusion.toml", folder, &["image={width=48,height=48}".to_owned()]).unwrap()
}

fn linear(place: DVec3) -> f64 {
    place.dot(DVec3::new(1.0, -0.5, 2.0)) + 40.0
}

#[test]
fn another_grid_is_resampled_in_the_files_space() {
    let folder = tempfile::tempdir().unwrap();
    let volume = phantom(folder.path(), DVec3::ZERO).load_volume().unwrap();
    let pet = volume.channel(1).unwrap();
    assert_eq!((pet.dims(), pet.spacing()), (volume.dims(), volume.spacing()));
    // From 5 to 19 along x, from -4 to 23.5 along y, from -2 to 22 along z.
    let mut inside = 0;
    for index in 0..pet.values().len() as u32 {
        let place = volume.grid().voxel_at(index).as_dvec3();
        let value = f64::from(pet.values().at(index as usize));
        if (5.0..=19.0).contains(&place.x) && place.y <= 23.5 {
            assert_at_most((value - linear(place)).abs(), 1e-4, format!("{place}"));
            inside += 1;
        } else {
            assert!(value.is_nan(), "{place}: {value}");
        }
    }
    assert_eq!(inside, 15 * 24 * 17);
    // The same grid is left as it is.
    let own = Volume::open(&folder.path().join("ct.nrrd")).unwrap();
    assert_eq!(volume.values(), own.values());
}

#[test]
fn volumes_that_do_not_overlap_are_refused_with_both_boxes() {
    let folder = tempfile::tempdir().unwrap();
    let message = phantom(folder.path(), DVec3::new(100.0, 0.0, 0.0)).load_volume().unwrap_err().to_string();
    assert!(
        message.contains("channel[1].volume: found the box from [-119.0, -23.5, -2.0] to [-105.0, 4.0, 22.0]"),
        "{message}"
    );
    assert!(
        message.contains("overlaps the first channel's, the box from [-20.0, -24.0, 0.0] to [0.0, 0.0, 16.0]"),
        "{message}"
    );
}

#[test]
fn without_a_space_centres_coincide() {
    let text = "[[channel]]\nvolume = {builtin = 'cube:16', spacing = [1, 1, 1]}\n[[channel]]\nvolume = {builtin = 'cube:16', spacing = [2, 2, 2]}";
    let volume = Scene::parse(text, "a", Path::new(""), &[]).unwrap().load_volume().unwrap();
    let (first, second) = (&volume, volume.channel(1).unwrap());
    // The second shows the middle of the cube, twice as large.
    for index in 0..first.values().len() as u32 {
        let from_center = volume.grid().voxel_at(index).as_dvec3() - 7.5;
        let place = from_center / 2.0 + 7.5;
        let low = place.floor().as_uvec3();
        let expected: f64 = (0..8_u32)
            .map(|corner| {
                let step = UVec3::new(corner & 1, corner >> 1 & 1, corner >> 2);
                let part = place - low.as_dvec3();
                let weight: f64 =
                    (0..3).map(|axis| if step[axis] == 1 { part[axis] } else { 1.0 - part[axis] }).product();
                weight * f64::from(first.value(low + step))
            })
            .sum();
        assert_at_most(
            (f64::from(second.values().at(index as usize)) - expected).abs(),
            1e-4,
            format!("{from_center}"),
        );
    }
}

#[test]
fn picks_name_the_channel() {
    let text = "
        image = {width = 32, height = 32}
        camera.direction = [0, 1, 0]
        [[channel]]
        name = 'left'
        transfer = {opacity = [[0, 0], [1, 0.9]], color = [[0, [1, 0, 0]]]}
        [[channel]]
        name = 'right'
        transfer = {opacity = [[0, 0], [1, 0.9]], color = [[0, [0, 1, 0]]]}
    ";
    let half = |is_left: bool| {
        let values = (0..16_u32.pow(3)).map(|index| f32::from(u8::from((index % 16 < 8) == is_left)) * 5.0);
        Volume::new("half", UVec3::splat(16), DVec3::ONE, values.collect()).unwrap()
    };
    let volume = half(true).with_channels("halves", vec![half(false)]).unwrap();
    let source = sheetsplat::scene::VolumeSource::Memory;
    let scene = Scene::parse_for(source, text, "a", Path::new(""), &[]).unwrap();
    let modes = [
        (Classification::Before, Compositing::Exponential),
        (Classification::After, Compositing::Exponential),
        (Classification::After, Compositing::Surface),
    ];
    let all = [Backend::Gpu, Backend::Cpu, Backend::Reference]
        .map(|backend| Headless::new(&HeadlessOptions::default().with_backend(backend)).unwrap());
    for (headless, (classification, compositing)) in all.iter().flat_map(|one| modes.map(|mode| (one, mode))) {
        let mut scene = scene.clone();
        (scene.splatting.classification, scene.splatting.compositing) = (classification, compositing);
        let what = format!("{} {classification:?} {compositing:?}", headless.backend());
        let mut view = headless.view(volume.clone(), &scene).unwrap();
        view.set_first_hit(Some(0.5)).unwrap();
        headless.draw(&mut view).unwrap();
        for (column, number, name) in [(10, 0, "left"), (21, 1, "right")] {
            let pick = headless.pick(&view, [column, 16]).unwrap().unwrap();
            assert_eq!((pick.channel, pick.value), (number, 5.0), "{what}");
            assert_eq!(scene.channel_name(&volume, pick.channel), name);
        }
        assert_eq!(headless.pick(&view, [0, 0]).unwrap(), None, "{what}: beside both");
    }
}

#[test]
fn the_preset_fusion_shows_both() {
    let folder = tempfile::tempdir().unwrap();
    let mut scene = phantom(folder.path(), DVec3::ZERO);
    // A ball with an edge as soft as scanners give, and a glow in its middle.
    let ball =
        |place: DVec3| (100.0 + 300.0 * (7.0 - place.distance(DVec3::new(10.0, 12.0, 8.0)))).clamp(-1000.0, 100.0);
    write(&folder.path().join("ct.nrrd"), UVec3::new(21, 25, 17), (DVec3::ZERO, DVec3::AXES), ball);
    let steps = DVec3::AXES.map(|axis| axis * 2.0);
    let glow = |place: DVec3| 8.0 * (-place.distance_squared(DVec3::new(10.0, 12.0, 8.0)) / 12.0).exp();
    write(&folder.path().join("pet.nrrd"), UVec3::new(11, 13, 9), (DVec3::ZERO, steps), glow);
    let volume = scene.load_volume().unwrap();
    let transfer = scene.resolve(&volume);
    let gray = transfer[0].color.at(100.0);
    assert!(gray.x == gray.y && gray.y == gray.z && gray.x > 0.5, "{gray}");
    let middle = 48 * 24 + 24;
    let image = |scene: &Scene| super::draw(Backend::Cpu, &volume, scene).image;
    let both = image(&scene);
    let [red, _, blue, _] = both.pixels[middle];
    assert!(red > 0.25 && red > blue + 0.15, "the glow is seen through the ball: {red} {blue}");
    let is_gray = |pixel: &&[f32; 4]| pixel[0] > 0.08 && (pixel[0] - pixel[2]).abs() < 0.02;
    assert!(both.pixels.iter().filter(is_gray).count() > 100, "the ball is seen around it");
    scene.channels[1].visible = false;
    let ball = image(&scene).pixels;
    let [red, green, blue, _] = ball[middle];
    assert!(red == green && green == blue && red > 0.1, "{red} {green} {blue}");
    // Finer grids let as much through.
    let opacity = |side: u32| {
        let ball = |index: u32| {
            let place = UVec3::new(index % side, index / side % side, index / side / side).as_dvec3() + 0.5;
            if (place / f64::from(side)).distance(DVec3::splat(0.5)) < 0.4 { 100.0 } else { -1000.0 }
        };
        let values = (0..side.pow(3)).map(ball).collect();
        let volume = Volume::new("ball", UVec3::splat(side), DVec3::splat(64.0 / f64::from(side)), values).unwrap();
        sheetsplat::appearance::Preset::Fusion.transfer(&volume).opacity.at(100.0) * f64::from(side)
    };
    assert_at_most((opacity(32) - opacity(64)).abs(), 1e-9, "opacity times side");
}
