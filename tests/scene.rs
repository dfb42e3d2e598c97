//! Scene files, `--set` overrides and their errors; transfer functions, stated and chosen.
#![expect(clippy::unwrap_used, reason = "tests")]

#[path = "common/shared.rs"]
mod shared;

use std::path::{Path, PathBuf};

use glam::DVec3;
use sheetsplat::scene::{ImageSettings, Scene, SceneError, TransferSettings, VolumeSource};
use sheetsplat::settings::Clip;
use sheetsplat::settings::{Camera, Fit, Projection};
use sheetsplat::settings::{Classification, Gradient, Interpolation};
use sheetsplat::settings::{Compositing, Economies, FootprintBox, FootprintForm, Method, Order, Rasterizer, Splatting};
use sheetsplat::settings::{LabelTables, Ramp};
use sheetsplat::settings::{Light, Shading};

use shared::shared;

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
    assert_eq!((scene.spacing, &scene.labels), (None, &None));
    assert_eq!(scene.camera, Camera { fit: Fit::Object, ..Camera::default() });
    assert_eq!(scene.image, ImageSettings { width: 512, height: 512, background: [0.0, 0.0, 0.0, 1.0] });
    assert_eq!(scene.transfer, TransferSettings::default());
    assert_eq!(scene.shading, Shading::default());
    assert_eq!(scene.splatting, Splatting::default());
    assert_eq!(parse("[volume]\nbuiltin = 'cube'", &[]).unwrap().volume, VolumeSource::Builtin("cube".to_owned()));
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
        assert_eq!(parse(&format!("{volume}{keys}"), sets).unwrap().camera.fit, fit, "{keys} {sets:?}");
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
        [splatting]
        method = "axis-aligned"
        radius = 1
        falloff = 16
        classification = "before"
        interpolation = "exact"
        slab_width = 0.05
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
    let expected = Scene {
        volume: file("folder/../b.nrrd"),
        spacing: Some(DVec3::new(1.0, 1.5, 3.0)),
        labels: Some(PathBuf::from("folder/segments/b.nrrd")),
        camera: Camera {
            projection: Projection::Perspective { fov_y: 45.0, distance: Some(400.0), near: Some(2.0) },
            direction: DVec3::new(1.0, 0.5, 0.0),
            up: DVec3::new(0.0, 0.0, -2.0),
            center: Some(DVec3::new(1.0, -2.0, 3.5)),
            fit: Fit::Object,
        },
        image: ImageSettings { width: 1, height: 300, background: [1.0, 0.5, 0.0, 0.25] },
        clip: Clip {
            planes: vec![[0.0, 0.0, 2.0, -1.0], [1.0, 0.5, 0.0, 3.0]],
            crop: Some([DVec3::new(-1.0, -2.0, -3.0), DVec3::new(4.0, 5.0, 6.5)]),
        },
        transfer: TransferSettings {
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
                    },
                ),
            ]
            .into(),
            ..TransferSettings::default()
        },
        shading: Shading {
            enabled: false,
            ambient: 0.0,
            diffuse: 0.5,
            specular: 3.0,
            shininess: 0.5,
            light: Light::Direction(DVec3::new(0.0, 0.0, 2.0)),
            gradient: Gradient::Kernel,
        },
        splatting: Splatting {
            method: Method::AxisAligned,
            radius: 1.0,
            falloff: 16.0,
            classification: Classification::Before,
            interpolation: Interpolation::Exact,
            slab_width: 0.05,
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
    assert_eq!(parse(MINIMAL, &["shading.light=headlight"]).unwrap().shading.light, Light::Headlight);
}

/// A key, an invalid value, and what the error must contain: key, found, allowed.
const REFUSED: &[(&str, &str, &str, &str, &str)] = &[
    ("volume.path", "5", "volume.path", "5 (integer)", "a volume file's path"),
    ("volume.builtin", "true", "volume.builtin", "true (boolean)", "a builtin volume's name"),
    ("volume.spacing", "[1, 1]", "volume.spacing", "[1, 1]", "3 numbers, each a number in [1e-100, 1e100]"),
    ("volume.spacing", "2.0", "volume.spacing", "2.0 (float)", "3 numbers, each a number in [1e-100, 1e100]"),
    ("volume.spacing", "[1, 0, 1]", "volume.spacing[1]", "0", "a number in [1e-100, 1e100]"),
    ("volume.spacing", "[1, 1, inf]", "volume.spacing[2]", "inf", "a number in [1e-100, 1e100]"),
    ("volume.labels", "3", "volume.labels", "3 (integer)", "a label file's path"),
    ("volume.file", "'a'", "volume.file", "an unknown key", "path, builtin, spacing, labels"),
    ("camera.projection", "'ortho'", "camera.projection", "\"ortho\"", "\"orthographic\" or \"perspective\""),
    ("camera.projection", "1", "camera.projection", "1 (integer)", "\"orthographic\" or \"perspective\""),
    ("camera.direction", "[0, 0, 0.0]", "camera.direction", "[0, 0, 0.0]", "a vector other than [0, 0, 0]"),
    ("camera.direction", "[0, nan, 1]", "camera.direction[1]", "nan", "a finite number"),
    ("camera.direction", "[0, 1, '1']", "camera.direction[2]", "\"1\" (string)", "a finite number"),
    ("camera.direction", "'x'", "camera.direction", "\"x\" (string)", "3 numbers, each a finite number"),
    ("camera.direction", "[0, 0, -3]", "camera.up", "[0, 0, 1] with direction [0, 0, -3]", "not parallel to"),
    ("camera.up", "[0, 0, 0]", "camera.up", "[0, 0, 0]", "a vector other than [0, 0, 0]"),
    ("camera.up", "[0, 1e-200, 0]", "camera.up", "with direction [0, 1, 0]", "not parallel to camera.direction"),
    ("camera.up", "[1e-10, -5, 0]", "camera.up", "with direction [0, 1, 0]", "not parallel to camera.direction"),
    ("camera.up", "[0, 0, 1, 0]", "camera.up", "[0, 0, 1, 0]", "3 numbers, each a finite number"),
    ("camera.center", "[0, -inf, 0]", "camera.center[1]", "-inf", "a finite number"),
    ("camera.center", "[true, 0, 0]", "camera.center[0]", "true (boolean)", "a finite number"),
    ("camera.fit", "'head'", "camera.fit", "\"head\"", "\"volume\" or \"object\""),
    ("camera.fit", "1", "camera.fit", "1 (integer)", "\"volume\" or \"object\""),
    ("camera.height", "0", "camera.height", "0", "a finite number > 0"),
    ("camera.height", "-1.5", "camera.height", "-1.5", "a finite number > 0"),
    ("camera.height", "'tall'", "camera.height", "\"tall\" (string)", "a finite number > 0"),
    ("camera.fov_y", "0", "camera.fov_y", "0", "degrees in (0, 180)"),
    ("camera.fov_y", "180.0", "camera.fov_y", "180.0", "degrees in (0, 180)"),
    ("camera.distance", "0.0", "camera.distance", "0.0", "a finite number > 0"),
    ("camera.near", "-1", "camera.near", "-1", "a finite number > 0"),
    ("camera.near", "nan", "camera.near", "nan", "a finite number > 0"),
    (
        "camera.hight",
        "1",
        "camera.hight",
        "an unknown key",
        "projection, direction, up, center, fit, height, fov_y, distance",
    ),
    ("image.width", "0", "image.width", "0", "an integer from 1 to the device's texture limit"),
    ("image.width", "-5", "image.width", "-5", "an integer from 1"),
    ("image.width", "512.0", "image.width", "512.0 (float)", "an integer from 1"),
    ("image.height", "4294967296", "image.height", "4294967296", "an integer from 1"),
    ("image.height", "'512'", "image.height", "\"512\" (string)", "an integer from 1"),
    ("image.background", "[0, 0, 0]", "image.background", "[0, 0, 0]", "4 numbers, each a number in [0, 1]"),
    ("image.background", "[0, 0, 1.1, 1]", "image.background[2]", "1.1", "a number in [0, 1]"),
    ("image.background", "'black'", "image.background", "\"black\" (string)", "4 numbers"),
    ("image.size", "1", "image.size", "an unknown key", "width, height, background"),
    ("transfer.color", "[]", "transfer.color", "[]", "one or more [value, [r, g, b]]"),
    ("transfer.color", "[0, [0, 0, 0]]", "transfer.color[0]", "0 (integer)", "[value, [r, g, b]]"),
    ("transfer.color", "[[0, 0, 0, 0]]", "transfer.color[0]", "[0, 0, 0, 0]", "[value, [r, g, b]]"),
    ("transfer.color", "[[0, 0.5]]", "transfer.color[0][1]", "0.5 (float)", "3 numbers, each a number in [0, 1]"),
    ("transfer.color", "[[0, [0, 0, 2]]]", "transfer.color[0][1][2]", "2", "a number in [0, 1]"),
    ("transfer.color", "'red'", "transfer.color", "\"red\" (string)", "an array of one or more [value, [r, g, b]]"),
    (
        "transfer.color",
        "[[1, [0,0,0]], [1, [0,0,0]]]",
        "transfer.color[1]",
        "[1, [0, 0, 0]]",
        "above that of the point",
    ),
    ("transfer.opacity", "[]", "transfer.opacity", "[]", "one or more [value, opacity]"),
    ("transfer.opacity", "[[0, -0.1]]", "transfer.opacity[0][1]", "-0.1", "a number in [0, 1]"),
    ("transfer.opacity", "[[0, 0], [1, 1.5]]", "transfer.opacity[1][1]", "1.5", "a number in [0, 1]"),
    ("transfer.opacity", "[[0, 0], [nan, 1]]", "transfer.opacity[1][0]", "nan", "a finite number"),
    ("transfer.opacity", "[[0, 0], [60, 0.5], [40, 1]]", "transfer.opacity[2]", "[40, 1]", "above that of the point"),
    ("transfer.opacity", "[['a', 0]]", "transfer.opacity[0][0]", "\"a\" (string)", "a finite number"),
    ("transfer.opacity", "0.5", "transfer.opacity", "0.5 (float)", "an array of one or more [value, opacity]"),
    ("transfer.gradient_opacity", "[]", "transfer.gradient_opacity", "[]", "one or more [gradient magnitude, factor]"),
    ("transfer.gradient_opacity", "[[0, 2]]", "transfer.gradient_opacity[0][1]", "2", "a number in [0, 1]"),
    ("transfer.colormap", "'jet'", "transfer.colormap", "\"jet\"", "\"viridis\" or \"magma\" or \"inferno\""),
    ("transfer.colormap", "1", "transfer.colormap", "1 (integer)", "\"viridis\" or \"magma\""),
    ("clip.planes", "1", "clip.planes", "1 (integer)", "an array of at most 6 [nx, ny, nz, d]"),
    ("clip.planes", "[[1, 0, 0]]", "clip.planes[0]", "[1, 0, 0]", "4 numbers, each a finite number"),
    ("clip.planes", "[[1, 0, 0, 0], [0, 0, 0, 5]]", "clip.planes[1]", "[0, 0, 0, 5]", "a normal other than 0"),
    ("clip.planes", "[[1, nan, 0, 0]]", "clip.planes[0][1]", "nan", "a finite number"),
    (
        "clip.planes",
        "[[1,0,0,0],[1,0,0,0],[1,0,0,0],[1,0,0,0],[1,0,0,0],[1,0,0,0],[1,0,0,0]]",
        "clip.planes",
        "[[1, 0",
        "at most 6",
    ),
    ("clip.crop", "[[0, 0, 0]]", "clip.crop", "[[0, 0, 0]]", "[[x, y, z], [x, y, z]]"),
    ("clip.crop", "[[0, 0, 0], [1, 0, 1]]", "clip.crop", "[[0, 0, 0], [1, 0, 1]]", "each number of the first below"),
    ("clip.box", "1", "clip.box", "an unknown key", "planes, crop"),
    ("transfer.iso_ranges", "[]", "transfer.iso_ranges", "[]", "an array of one or more [lo, hi]"),
    ("transfer.iso_ranges", "[40, 255]", "transfer.iso_ranges[0]", "40 (integer)", "2 numbers, each a finite number"),
    ("transfer.iso_ranges", "[[0, 1], [5, 4.5]]", "transfer.iso_ranges[1]", "[5, 4.5]", "[lo, hi] with lo <= hi"),
    ("transfer.iso_ranges", "[[0, inf]]", "transfer.iso_ranges[0][1]", "inf", "a finite number"),
    ("transfer.colour", "[]", "transfer.colour", "an unknown key", "color, opacity, gradient_opacity, iso_ranges"),
    ("transfer.label", "{ label = 1 }", "transfer.label", "{ label = 1 } (table)", "tables [[transfer.label]]"),
    ("transfer.label", "[3]", "transfer.label[0]", "3 (integer)", "a table [[transfer.label]]"),
    ("transfer.label", "[{}]", "transfer.label[0].label", "no such key", "an integer from 0 to 65535"),
    ("transfer.label", "[{label = -1}]", "transfer.label[0].label", "-1", "an integer from 0 to 65535"),
    ("transfer.label", "[{label = 65536}]", "transfer.label[0].label", "65536", "an integer from 0 to 65535"),
    ("transfer.label", "[{label = 1.0}]", "transfer.label[0].label", "1.0 (float)", "an integer from 0 to 65535"),
    (
        "transfer.label",
        "[{label = 1}, {label = 1}]",
        "transfer.label[1].label",
        "1",
        "a label that no earlier table has",
    ),
    ("transfer.label", "[{label = 1, visible = 0}]", "transfer.label[0].visible", "0 (integer)", "true or false"),
    (
        "transfer.label",
        "[{label = 1}, {label = 2, opacity = [[0, 0], [60, 1.5]]}]",
        "transfer.label[1].opacity[1][1]",
        "1.5",
        "a number in [0, 1]",
    ),
    ("transfer.label", "[{label = 1, color = []}]", "transfer.label[0].color", "[]", "one or more [value, [r, g, b]]"),
    (
        "transfer.label",
        "[{label = 1, iso_ranges = [[0, 1]]}]",
        "transfer.label[0].iso_ranges",
        "an unknown key",
        "label, visible, color, opacity, gradient_opacity",
    ),
    // The volume has no labels.
    ("transfer.label", "[{label = 1}]", "transfer.label", "tables for a volume without labels", "volume.labels"),
    ("shading.enabled", "1", "shading.enabled", "1 (integer)", "true or false"),
    ("shading.light", "'sun'", "shading.light", "\"sun\"", "\"headlight\" or [x, y, z]"),
    ("shading.light", "3", "shading.light", "3 (integer)", "\"headlight\" or [x, y, z]"),
    ("shading.light", "[0, 0, 0]", "shading.light", "[0, 0, 0]", "a vector other than [0, 0, 0]"),
    ("shading.light", "[0, 1]", "shading.light", "[0, 1]", "3 numbers"),
    ("shading.ambient", "-0.1", "shading.ambient", "-0.1", "a finite number >= 0"),
    ("shading.diffuse", "inf", "shading.diffuse", "inf", "a finite number >= 0"),
    ("shading.specular", "'a'", "shading.specular", "\"a\" (string)", "a finite number >= 0"),
    ("shading.shininess", "0", "shading.shininess", "0", "a finite number > 0"),
    (
        "shading.glossy",
        "0",
        "shading.glossy",
        "an unknown key",
        "enabled, light, ambient, diffuse, specular, shininess",
    ),
    (
        "splatting.method",
        "'image'",
        "splatting.method",
        "\"image\"",
        "\"image-aligned\" or \"axis-aligned\" or \"composite-every-sample\"",
    ),
    ("splatting.radius", "0.99", "splatting.radius", "0.99", "a number in [1, 4]"),
    ("splatting.radius", "4.01", "splatting.radius", "4.01", "a number in [1, 4]"),
    ("splatting.falloff", "0", "splatting.falloff", "0", "a number in (0, 16]"),
    ("splatting.falloff", "16.5", "splatting.falloff", "16.5", "a number in (0, 16]"),
    ("splatting.slab_width", "0.04", "splatting.slab_width", "0.04", "a number in [0.05, 8]"),
    ("splatting.slab_width", "9", "splatting.slab_width", "9", "a number in [0.05, 8]"),
    ("shading.gradient", "'sobel'", "shading.gradient", "\"sobel\"", "\"differences\" or \"kernel\""),
    ("shading.gradient", "2", "shading.gradient", "2 (integer)", "\"differences\" or \"kernel\""),
    ("splatting.classification", "'never'", "splatting.classification", "\"never\"", "\"before\" or \"after\""),
    ("splatting.classification", "true", "splatting.classification", "true (boolean)", "\"before\" or \"after\""),
    ("splatting.interpolation", "'cubic'", "splatting.interpolation", "\"cubic\"", "\"smooth\" or \"exact\""),
    ("splatting.footprint", "'gauss'", "splatting.footprint", "\"gauss\"", "\"summed-area\" or \"sections\""),
    (
        "splatting.compositing",
        "'over'",
        "splatting.compositing",
        "\"over\"",
        "\"linear\" or \"exponential\" or \"xray\" or \"maximum\" or \"minimum\" or \"average\" or \"surface\"",
    ),
    ("splatting.order", "''", "splatting.order", "\"\"", "\"front-to-back\" or \"back-to-front\""),
    ("splatting.order", "1979-05-27", "splatting.order", "1979-05-27 (datetime)", "\"front-to-back\""),
    ("splatting.opacity_threshold", "0", "splatting.opacity_threshold", "0", "a number in (0, 1]"),
    ("splatting.opacity_threshold", "1.01", "splatting.opacity_threshold", "1.01", "a number in (0, 1]"),
    ("splatting.culling", "'yes'", "splatting.culling", "\"yes\" (string)", "true or false"),
    ("splatting.tiles", "0", "splatting.tiles", "0 (integer)", "true or false"),
    ("splatting.rasterizer", "'gpu'", "splatting.rasterizer", "\"gpu\"", "\"auto\" or \"quads\" or \"tiles\""),
    (
        "splatting.footprint_box",
        "'square'",
        "splatting.footprint_box",
        "\"square\"",
        "\"rectangle\" or \"parallelogram\"",
    ),
    ("splatting.experimental.whole_below", "1.5", "splatting.experimental.whole_below", "1.5", "a number in [0, 1]"),
    ("splatting.experimental.beta", "0", "splatting.experimental.beta", "0", "a number in (0, 1]"),
    ("splatting.experimental.resolution", "-0.1", "splatting.experimental.resolution", "-0.1", "a number in [0, 1]"),
    (
        "splatting.experimental.alpha",
        "1",
        "splatting.experimental.alpha",
        "an unknown key",
        "whole_below, beta, resolution",
    ),
    ("splatting.experimental", "1", "splatting.experimental", "1 (integer)", "a table"),
    ("splatting.whole_below", "0", "splatting.whole_below", "the former name", "splatting.experimental.whole_below"),
    ("splatting.beta", "0.5", "splatting.beta", "the former name", "splatting.experimental.beta"),
    ("splatting.resolution", "'x'", "splatting.resolution", "the former name", "splatting.experimental.resolution"),
    (
        "splatting.tile",
        "true",
        "splatting.tile",
        "an unknown key",
        "method, radius, falloff, slab_width, classification, interpolation, footprint",
    ),
];

#[test]
fn refused_values_are_named_with_their_origin() {
    for &(key, value, at, found, allowed) in REFUSED {
        let check = |result: Result<Scene, SceneError>, origin: &str| {
            let message = result.unwrap_err().to_string();
            assert!(message.starts_with(&format!("{origin}: {at}: found ")), "{key} = {value}: {message}");
            let (left, right) = message.split_once(", allowed: ").unwrap();
            assert!(left.contains(found), "{key} = {value}: {message}");
            assert!(right.contains(allowed), "{key} = {value}: {message}");
        };
        // As a scene file of its own, which lacks a volume unless the key is about one.
        let volume = if key.starts_with("volume") { "" } else { "volume.path = 'a.nrrd'\n" };
        check(parse(&format!("{volume}{key} = {value}"), &[]), "scene.toml");
        check(parse(MINIMAL, &[&format!("{key}={value}")]), "--set");
        check(Scene::from_volume(file("a.nrrd"), &[format!("{key}={value}")]), "--set");
    }
}

#[test]
fn refused_files() {
    let cases = [
        ("", "volume: found neither path nor builtin, allowed: either volume.path or volume.builtin"),
        ("[volume]", "volume: found neither path nor builtin, allowed: either volume.path or volume.builtin"),
        ("[volume]\npath = 'a'\nbuiltin = 'b'", "volume: found both path and builtin, allowed: either volume.path"),
        ("volume = 'a.nrrd'", "volume: found \"a.nrrd\" (string), allowed: a table"),
        ("[[volume]]\npath = 'a'", "volume: found [{ path = \"a\" }] (array), allowed: a table"),
        ("[volumes]\npath = 'a'", "volumes: found an unknown key, allowed: volume, camera, image, clip, transfer"),
        ("[volume]\npath = 'a'\n[a.b]", "a: found an unknown key, allowed: volume, camera"),
        ("\"a\\nb\" = 1", "a\\nb: found an unknown key, allowed: volume, camera"),
        ("[volume]\npath = ", "TOML parse error at line 2, column 8"),
        ("[volume]\npath = 'a'\npath = 'b'", "TOML parse error at line 3, column 1"),
    ];
    for (text, expected) in cases {
        let message = parse(text, &[]).unwrap_err().to_string();
        assert!(message.starts_with(&format!("scene.toml: {expected}")), "{text:?}: {message}");
    }
    assert!(matches!(parse("=", &[]), Err(SceneError::Syntax { .. })));
}

#[test]
fn label_tables_need_labels() {
    let text = "[[transfer.label]]\nlabel = 3\n[volume]\n";
    for volume in ["builtin = 'head'", "builtin = 'tomato:64'", "path = 'a.nrrd'\nlabels = 'b.nrrd'"] {
        assert_eq!(parse(&format!("{text}{volume}"), &[]).unwrap().transfer.labels.len(), 1, "{volume}");
    }
    let refused = |text: &str, sets: &[&str], origin: &str| {
        let message = parse(text, sets).unwrap_err().to_string();
        let expected = "transfer.label: found tables for a volume without labels, \
                        allowed: no such tables, or volume.labels, or volume.builtin = \"head\" or \"tomato\"";
        assert_eq!(message, format!("{origin}: {expected}"));
    };
    refused(&format!("{text}builtin = 'cube'"), &[], "scene.toml");
    refused(&format!("{text}builtin = 'head'"), &["volume.builtin=nerve:40"], "--set");
    refused(MINIMAL, &["transfer.label=[{label=1}]"], "--set");
    parse(MINIMAL, &["transfer.label=[{label=1}]", "volume.labels=b.nrrd"]).unwrap();
    // The name is wrong, which the volume's own error explains.
    parse(&format!("{text}builtin = 'skull'"), &[]).unwrap();
}

#[test]
fn long_values_are_cut() {
    let text = format!("{MINIMAL}[camera]\nprojection = \"\"\"\n{}\n\"\"\"", "ä\n".repeat(1000));
    let SceneError::Invalid { found, .. } = parse(&text, &[]).unwrap_err() else { panic!("another error") };
    assert_eq!((found.chars().count(), found.lines().count()), (81, 1));
}

#[test]
fn overrides() {
    let text = "[volume]\nbuiltin = 'head'\n[splatting]\nslab_width = 0.5\nradius = 3";
    let scene = parse(text, &["splatting.slab_width=2.0", "splatting.slab_width = 4", "image.width=64"]).unwrap();
    assert_eq!((scene.splatting.slab_width, scene.splatting.radius, scene.image.width), (4.0, 3.0, 64));

    // An override replaces an invalid value, and decides which volume is used.
    assert!(parse(text, &["splatting.radius=9"]).is_err());
    assert!(parse(&text.replace('3', "9"), &["splatting.radius=2"]).is_ok());
    assert_eq!(parse(text, &["volume.path=x y.nrrd"]).unwrap().volume, file("folder/x y.nrrd"));
    assert_eq!(parse(text, &["volume.path=\"/x.nrrd\""]).unwrap().volume, file("/x.nrrd"));
    assert_eq!(
        parse(MINIMAL, &["volume.builtin=head:64"]).unwrap().volume,
        VolumeSource::Builtin("head:64".to_owned())
    );
    assert_eq!(parse(text, &["volume.path=x.nrrd", "volume.builtin=cube"]).unwrap().volume, {
        VolumeSource::Builtin("cube".to_owned())
    });

    // A whole table replaces the file's.
    let scene = parse(text, &["splatting={ tiles = false }"]).unwrap();
    assert_eq!(scene.splatting, Splatting { tiles: false, ..Splatting::default() });

    // A value may hold `=`, and arrays are TOML.
    assert_eq!(parse(text, &["volume.path=a=b.nrrd"]).unwrap().volume, file("folder/a=b.nrrd"));
    assert_eq!(parse(text, &["camera.direction=[1, 0, 0]"]).unwrap().camera.direction, DVec3::X);
}

#[test]
fn refused_overrides() {
    let usage = "allowed: table.key=value, as in splatting.slab_width=2.0";
    let cases = [
        ("splatting.radius", format!("splatting.radius: found no \"=\", {usage}")),
        ("", format!(": found no \"=\", {usage}")),
        ("=1", format!("=1: found an empty key, {usage}")),
        (".radius=1", format!(".radius=1: found an empty key, {usage}")),
        ("splatting.=1", format!("splatting.=1: found an empty key, {usage}")),
        ("camera.up.x=1", "camera.up: found { x = 1 } (table), allowed: 3 numbers, each a finite number".to_owned()),
        (
            "splatting.radius.min.x=1",
            "splatting.radius: found { min = { x = 1 } } (table), allowed: a number".to_owned(),
        ),
        ("camera=1", "camera: found 1 (integer), allowed: a table".to_owned()),
        ("camera={ up = [1, 1] }", "camera.up: found [1, 1], allowed: 3 numbers, each a finite number".to_owned()),
        ("zoom=1", "zoom: found an unknown key, allowed: volume, camera".to_owned()),
        ("zoom.x=1", "zoom: found an unknown key, allowed: volume, camera".to_owned()),
        ("camera.up=[0,0", "camera.up: found \"[0,0\" (string), allowed: 3 numbers".to_owned()),
        ("image.width=", "image.width: found \"\" (string), allowed: an integer from 1".to_owned()),
        ("transfer.opacity[0]=1", "transfer.opacity[0]: found an unknown key, allowed: color, opacity".to_owned()),
        ("volume={}", "volume: found neither path nor builtin".to_owned()),
    ];
    for (set, expected) in &cases {
        let message = parse(MINIMAL, &[set]).unwrap_err().to_string();
        assert!(message.starts_with(&format!("--set: {expected}")), "{set}: {message}");
    }
    let message = parse("volume.path = 'a'\ncamera = 5", &["camera.up=[0, 0, 1]"]).unwrap_err().to_string();
    assert_eq!(message, "--set: camera.up: found camera = 5 (integer), allowed: camera to be a table");

    // An override of another key in the table is not named as the origin.
    let message = parse("[volume]\nspacing = [0, 1, 1]\npath = 'a'", &["volume.path=b"]).unwrap_err().to_string();
    assert!(message.starts_with("scene.toml: volume.spacing[0]: found 0"), "{message}");
    let message = parse("", &["volume.spacing=[1, 1, 1]"]).unwrap_err().to_string();
    assert!(message.starts_with("scene.toml: volume: found neither"), "{message}");
}

#[test]
fn volume_alone() {
    let sets = ["image.width=99".to_owned()];
    let scene = Scene::from_volume(VolumeSource::Builtin("cube".to_owned()), &sets).unwrap();
    assert_eq!((scene.volume, scene.image.width), (VolumeSource::Builtin("cube".to_owned()), 99));
    let sets = ["volume.path=b.nrrd".to_owned()];
    assert_eq!(Scene::from_volume(file("a.nrrd"), &sets).unwrap().volume, file("b.nrrd"));
    assert_eq!(Scene::from_volume(file("a.nrrd"), &[]).unwrap(), Scene::new(file("a.nrrd")));
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
    let transfer = scene.transfer.resolve(&scene.load_volume().unwrap());
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
    assert_eq!(scene.volume, VolumeSource::File(folder.path().join("a.nrrd")));
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
        let VolumeSource::File(volume) = scene.volume else { panic!("{} has no file", path.display()) };
        assert!(volume.is_file(), "{}", volume.display());
    }
}
