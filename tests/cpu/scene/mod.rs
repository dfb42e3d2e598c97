//! Scene files, `--set` overrides and their errors; transfer functions, stated and chosen.

mod classification;
mod fitting;
mod label_ids;
mod only;
mod refusals;

use std::path::{Path, PathBuf};

use glam::DVec3;
use sheetsplat::scene::{Channel, Fitting, ImageSettings, Scene, SceneError, TransferSettings, VolumeSource};
use sheetsplat::settings::{
    Camera, Classification, Clip, Compositing, Economies, Fit, FootprintBox, FootprintForm, Gradient, Interpolation,
    LabelTables, Light, Method, Order, Projection, Ramp, Rasterizer, Shading, SlabProfile, Splatting,
};

use crate::common::shared::shared;

const MINIMAL: &str = "[volume]\npath = 'a.nrrd'\n";

fn parse(text: &str, sets: &[&str]) -> Result<Scene, SceneError> {
    let sets: Vec<_> = sets.iter().map(|&set| set.to_owned()).collect();
    Scene::parse(text, "scene.toml", Path::new("folder"), &sets)
}

fn file(path: &str) -> VolumeSource {
    VolumeSource::File(PathBuf::from(path))
}

#[test]
fn defaults() {
    let scene = parse(MINIMAL, &[]).unwrap();
    assert_eq!(scene, Scene::new(file("folder/a.nrrd")));
    assert_eq!((scene.channels[0].spacing, &scene.channels[0].labels), (None, &None));
    assert_eq!(scene.camera, Camera { fit: Fit::Object, is_eye_open: true, ..Camera::default() });
    assert_eq!(scene.image, ImageSettings { width: 512, height: 512, background: [0.0, 0.0, 0.0, 1.0] });
    assert_eq!(scene.channels[0].transfer, TransferSettings::default());
    assert_eq!(scene.shading, Shading::default());
    assert_eq!(scene.splatting, Splatting { classification: Classification::Auto, ..Splatting::default() });
    assert_eq!(
        parse("[volume]\nbuiltin = 'cube'", &[]).unwrap().channels[0].volume,
        VolumeSource::Builtin("cube".to_owned())
    );
    assert_eq!(
        parse(MINIMAL, &["camera.projection=perspective"]).unwrap().camera.projection,
        Projection::Perspective { fov_y: 30.0, distance: None, near: None }
    );
}

#[test]
fn the_default_fit_depends_on_the_files_tables() {
    let volume = "volume.builtin = 'head:24'\n";
    let camera = "[camera]\ndirection = [1, 0, 0]";
    let sets = ["preset=ct-bone", "transfer.colormap=magma", "camera.direction=[1,0,0]", "transfer={opacity=[[9,1]]}"];
    for (keys, sets, fit) in [
        ("", &[][..], Fit::Object),
        // Whatever else is set.
        ("", &sets, Fit::Object),
        ("preset = 'ct-skin'\nimage.width = 9\nclip.planes = [[1, 0, 0, 0]]", &[], Fit::Object),
        ("[camera]", &[], Fit::Volume),
        (camera, &["camera={height=9}"], Fit::Volume),
        ("[transfer]\niso_ranges = [[1, 2]]", &sets[..3], Fit::Volume),
        ("transfer.opacity = [[0, 0.5]]", &[], Fit::Volume),
        // Unless it is stated.
        ("camera.fit = 'object'\ntransfer.opacity = [[0, 0.5]]", &[], Fit::Object),
        (camera, &["camera.fit=object"], Fit::Object),
        ("", &["camera.fit=volume"], Fit::Volume),
    ] {
        let camera = parse(&format!("{volume}{keys}"), sets).unwrap().camera;
        assert_eq!(camera.fit, fit, "{keys} {sets:?}");
        // The eye is open with these tables missing, unless its direction is stated.
        let is_bare = !["[camera]", "transfer", "camera.fit"].iter().any(|table| keys.contains(table));
        let states_direction = sets.iter().any(|set| set.starts_with("camera.direction"));
        assert_eq!(camera.has_open_eye(), is_bare && !states_direction, "{keys} {sets:?}");
        if keys.is_empty() {
            let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
            assert_eq!(Scene::from_volume(file("a.nrrd"), &sets).unwrap().camera.fit, fit, "{sets:?}");
        }
    }
}

#[test]
fn every_key() {
    let text = r#"
        [volume]
        path = "../b.nrrd"
        spacing = [1, 1.5, 3.0]
        labels = "segments/b.nrrd"
        [camera]
        projection = "perspective"
        direction = [1, 0.5, 0]
        up = [0, 0, -2]
        center = [1, -2, 3.5]
        fit = "object"
        height = 7
        fov_y = 45
        distance = 400.0
        near = 2
        [image]
        width = 1
        height = 300
        background = [1, 0.5, 0, 0.25]
        [clip]
        planes = [[0, 0, 2, -1], [1, 0.5, 0, 3]]
        crop = [[-1, -2, -3], [4, 5, 6.5]]
        shade_faces = false
        [transfer]
        color = [[-1, [0, 0, 0]], [80.5, [0.9, 0.7, 1]]]
        opacity = [[40, 0], [60, 0.8]]
        gradient_opacity = [[0, 0.5]]
        iso_ranges = [[40, 255], [300, 300]]
        [[transfer.label]]
        label = 65535
        visible = true
        color = [[3, [1, 1, 1]]]
        opacity = [[0, 0], [9, 1]]
        gradient_opacity = [[2, 0.25]]
        gradient = "membership"
        [[transfer.label]]
        label = 0
        visible = false
        [shading]
        enabled = false
        light = [0, 0, 2]
        ambient = 0
        diffuse = 0.5
        specular = 3
        shininess = 0.5
        gradient = "kernel"
        occlusion = 0.75
        occlusion_spread = 3
        shadow = 1
        shadow_spread = 0
        light_step = 0.5
        [splatting]
        method = "axis-aligned"
        radius = 1
        falloff = 16
        classification = "before"
        interpolation = "exact"
        slab_width = 0.05
        slab_profile = "cubic"
        footprint = "sections"
        compositing = "exponential"
        order = "back-to-front"
        opacity_threshold = 1
        culling = false
        tiles = false
        rasterizer = "tiles"
        footprint_box = "parallelogram"
        [splatting.experimental]
        whole_below = 0.25
        beta = 0.75
        resolution = 0.001
    "#;
    let scene = parse(text, &[]).unwrap();
    let mut channel = Channel::new(file("folder/../b.nrrd"));
    channel.spacing = Some(DVec3::new(1.0, 1.5, 3.0));
    channel.labels = Some(PathBuf::from("folder/segments/b.nrrd"));
    channel.transfer = TransferSettings {
        color: Some(Ramp::new(vec![(-1.0, DVec3::ZERO), (80.5, DVec3::new(0.9, 0.7, 1.0))]).unwrap()),
        opacity: Some(Ramp::new(vec![(40.0, 0.0), (60.0, 0.8)]).unwrap()),
        gradient_opacity: Some(Ramp::new(vec![(0.0, 0.5)]).unwrap()),
        iso_ranges: Some(vec![[40.0, 255.0], [300.0, 300.0]]),
        labels: [
            (0, LabelTables { visible: false, ..LabelTables::default() }),
            (
                65535,
                LabelTables {
                    visible: true,
                    color: Some(Ramp::new(vec![(3.0, DVec3::ONE)]).unwrap()),
                    opacity: Some(Ramp::new(vec![(0.0, 0.0), (9.0, 1.0)]).unwrap()),
                    gradient_opacity: Some(Ramp::new(vec![(2.0, 0.25)]).unwrap()),
                    membership: true,
                },
            ),
        ]
        .into(),
        ..TransferSettings::default()
    };
    let expected = Scene {
        channels: channel.into(),
        camera: Camera {
            projection: Projection::Perspective { fov_y: 45.0, distance: Some(400.0), near: Some(2.0) },
            direction: DVec3::new(1.0, 0.5, 0.0),
            up: DVec3::new(0.0, 0.0, -2.0),
            center: Some(DVec3::new(1.0, -2.0, 3.5)),
            fit: Fit::Object,
            is_eye_open: false,
        },
        image: ImageSettings { width: 1, height: 300, background: [1.0, 0.5, 0.0, 0.25] },
        clip: Clip {
            planes: vec![[0.0, 0.0, 2.0, -1.0], [1.0, 0.5, 0.0, 3.0]],
            crop: Some([DVec3::new(-1.0, -2.0, -3.0), DVec3::new(4.0, 5.0, 6.5)]),
            shade_faces: false,
        },
        shading: Shading {
            enabled: false,
            ambient: 0.0,
            diffuse: 0.5,
            specular: 3.0,
            shininess: 0.5,
            light: Light::Direction(DVec3::new(0.0, 0.0, 2.0)),
            gradient: Gradient::Kernel,
            occlusion: 0.75,
            occlusion_spread: 3.0,
            shadow: 1.0,
            shadow_spread: 0.0,
            light_step: 0.5,
        },
        splatting: Splatting {
            method: Method::AxisAligned,
            radius: 1.0,
            falloff: 16.0,
            classification: Classification::Before,
            interpolation: Interpolation::Exact,
            slab_width: 0.05,
            slab_profile: SlabProfile::Cubic,
            footprint: FootprintForm::Sections,
            compositing: Compositing::Exponential,
            order: Order::BackToFront,
            opacity_threshold: 1.0,
            culling: false,
            tiles: false,
            rasterizer: Rasterizer::Tiles,
            footprint_box: FootprintBox::Parallelogram,
            experimental: Economies { whole_below: 0.25, beta: 0.75, resolution: 0.001 },
        },
        fitting: Fitting::NONE,
    };
    assert_eq!(scene, expected);

    let scene = parse(text, &["camera.projection=orthographic", "splatting.compositing=xray"]).unwrap();
    assert_eq!(scene.camera.projection, Projection::Orthographic { height: Some(7.0) });
    assert_eq!(scene.splatting.compositing, Compositing::Xray);
    for (name, rasterizer) in [("auto", Rasterizer::Auto), ("quads", Rasterizer::Quads), ("tiles", Rasterizer::Tiles)] {
        let scene = parse(MINIMAL, &[&format!("splatting.rasterizer={name}")]).unwrap();
        assert_eq!(scene.splatting.rasterizer, rasterizer);
    }
    // A setting that excludes axis-aligned sheets and the preset for labels.
    let after = parse("volume.path = 'a.nrrd'", &["splatting.classification=after"]).unwrap();
    assert_eq!(after.splatting.classification, Classification::After);
    let scene = parse(text, &["splatting.method=composite-every-sample"]).unwrap();
    assert_eq!(scene.splatting.method, Method::CompositeEverySample);
    for (name, light) in [("headlight", Light::Headlight), ("upper-left", Light::UpperLeft)] {
        let scene = parse(MINIMAL, &[&format!("shading.light={name}")]).unwrap();
        assert_eq!(scene.shading.light, light);
        assert!(scene.to_toml(std::path::Path::new("")).unwrap().contains(&format!("light = \"{name}\"")));
    }
}

#[test]
fn overrides() {
    let text = "[volume]\nbuiltin = 'head'\n[splatting]\nslab_width = 0.5\nradius = 3";
    let scene = parse(text, &["splatting.slab_width=2.0", "splatting.slab_width = 4", "image.width=64"]).unwrap();
    assert_eq!((scene.splatting.slab_width, scene.splatting.radius, scene.image.width), (4.0, 3.0, 64));

    // An override replaces an invalid value, and decides which volume is used.
    assert!(parse(text, &["splatting.radius=9"]).is_err());
    assert!(parse(&text.replace('3', "9"), &["splatting.radius=2"]).is_ok());
    assert_eq!(parse(text, &["volume.path=x y.nrrd"]).unwrap().channels[0].volume, file("folder/x y.nrrd"));
    assert_eq!(parse(text, &["volume.path=\"/x.nrrd\""]).unwrap().channels[0].volume, file("/x.nrrd"));
    assert_eq!(
        parse(MINIMAL, &["volume.builtin=head:64"]).unwrap().channels[0].volume,
        VolumeSource::Builtin("head:64".to_owned())
    );
    assert_eq!(parse(text, &["volume.path=x.nrrd", "volume.builtin=cube"]).unwrap().channels[0].volume, {
        VolumeSource::Builtin("cube".to_owned())
    });

    // A whole table replaces the file's.
    let scene = parse(text, &["splatting={ tiles = false }"]).unwrap();
    assert_eq!(
        scene.splatting,
        Splatting { tiles: false, classification: Classification::Auto, ..Splatting::default() }
    );

    // A value may hold `=`, and arrays are TOML.
    assert_eq!(parse(text, &["volume.path=a=b.nrrd"]).unwrap().channels[0].volume, file("folder/a=b.nrrd"));
    assert_eq!(parse(text, &["camera.direction=[1, 0, 0]"]).unwrap().camera.direction, DVec3::X);
}

#[test]
fn volume_alone() {
    let sets = ["image.width=99".to_owned()];
    let scene = Scene::from_volume(VolumeSource::Builtin("cube".to_owned()), &sets).unwrap();
    assert_eq!((&scene.channels[0].volume, scene.image.width), (&VolumeSource::Builtin("cube".to_owned()), 99));
    let sets = ["volume.path=b.nrrd".to_owned()];
    assert_eq!(Scene::from_volume(file("a.nrrd"), &sets).unwrap().channels[0].volume, file("b.nrrd"));
    assert_eq!(Scene::from_volume(file("a.nrrd"), &[]).unwrap(), Scene::new(file("a.nrrd")));
}

#[test]
fn volumes_in_memory() {
    let parse_for = |text: &str| {
        let sets = ["image.width=9".to_owned()];
        Scene::parse_for(VolumeSource::Memory, text, "text", Path::new("folder"), &sets)
    };
    let scene = parse_for("[image]\nheight = 7").unwrap();
    assert_eq!((&scene.channels[0].volume, scene.image.width, scene.image.height), (&VolumeSource::Memory, 9, 7));
    // A text that names a volume keeps it.
    assert_eq!(parse_for(MINIMAL).unwrap().channels[0].volume, file("folder/a.nrrd"));
    assert_eq!(parse_for(&scene.to_toml(Path::new("folder")).unwrap()).unwrap(), scene);
    assert!(parse_for("transfer.label = [{ label = 3, visible = false }]").is_ok());
    let error = scene.load_volume().unwrap_err().to_string();
    assert_eq!(error, "scene: volume: found a volume in memory, allowed: volume.path or volume.builtin");
    let error = parse_for("camera.up = 5").unwrap_err().to_string();
    assert!(error.starts_with("text: camera.up: found"), "{error}");
}

#[test]
fn directions_of_any_length() {
    for (length, text) in [("1e-300", "[0, 1e-300, 0]"), ("1e300", "[0, 1e300, 0]"), ("5e-324", "[0, 5e-324, 0]")] {
        let set = format!("camera.direction={text}");
        let basis = parse(MINIMAL, &[&set, "camera.up=[0, 0, 1e-200]"]).unwrap().camera.basis();
        assert_eq!((basis.u, basis.v, basis.w), (DVec3::X, DVec3::Z, DVec3::Y), "{length}");
    }
}

/// Keys that a label's table omits are the main table's.
#[test]
fn tables_of_labels() {
    let scene = "[volume]\nbuiltin = 'head:8'\n[transfer]\ncolor = [[0, [1, 1, 1]]]\nopacity = [[0, 0.5]]\n\
                 gradient_opacity = [[0, 0.5]]\niso_ranges = [[10, 20]]\n\
                 [[transfer.label]]\nlabel = 2\nopacity = [[0, 0.25]]\n\
                 [[transfer.label]]\nlabel = 4\ncolor = [[0, [1, 0, 0]]]\ngradient_opacity = [[0, 1]]\n\
                 [[transfer.label]]\nlabel = 5\nvisible = false\nopacity = [[0, 1]]";
    let scene = parse(scene, &[]).unwrap();
    let transfer = scene.channels[0].transfer.resolve(&scene.load_volume().unwrap());
    let looks = [None, Some(0), Some(2), Some(4), Some(5)].map(|label| {
        let tables = transfer.tables(label);
        (tables.color.at(15.0).y, tables.alpha(15.0, 3.0), tables.alpha(25.0, 3.0))
    });
    assert_eq!(looks, [(1.0, 0.25, 0.0), (1.0, 0.25, 0.0), (1.0, 0.125, 0.0), (0.0, 0.5, 0.0), (1.0, 0.0, 0.0)]);
}

#[test]
fn scene_files() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, MINIMAL).unwrap();
    let scene = Scene::open(&path, &["image.height=7".to_owned()]).unwrap();
    assert_eq!(scene.channels[0].volume, VolumeSource::File(folder.path().join("a.nrrd")));
    assert_eq!(scene.image.height, 7);
    assert!(scene.load_volume().is_err());

    std::fs::write(&path, "[volume]\nbuiltin = 'cube'\nspacing = [1, 2, 3]\n[image]\nwidth = 0").unwrap();
    let message = Scene::open(&path, &[]).unwrap_err().to_string();
    assert!(
        message.starts_with(&format!("{}: image.width: found 0, allowed: an integer", path.display())),
        "{message}"
    );
    let scene = Scene::open(&path, &["image.width=1".to_owned()]).unwrap();
    assert_eq!(scene.load_volume().unwrap().spacing(), DVec3::new(1.0, 2.0, 3.0));

    let missing = folder.path().join("missing.toml");
    let error = Scene::open(&missing, &[]).unwrap_err();
    assert!(matches!(error, SceneError::Io { .. }));
    assert!(error.to_string().starts_with(&format!("{}: ", missing.display())), "{error}");
    std::fs::write(&path, [0xff, 0xfe]).unwrap();
    assert!(matches!(Scene::open(&path, &[]), Err(SceneError::Io { .. })));
}

#[test]
#[ignore = "needs the shared data: SHEETSPLAT_SHARED=FOLDER"]
fn shared_scenes() {
    let entries = shared("scenes").read_dir().unwrap().map(|entry| entry.unwrap().path());
    let scenes: Vec<_> = entries.filter(|path| path.extension().is_some_and(|e| e == "toml")).collect();
    assert!(!scenes.is_empty());
    for path in scenes {
        let scene = Scene::open(&path, &[]).unwrap_or_else(|error| panic!("{error}"));
        let VolumeSource::File(volume) = &scene.channels[0].volume else { panic!("{} has no file", path.display()) };
        assert!(volume.is_file(), "{}", volume.display());
    }
}
