//! `[[channel]]` in scene files.

use std::path::Path;

use glam::DVec3;

use sheetsplat::headless::Backend;
use sheetsplat::scene::{Scene, SceneError, VolumeSource};
use sheetsplat::settings::Classification;
use sheetsplat::volume::{ChannelDisplay, Volume};

use super::{CLASSIFICATIONS, draw};

const TWO: &str = r#"
    [[channel]]
    name = "skull"
    [channel.volume]
    builtin = "head:16"
    [channel.transfer]
    opacity = [[30, 0], [200, 0.5]]
    color = [[0, [1, 0, 0]]]
    [[channel.transfer.label]]
    label = 2
    visible = false
    [[channel]]
    visible = false
    volume.builtin = "head:16"
    transfer.opacity = [[10, 0], [100, 0.25]]
    [camera]
    direction = [1, 0, 0]
"#;

fn parse(text: &str, sets: &[&str]) -> Result<Scene, SceneError> {
    let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
    Scene::parse(text, "scene.toml", Path::new("folder"), &sets)
}

fn refusal(text: &str, sets: &[&str]) -> String {
    parse(text, sets).unwrap_err().to_string()
}

#[test]
fn every_key_of_a_channel() {
    let scene = parse(TWO, &[]).unwrap();
    let channels: Vec<_> = scene.channels.iter().collect();
    assert_eq!(channels.len(), 2);
    assert_eq!((channels[0].name.as_deref(), channels[0].visible), (Some("skull"), true));
    assert_eq!((channels[1].name.as_deref(), channels[1].visible), (None, false));
    for channel in &channels {
        assert_eq!(channel.volume, VolumeSource::Builtin("head:16".to_owned()));
    }
    assert!(channels[0].transfer.labels.contains_key(&2));
    let tops: Vec<f64> = channels.iter().map(|of| of.transfer.opacity.as_ref().unwrap().points()[1].1).collect();
    assert_eq!(tops, [0.5, 0.25]);
    assert_eq!(scene.splatting.classification, Classification::Before);
    let volume = scene.load_volume().unwrap();
    assert_eq!(volume.channels().count(), 2);
    assert_eq!(scene.channel_name(&volume, 0), "skull");
    assert_eq!(scene.channel_name(&volume, 1), "channel 1");
}

#[test]
fn overrides_of_channels() {
    let sets = ["channel[1].visible=true", "channel[0].transfer.opacity=[[5, 1]]", "channel[1].volume.builtin=cube:16"];
    let scene = parse(TWO, &sets).unwrap();
    assert!(scene.channels[1].visible);
    assert_eq!(scene.channels[0].transfer.opacity.as_ref().unwrap().points(), [(5.0, 1.0)]);
    assert_eq!(scene.channels[1].volume, VolumeSource::Builtin("cube:16".to_owned()));
    let path = parse(TWO, &["channel[1].volume.path=b.nrrd"]).unwrap();
    assert_eq!(path.channels[1].volume.path(), Some(Path::new("folder/b.nrrd")));
    // A volume whose channels have no tables gets them.
    let source = VolumeSource::Builtin("head:16".to_owned());
    let bare = Scene::from_volume(source, &["channel[1].visible=false".to_owned()]).unwrap();
    assert_eq!((bare.channels[0].visible, bare.channels[1].visible), (true, false));
    assert_eq!(bare.channels[1].volume, VolumeSource::Memory);
    // A scene of one channel becomes one of several.
    let one = "volume.path = 'a.nrrd'\ntransfer.opacity = [[0, 1]]";
    let scene = parse(one, &["channel[1].transfer.opacity=[[0, 0.5]]"]).unwrap();
    assert_eq!(scene.channels[0].volume.path(), Some(Path::new("folder/a.nrrd")));
    assert_eq!(scene.channels[0].transfer.opacity.as_ref().unwrap().points(), [(0.0, 1.0)]);
    assert_eq!(scene.channels[1].transfer.opacity.as_ref().unwrap().points(), [(0.0, 0.5)]);
}

#[test]
fn refusals_name_the_channel_and_the_key() {
    let start = "[[channel]]\nvolume.builtin = 'cube'\n[[channel]]\n";
    for (keys, sets, found) in [
        (
            "color = 3",
            &[][..],
            "scene.toml: channel[1].color: found an unknown key, allowed: name, visible, volume, transfer",
        ),
        ("visible = 1", &[], "scene.toml: channel[1].visible: found 1 (integer), allowed: true or false"),
        (
            "volume.spacing = [1, 1, 1]",
            &[],
            "scene.toml: channel[1].volume: found keys of a volume without path or builtin",
        ),
        ("volume.path = 'a'\nvolume.builtin = 'b'", &[], "channel[1].volume: found both path and builtin"),
        ("volume.path = 'a'\nvolume.dims = [1, 1, 1]", &[], "channel[1].volume.type: found no such key"),
        (
            "transfer.opacity = [[0, 2]]",
            &[],
            "scene.toml: channel[1].transfer.opacity[0][1]: found 2, allowed: a number in [0, 1]",
        ),
        ("transfer.iso_ranges = []", &[], "scene.toml: channel[1].transfer.iso_ranges: found []"),
        (
            "transfer = {color = [[0, [0, 0, 0]]], colormap = 'hot'}",
            &[],
            "channel[1].transfer: found both color and colormap",
        ),
        (
            "volume.builtin = 'cube'\ntransfer.label = [{label = 1}]",
            &[],
            "channel[1].transfer.label: found tables for a volume without labels",
        ),
        ("", &["channel[1].visible=3"], "--set: channel[1].visible: found 3 (integer)"),
        ("", &["channel[0].transfer.opacity=[[0, 7]]"], "--set: channel[0].transfer.opacity[0][1]: found 7"),
        (
            "",
            &["channel[99].visible=true"],
            "--set: channel[99].visible: found 99, allowed: a number below 64 in brackets",
        ),
        ("", &["channel[x].visible=true"], "--set: channel[x].visible: found x"),
        (
            "",
            &["transfer.opacity=[[0, 1]]"],
            "--set: channel: found both, allowed: either [[channel]], or [volume] and [transfer]",
        ),
    ] {
        let message = refusal(&format!("{start}{keys}"), sets);
        assert!(message.contains(found), "{message}\n{found}");
    }
    let none = refusal("[[channel]]\nname = 'a'", &[]);
    assert!(none.contains("channel[0].volume: found neither path nor builtin"), "{none}");
    let both = refusal("volume.builtin = 'cube'\n[[channel]]\nname = 'a'", &[]);
    assert!(both.contains("scene.toml: channel: found both"), "{both}");
    let array = refusal("channel = 3", &[]);
    assert!(array.contains("channel: found 3 (integer)"), "{array}");
    // Of volumes, once they are known.
    let missing = parse("[[channel]]\nvolume.builtin = 'cube:8'\n[[channel]]\nvisible = false", &[]).unwrap();
    let volume = missing.load_volume().unwrap();
    let message = missing.check_volume(&volume).unwrap_err().to_string();
    assert_eq!(message, "channel: found tables for 2 channels, allowed: at most 1, as many as the volume has");
    let [eight, nine] = [8, 9].map(|side| {
        Volume::new("cube", glam::UVec3::splat(side), glam::DVec3::ONE, vec![1.0; side.pow(3) as usize]).unwrap()
    });
    let message = eight.with_channels("a host", vec![nine]).unwrap_err().to_string();
    assert!(message.contains("channel[1]: found the sizes [9, 9, 9], allowed: [8, 8, 8]"), "{message}");
}

#[test]
fn saved_scenes_are_read_back() {
    for text in
        [TWO, "[[channel]]\nvolume.builtin = 'cube:8'\n[[channel]]\nname = 'x'\n[[channel]]\nvolume.path = '/a.nrrd'"]
    {
        let scene = parse(text, &[]).unwrap();
        let saved = scene.to_toml(Path::new("")).unwrap();
        assert_eq!(Scene::parse(&saved, "saved", Path::new(""), &[]).unwrap(), scene, "{saved}");
    }
    let scene = parse(TWO, &[]).unwrap();
    let volume = scene.load_volume().unwrap();
    let explicit = scene.explicit(&volume);
    let again = Scene::parse(&explicit.to_toml(Path::new("")).unwrap(), "saved", Path::new(""), &[]).unwrap();
    assert_eq!(again, explicit);
    assert!(!again.channels[1].visible);
}

#[test]
fn saved_scenes_of_files_with_channels_are_read_back() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures/channels/imagej.tif");
    let source = VolumeSource::File(file.into());
    let sets = ["volume.time=1", "volume.spacing=[1,2,3]", "preset=confocal"].map(str::to_owned);
    let scene = Scene::from_volume(source, &sets).unwrap();
    let volume = scene.load_volume().unwrap();
    let explicit = scene.explicit(&volume);
    // The first table alone says which file, time and spacing.
    assert_eq!((explicit.channels[0].time, explicit.channels[1].time), (Some(1), None));
    assert_eq!((explicit.channels[0].spacing, explicit.channels[1].spacing), (Some(DVec3::new(1.0, 2.0, 3.0)), None));
    let saved = explicit.to_toml(Path::new("")).unwrap();
    let again = Scene::parse(&saved, "saved", Path::new(""), &[]).unwrap_or_else(|error| panic!("{error}\n{saved}"));
    assert_eq!(again, explicit);
    assert_eq!(again.load_volume().unwrap(), volume);
}

#[test]
fn one_channel_is_a_scene_of_one_volume() {
    let keys = "[camera]\ndirection = [0.3, 1, -0.2]\n[image]\nwidth = 40\nheight = 40\n";
    let transfer = "transfer.opacity = [[30, 0], [200, 0.5]]\ntransfer.color = [[0, [1, 0.5, 0]]]\n";
    for transfer in [transfer, ""] {
        let one = parse(&format!("volume.builtin = 'head:20'\n{transfer}{keys}"), &[]).unwrap();
        let table = parse(&format!("[[channel]]\nvolume.builtin = 'head:20'\n{transfer}{keys}"), &[]).unwrap();
        let named = parse(&format!("[[channel]]\nname = 'head'\nvolume.builtin = 'head:20'\n{transfer}{keys}"), &[]);
        assert_eq!(one, table);
        let volume = one.load_volume().unwrap();
        for classification in CLASSIFICATIONS {
            for backend in super::NATIVE {
                let [first, second] = [&one, named.as_ref().unwrap()].map(|scene| {
                    let mut scene = scene.clone();
                    scene.splatting.classification = classification;
                    draw(backend, &volume, &scene).image
                });
                assert_eq!(first, second, "{backend} {classification:?}");
                assert!(first.pixels.iter().any(|pixel| pixel[0] > 0.1));
            }
        }
    }
}

#[test]
fn a_volume_of_several_channels_needs_no_tables() {
    let ball = |at: f32| {
        let values = (0..16_u32.pow(3)).map(|index| {
            let [x, y, z] = [index % 16, index / 16 % 16, index / 256].map(|place| place as f32 - at);
            (200.0 - 30.0 * (x * x + y * y + z * z).sqrt()).max(0.0)
        });
        Volume::new("ball", glam::UVec3::splat(16), glam::DVec3::ONE, values.collect()).unwrap()
    };
    let volume = ball(4.0).with_channels("balls", vec![ball(11.0)]).unwrap();
    let scene = Scene::from_volume(VolumeSource::Memory, &["image={width=64,height=64}".to_owned()]).unwrap();
    // Magenta and green, by default.
    let image = draw(Backend::Cpu, &volume, &scene).image;
    let is_magenta = |pixel: &&[f32; 4]| pixel[0] > 0.2 && pixel[2] > 0.2 && pixel[1] < 0.5 * pixel[0];
    let is_green = |pixel: &&[f32; 4]| pixel[1] > 0.2 && pixel[0] < 0.5 * pixel[1] && pixel[2] < 0.5 * pixel[1];
    let (magenta, green) =
        (image.pixels.iter().filter(is_magenta).count(), image.pixels.iter().filter(is_green).count());
    assert!(magenta > 100 && green > 100, "{magenta} magenta pixels, {green} green ones");
}

#[test]
fn channels_have_windows_and_colours_of_their_own() {
    let random = &mut crate::common::Random(8);
    let (mut volume, _) = super::random_case(random, 2);
    let resolved = |volume: &Volume, sets: &[&str]| {
        let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
        Scene::from_volume(VolumeSource::Memory, &sets).unwrap().resolve(volume)
    };
    // The convention: each channel's opacity rises over its own values.
    for sets in [&[][..], &["preset=confocal"]] {
        let transfer = resolved(&volume, sets);
        let colors: Vec<_> = transfer.iter().map(|of| of.color.at(100.0)).collect();
        assert_eq!(colors, [DVec3::new(1.0, 0.0, 1.0), DVec3::Y]);
        let windows: Vec<_> = transfer.iter().map(|of| of.opacity.points().to_vec()).collect();
        assert!(windows.iter().all(|points| points.len() == 2 && points[0].1 == 0.0), "{windows:?}");
        assert_ne!(windows[0], windows[1]);
    }
    // What the file states goes before it, and what the scene states before that.
    let mut display = ChannelDisplay::default();
    (display.colors, display.window) = (vec![DVec3::X, DVec3::Z], Some([20.0, 70.0]));
    volume = volume.with_display(Some(display));
    for sets in [&[][..], &["preset=confocal"]] {
        let transfer = resolved(&volume, sets);
        let [start, top] = *transfer[0].opacity.points() else { panic!("{transfer:?}") };
        assert_eq!((start, top.0), ((20.0, 0.0), 70.0));
        // The mean ray through the volume meets an optical depth of 0.4, unless that takes more than half.
        let shares = volume.values().iter().map(|value| ((f64::from(value) - 20.0) / 50.0).clamp(0.0, 1.0));
        let mean = shares.sum::<f64>() / volume.values().len() as f64;
        let extent = (volume.dims().as_dvec3() * volume.grid().aspect()).element_sum() / 3.0;
        assert!((top.1 - (0.4 / (mean * extent)).min(0.5)).abs() < 1e-3, "{top:?}");
        assert_eq!([20.0, 70.0].map(|value| transfer[0].color.at(value)), [DVec3::X, DVec3::Z]);
        assert_eq!(transfer[1].color.at(0.0), DVec3::Y);
        let stated = resolved(&volume, &[sets, &["transfer.color=[[0,[0,1,1]]]"]].concat());
        assert_eq!(stated[0].color.at(20.0), DVec3::new(0.0, 1.0, 1.0));
    }
    let alone = super::single(&volume);
    assert_eq!(resolved(&alone, &["preset=confocal"])[0].opacity.points(), [(20.0, 0.0), (70.0, 0.5)]);
}
