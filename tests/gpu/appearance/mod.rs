//! Appearance chosen for volumes: presets, colour maps, labels, and scenes written out.

mod drawn;

use std::collections::BTreeMap;
use std::path::Path;

use glam::{DVec3, UVec3};
use sheetsplat::appearance::{Colormap, Preset, categories, shown_range};
use sheetsplat::cpu;
use sheetsplat::scene::{Scene, TransferSettings, VolumeSource};
use sheetsplat::settings::{Compositing, Economies, Projection, Ramp, TransferFunction};
use sheetsplat::volume::{Labels, Volume, builtin};

use crate::common::Random;
use crate::common::devices::gpu;
use crate::common::shared::shared;

fn builtin_scene(name: &str, sets: &[&str]) -> Scene {
    let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
    Scene::from_volume(VolumeSource::Builtin(name.to_owned()), &sets).unwrap()
}

fn row(values: &[f32]) -> Volume {
    Volume::new("row", UVec3::new(values.len() as u32, 1, 1), DVec3::ONE, values.to_vec()).unwrap()
}

#[test]
fn a_preset_gives_way_to_what_the_scene_says() {
    let volume = builtin::volume("head:24").unwrap();
    for (name, preset) in Preset::ALL {
        let plain = builtin_scene("head:24", &[&format!("preset={name}")]);
        assert_eq!((plain.channels[0].transfer.preset, plain.shading), (Some(preset), preset.shading()), "{name}");
        assert_eq!(plain.splatting.compositing, preset.compositing(), "{name}");
        assert_eq!(plain.channels[0].transfer.resolve(&volume), preset.transfer(&volume), "{name}");

        let text = format!(
            "preset = '{name}'\nvolume.builtin = 'head:24'\ntransfer.opacity = [[7, 0.25]]\n\
             shading.ambient = 0.875\nsplatting.compositing = 'linear'"
        );
        let scene = Scene::parse(&text, "scene.toml", Path::new(""), &[]).unwrap();
        assert_eq!(scene.shading.ambient, 0.875);
        assert_eq!(
            (scene.shading.diffuse, scene.shading.enabled),
            (preset.shading().diffuse, preset.shading().enabled)
        );
        assert_eq!(scene.splatting.compositing, Compositing::Linear);
        let transfer = scene.channels[0].transfer.resolve(&volume);
        assert_eq!(transfer.opacity, Ramp::new(vec![(7.0, 0.25)]).unwrap());
        assert_eq!(transfer.color, preset.transfer(&volume).color, "{name}");
    }
}

#[test]
fn unknown_names_are_refused_with_all_that_there_are() {
    let refused = |key: &str, allowed: &[&str]| {
        let text = format!("{key} = 'nonesuch'\nvolume.builtin = 'head'");
        let message = Scene::parse(&text, "scene.toml", Path::new(""), &[]).unwrap_err().to_string();
        assert!(message.starts_with(&format!("scene.toml: {key}: found \"nonesuch\", allowed: ")), "{message}");
        for name in allowed {
            assert!(message.contains(&format!("\"{name}\"")), "{name} in {message}");
        }
    };
    refused("preset", &Preset::ALL.map(|(name, _)| name));
    refused("transfer.colormap", &Colormap::ALL.map(|(name, _)| name));
}

/// Hounsfield units of air, fat, muscle, cancellous and compact bone, in the proportions of a head.
fn head_in_units() -> Vec<f64> {
    let mut random = Random(11);
    let shares = [(1100, -1000.0), (90, -90.0), (600, 45.0), (120, 420.0), (90, 1200.0)];
    let tissue = |(count, units): (usize, f64)| std::iter::repeat_n(units, count);
    shares.into_iter().flat_map(tissue).map(|units| units + random.uniform(-15.0, 15.0)).collect()
}

/// Whether a preset shows air, muscle and compact bone of the head.
fn opaque(preset: Preset, values: &[f32]) -> [bool; 3] {
    let transfer = preset.transfer(&row(values));
    [100, 1500, 1850].map(|at| transfer.alpha(values[at].into(), 0.0) > 0.4)
}

#[test]
fn ct_presets_find_the_same_tissues_however_units_are_stored() {
    let units = head_in_units();
    let stored = |store: fn(f64) -> f64| -> Vec<f32> { units.iter().map(|&units| store(units) as f32).collect() };
    for (name, values) in [
        ("signed", stored(f64::round)),
        ("unsigned 12 bits", stored(|units| (units + 1024.0).round())),
        ("8 bits", stored(|units| ((units + 1024.0) / 16.0).round())),
        ("stretched to 16 bits", stored(|units| ((units + 1024.0) * 16.0).round())),
        ("0 to 1", stored(|units| (units + 1024.0) / 4095.0)),
    ] {
        assert_eq!(opaque(Preset::CtSkin, &values), [false, true, true], "{name}");
        assert_eq!(opaque(Preset::CtBone, &values), [false, false, true], "{name}");
        assert_eq!(opaque(Preset::CtVessels, &values), [false, false, true], "{name}");
    }
    // Plain units and units with 1024 added are recognised exactly.
    let surface = |values: Vec<f32>| Preset::CtBone.transfer(&row(&values)).opacity.points()[0].0;
    assert_eq!(surface(stored(f64::round)), 150.0);
    assert_eq!(surface(stored(|units| (units + 1024.0).round())), 1174.0);
}

fn surface(values: &[f32]) -> f64 {
    let transfer = TransferFunction::from_histogram(&row(values));
    let points = transfer.opacity.points();
    (points[0].0 + points[1].0) / 2.0
}

#[test]
fn padding_and_hot_pixels_do_not_move_the_surface() {
    let mut values: Vec<f32> = head_in_units().iter().map(|&units| units.round() as f32).collect();
    let plain = surface(&values);
    assert!((-700.0..-300.0).contains(&plain), "{plain}");
    values.extend([-3024.0; 700]);
    let padded = surface(&values);
    assert!((-700.0..-300.0).contains(&padded), "padded: {padded}");

    let mut values: Vec<f32> =
        (0..40_000).map(|at| if at % 4 == 0 { 0.6 } else { 0.1 } + (at % 7) as f32 / 100.0).collect();
    let plain = surface(&values);
    values[17] = 1e6;
    values[4018] = -1e7;
    assert!((surface(&values) - plain).abs() < 0.02, "{} {plain}", surface(&values));
}

/// A volume of labels: 3 and 5 side by side in a box of 0, and 4 in a corner.
fn three_five() -> Volume {
    let dims = UVec3::new(28, 20, 20);
    let label = |index: u32| {
        let p = UVec3::new(index % dims.x, index / dims.x % dims.y, index / (dims.x * dims.y));
        match p {
            p if p.cmplt(UVec3::splat(3)).all() => 4.0,
            p if (p.cmpge(UVec3::splat(5)) & p.cmplt(dims - 5)).all() => {
                if p.x < 14 {
                    3.0
                } else {
                    5.0
                }
            }
            _ => 0.0,
        }
    };
    Volume::new("labels", dims, DVec3::ONE, (0..dims.element_product()).map(label).collect()).unwrap()
}

#[test]
fn label_maps_are_told_from_images() {
    assert!(categories::is_label_map(&three_five()));
    for name in builtin::NAMES {
        for size in [16, 48, 128] {
            let volume = builtin::volume(&format!("{name}:{size}")).unwrap();
            assert!(!categories::is_label_map(&volume), "{name}:{size}");
        }
    }
    // The labels of segmented volumes, as values.
    for name in ["head:64", "tomato:64"] {
        let volume = builtin::volume(name).unwrap();
        let values = volume.labels().unwrap().iter().map(|&label| f32::from(label)).collect();
        assert!(
            categories::is_label_map(&Volume::new(name, volume.dims(), volume.spacing(), values).unwrap()),
            "{name}"
        );
    }
    // A dim image has few values, but each is next to any other. Values that are not whole are no labels either.
    let mut random = Random(3);
    let dims = UVec3::splat(20);
    let noise = (0..8000).map(|_| random.uniform(0.0, 4.0).floor() as f32).collect();
    assert!(!categories::is_label_map(&Volume::new("noise", dims, DVec3::ONE, noise).unwrap()));
    let halves = three_five().values().iter().map(|value| value / 2.0).collect();
    let halves = Volume::new("halves", three_five().dims(), DVec3::ONE, halves).unwrap();
    assert!(!categories::is_label_map(&halves) && categories::values(&halves).is_none());
}

#[test]
#[ignore = "needs the shared data: SHEETSPLAT_SHARED=FOLDER"]
fn shared_label_maps_are_told_from_images() {
    for (name, expected) in [
        ("frog-labels", true),
        ("beads-confocal", false),
        ("mr-head", false),
        ("quarter-head", false),
        ("neuron", false),
    ] {
        let path = shared(&format!("data/{name}.nrrd"));
        assert_eq!(categories::is_label_map(&Volume::open(&path).unwrap()), expected, "{name}");
    }
}

#[test]
fn labels_have_colours_of_their_own() {
    let colors: Vec<DVec3> = (1..=32).map(categories::color).collect();
    for (at, color) in colors.iter().enumerate() {
        assert!(color.min_element() >= 0.0 && color.max_element() <= 1.0, "{color}");
        assert!(color.max_element() > 0.4, "{color} is too dark to be shaded");
        for other in &colors[..at] {
            assert!(color.distance(*other) > 0.09, "{color} and {other}");
        }
    }
    let transfer = TransferFunction::from_histogram(&three_five());
    for label in [3, 4, 5] {
        assert_eq!(transfer.color.at(f64::from(label)), categories::color(label));
    }
    assert_eq!((transfer.alpha(0.0, 0.0), transfer.alpha(3.0, 0.0)), (0.0, 0.9));
}

#[test]
fn the_labels_preset_colours_segments_too() {
    let volume = builtin::volume("head:24").unwrap();
    let text = "transfer.label=[{label = 2, opacity = [[0, 0.5]]}, {label = 0}]";
    let scene = builtin_scene("head:24", &["preset=labels", text]);
    scene.channels[0].transfer.check_volume(&volume).unwrap();
    let transfer = scene.channels[0].transfer.resolve(&volume);
    assert_eq!(transfer.tables(Some(5)).color.at(200.0), categories::color(5));
    // The preset fills in what a table of the scene omits.
    assert_eq!(transfer.tables(Some(2)).opacity, &Ramp::new(vec![(0.0, 0.5)]).unwrap());
    assert_eq!(transfer.tables(Some(2)).color.at(1.0), categories::color(2));
    assert!(transfer.tables(Some(0)).visible);
    assert!(!Preset::Labels.transfer(&volume).tables(Some(0)).visible);

    let message = builtin_scene("cube:8", &["preset=labels"]).channels[0]
        .transfer
        .check_volume(&row(&[0.5, 1.0]))
        .unwrap_err()
        .to_string();
    assert!(
        message.starts_with("preset: found labels, for a volume without labels, allowed: values that"),
        "{message}"
    );
    let labels = Labels {
        origin: "l".to_owned(),
        dims: UVec3::new(2, 1, 1),
        spacing: None,
        values: [1, 2].into(),
        names: BTreeMap::new(),
    };
    let labelled = row(&[0.5, 1.0]).with_labels(labels).unwrap();
    builtin_scene("cube:8", &["preset=labels"]).channels[0].transfer.check_volume(&labelled).unwrap();
}

#[test]
fn a_colour_map_spans_what_shows_and_keeps_the_opacity() {
    let values: Vec<f32> = (0..10_000).map(|at| (at / 10) as f32).collect();
    let volume = row(&values);
    let sets = ["transfer.opacity=[[199.5, 0], [250, 0.5]]", "transfer.iso_ranges=[[0, 799.5]]"];
    let resolved = |map: &str| {
        let map = format!("transfer.colormap={map}");
        builtin_scene("cube:8", &[sets[0], sets[1], &map]).channels[0].transfer.resolve(&volume)
    };
    let transfer = resolved("viridis");
    assert_eq!(transfer.opacity, Ramp::new(vec![(199.5, 0.0), (250.0, 0.5)]).unwrap());
    // 200 to 799 are visible, half a percent of them beyond each end.
    assert_eq!(shown_range(&volume, &transfer), Some([203.0, 796.0]));
    let rgb = |r: u32, g: u32, b: u32| DVec3::new(r.into(), g.into(), b.into()) / 255.0;
    // The colours as published.
    for (map, low, middle, high) in [
        ("viridis", rgb(68, 1, 84), rgb(33, 145, 140), rgb(253, 231, 37)),
        ("magma", rgb(0, 0, 4), rgb(183, 55, 121), rgb(252, 253, 191)),
        ("inferno", rgb(0, 0, 4), rgb(188, 55, 84), rgb(252, 255, 164)),
        ("plasma", rgb(13, 8, 135), rgb(204, 71, 120), rgb(240, 249, 33)),
        ("gray", rgb(0, 0, 0), rgb(128, 128, 128), rgb(255, 255, 255)),
        ("hot", rgb(11, 0, 0), rgb(255, 92, 0), rgb(255, 255, 255)),
        ("turbo", rgb(48, 18, 59), rgb(164, 252, 60), rgb(122, 4, 3)),
        ("coolwarm", rgb(59, 76, 192), rgb(221, 220, 220), rgb(180, 4, 38)),
    ] {
        let color = resolved(map).color;
        for (value, expected) in [(203.0, low), (499.5, middle), (796.0, high), (0.0, low), (5000.0, high)] {
            let difference = (color.at(value) - expected).abs().max_element() * 255.0;
            assert!(difference < 6.0, "{map} at {value}: {} {expected}", color.at(value));
        }
    }
    let nothing = builtin_scene("cube:8", &["transfer.colormap=magma", "transfer.opacity=[[0, 0]]"]);
    assert_eq!(shown_range(&volume, &nothing.channels[0].transfer.resolve(&volume)), None);
    let constant = builtin_scene("cube:8", &["transfer.colormap=gray"]).channels[0].transfer.resolve(&row(&[3.0; 9]));
    assert_eq!(constant.color.at(3.0), DVec3::ONE);
}

#[test]
fn a_colour_map_and_colours_are_one_thing() {
    let text = "volume.builtin = 'cube:8'\ntransfer.colormap = 'hot'\ntransfer.color = [[0, [1, 1, 1]]]";
    let message = Scene::parse(text, "scene.toml", Path::new(""), &[]).unwrap_err().to_string();
    assert!(message.starts_with("scene.toml: transfer: found both color and colormap, allowed: one of"), "{message}");
    let of = |sets: &[&str]| {
        let TransferSettings { color, colormap, .. } = builtin_scene("cube:8", sets).channels[0].transfer.clone();
        (color.is_some(), colormap)
    };
    let [color, map] = ["transfer.color=[[0, [1, 1, 1]]]", "transfer.colormap=hot"];
    assert_eq!((of(&[color, map]), of(&[map, color])), ((false, Some(Colormap::Hot)), (true, None)));
}

/// Scenes that together use every kind of setting.
fn many_scenes() -> Vec<Scene> {
    let image = "image={width=41,height=33,background=[0.1,0.2,0.3,0.5]}";
    let mut scenes = vec![
        builtin_scene("head:24", &[image]),
        builtin_scene(
            "head:24",
            &[
                image,
                "transfer.label=[{label=1,visible=false},{label=2,color=[[0,[1,0,0]],[9,[0,1,0]],[12,[0,0,1]],[99,[1,1,1]]],gradient_opacity=[[0,1]]}]",
            ],
        ),
        builtin_scene(
            "tomato:24",
            &[image, "camera={projection='perspective',direction=[1,2,-0.3],up=[0.1,0,1],center=[1e-7,2,3]}"],
        ),
        builtin_scene(
            "nerve:40",
            &[image, "camera={projection='perspective',fov_y=50,distance=900.25,near=3}", "clip.planes=[[1,0.5,0,10]]"],
        ),
        builtin_scene(
            "marschner-lobb:12",
            &[
                image,
                "clip={planes=[],crop=[[-1,-1,-1],[0.5,1,1]]}",
                "volume.spacing=[1,2.5,1]",
                "transfer.iso_ranges=[[30,90.5],[100,200]]",
            ],
        ),
        builtin_scene(
            "cube:12",
            &[
                image,
                "shading={enabled=false,light=[1,2,3]}",
                "splatting={method='axis-aligned',radius=1.5,falloff=3,slab_width=0.25,footprint='sections',compositing='linear',order='back-to-front',opacity_threshold=0.5,culling=false,tiles=false,rasterizer='quads'}",
            ],
        ),
        builtin_scene(
            "cube:12",
            &[
                image,
                "splatting={rasterizer='tiles',footprint_box='parallelogram',experimental={whole_below=0.1,beta=0.5,resolution=0.001}}",
            ],
        ),
        builtin_scene(
            "cube:12",
            &[
                image,
                "splatting={method='composite-every-sample'}",
                "transfer.opacity=[[-1e300,0],[1e-300,0.25],[1.5e300,1]]",
            ],
        ),
    ];
    scenes.push(builtin_scene("nerve:40", &[image, "transfer.colormap=turbo", "preset=confocal"]));
    let raw = ["volume.dims=[3,4,5]", "volume.type=float32", "volume.endian=big", "volume.offset=7", image];
    let raw = raw.map(str::to_owned);
    let from_file = Scene::from_volume(VolumeSource::File("/nowhere/ct.raw".into()), &raw).unwrap();
    assert!(matches!(from_file.channels[0].volume, VolumeSource::Raw(..)));
    scenes.push(from_file);
    scenes.extend(Preset::ALL.map(|(name, _)| builtin_scene("head:24", &[image, &format!("preset={name}")])));
    scenes.extend(
        // A builtin volume has no file, and so no palette.
        Colormap::ALL[..8]
            .iter()
            .map(|(name, _)| builtin_scene("nerve:40", &[image, &format!("transfer.colormap={name}")])),
    );
    scenes
}

#[test]
fn a_written_scene_is_read_as_the_same() {
    for scene in many_scenes() {
        let text = scene.to_toml(Path::new("")).unwrap();
        let read =
            Scene::parse(&text, "scene.toml", Path::new(""), &[]).unwrap_or_else(|error| panic!("{error}\n{text}"));
        if !text.contains("[camera]") {
            assert_eq!(read, scene, "{text}");
        }
        // A file with a camera or a transfer function cannot leave the eye to the volume: its direction is the default.
        let stated = |scene: Scene| {
            let camera = scene.camera.looking([scene.camera.direction, scene.camera.up]);
            Scene { camera, ..scene }
        };
        assert_eq!(stated(read), stated(scene), "{text}");
    }
}

#[test]
fn an_explicit_scene_renders_the_same_bytes_without_choosing() {
    let gpu = gpu();
    for scene in many_scenes().into_iter().filter(|scene| matches!(scene.channels[0].volume, VolumeSource::Builtin(_)))
    {
        let volume = scene.load_volume().unwrap();
        let explicit = scene.explicit(&volume);
        assert_eq!((explicit.channels[0].transfer.preset, explicit.channels[0].transfer.colormap), (None, None));
        assert!(explicit.channels[0].transfer.color.is_some() && explicit.channels[0].transfer.opacity.is_some());
        match explicit.camera.projection {
            Projection::Orthographic { height } => assert!(height.is_some()),
            Projection::Perspective { distance, near, .. } => assert!(distance.is_some() && near.is_some()),
        }
        let text = explicit.to_toml(Path::new("")).unwrap();
        let read = Scene::parse(&text, "scene.toml", Path::new(""), &[]).unwrap();
        assert_eq!(read, explicit);
        let [first, second] = [&scene, &read].map(|scene| gpu.render_volume(volume.clone(), scene).unwrap().image);
        assert!(first == second, "{text}");
        // The native backend has no economies.
        if scene.splatting.experimental == Economies::default() {
            let [first, second] = [&scene, &read].map(|scene| cpu::render(volume.clone(), scene).unwrap().image);
            assert!(first == second, "natively: {text}");
        }
    }
}

#[test]
fn paths_are_written_as_they_are_found_from_the_folder() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path().canonicalize().unwrap();
    for name in ["a/b", "data"] {
        std::fs::create_dir_all(root.join(name)).unwrap();
    }
    for name in ["data/v.nrrd", "a/b/l.nrrd"] {
        std::fs::write(root.join(name), "").unwrap();
    }
    let mut scene = Scene::new(VolumeSource::File(root.join("a/../data/v.nrrd")));
    scene.channels[0].labels = Some(root.join("a/b/l.nrrd"));
    // Absolute paths stay.
    let read = |text: &str, folder: &Path| Scene::parse(text, "scene.toml", folder, &[]).unwrap();
    assert_eq!(read(&scene.to_toml(&root.join("a")).unwrap(), Path::new("x")), scene);
    // Relative paths lead to the same files.
    let here = std::env::current_dir().unwrap();
    let up: std::path::PathBuf = here.components().skip(1).map(|_| "..").collect();
    scene.channels[0].volume = VolumeSource::File(up.join(root.join("data/v.nrrd").strip_prefix("/").unwrap()));
    scene.channels[0].labels = Some(up.join(root.join("a/b/l.nrrd").strip_prefix("/").unwrap()));
    let text = scene.to_toml(&root.join("a")).unwrap();
    assert!(text.contains("path = \"../data/v.nrrd\"") && text.contains("labels = \"b/l.nrrd\""), "{text}");
    let VolumeSource::File(path) = read(&text, &root.join("a")).channels[0].volume.clone() else { panic!("{text}") };
    assert_eq!(path.canonicalize().unwrap(), root.join("data/v.nrrd"));
}
