//! Values, files and overrides that are refused: the error names the origin, the key, what was found and what is allowed.

use sheetsplat::scene::{Scene, SceneError};

use super::{MINIMAL, file, parse};

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
        "an unknown key (perhaps height)",
        "projection, direction, up, center, fit, height, fov_y, distance",
    ),
    ("image.width", "0", "image.width", "0", "an integer from 1 to the device's texture limit"),
    ("image.width", "-5", "image.width", "-5", "an integer from 1"),
    ("image.width", "512.0", "image.width", "512.0 (float)", "an integer from 1"),
    ("image.height", "4294967296", "image.height", "4294967296", "an integer from 1"),
    ("image.height", "'512'", "image.height", "\"512\" (string)", "an integer from 1"),
    ("image.background", "[0, 0, 0]", "image.background", "[0, 0, 0]", "4 numbers, each a number in [0, 1]"),
    ("image.background", "[0, 0, 1.1, 1]", "image.background[2]", "1.1", "a number in [0, 1]"),
    (
        "image.background",
        "'blak'",
        "image.background",
        "\"blak\"",
        "4 numbers, each a number in [0, 1], or a CSS colour",
    ),
    ("image.background", "'#12345'", "image.background", "\"#12345\"", "\"transparent\""),
    // Colours that sRGB does not hold are not replaced by the nearest one.
    ("image.background", "'color(display-p3 0 1 0)'", "image.background", "display-p3", "a CSS colour"),
    ("image.background", "'rgb(none none nan)'", "image.background", "nan", "a CSS colour"),
    ("transfer.color", "[[0, 'transparent']]", "transfer.color[0][1]", "\"transparent\"", "an opaque CSS colour"),
    (
        "transfer.label",
        "[{label = 1, color = [[0, 'rd']]}]",
        "transfer.label[0].color[0][1]",
        "\"rd\"",
        "an opaque CSS",
    ),
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
    (
        "transfer.colour",
        "[]",
        "transfer.colour",
        "an unknown key (perhaps color)",
        "color, opacity, gradient_opacity, iso_ranges",
    ),
    ("transfer.label", "{ label = 1 }", "transfer.label", "{ label = 1 } (table)", "tables [[transfer.label]]"),
    ("transfer.label", "[3]", "transfer.label[0]", "3 (integer)", "a table [[transfer.label]]"),
    ("transfer.label", "[{}]", "transfer.label[0].label", "no such key", "an integer >= 0, from 2⁶³ on in quotes"),
    ("transfer.label", "[{label = -1}]", "transfer.label[0].label", "-1", "an integer >= 0, from 2⁶³ on in quotes"),
    ("transfer.label", "[{label = 'a'}]", "transfer.label[0].label", "a", "an integer >= 0"),
    (
        "transfer.label",
        "[{label = 1.0}]",
        "transfer.label[0].label",
        "1.0 (float)",
        "an integer >= 0, from 2⁶³ on in quotes",
    ),
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
    ("shading.light", "'sun'", "shading.light", "\"sun\"", "\"headlight\", \"upper-left\" or [x, y, z]"),
    ("shading.light", "3", "shading.light", "3 (integer)", "\"headlight\", \"upper-left\" or [x, y, z]"),
    ("shading.light", "[0, 0, 0]", "shading.light", "[0, 0, 0]", "a vector other than [0, 0, 0]"),
    ("shading.light", "[0, 1]", "shading.light", "[0, 1]", "3 numbers"),
    ("shading.ambient", "-0.1", "shading.ambient", "-0.1", "a finite number >= 0"),
    ("shading.diffuse", "inf", "shading.diffuse", "inf", "a finite number >= 0"),
    ("shading.specular", "'a'", "shading.specular", "\"a\" (string)", "a finite number >= 0"),
    ("shading.shininess", "0", "shading.shininess", "0", "a finite number > 0"),
    ("shading.occlusion", "1.5", "shading.occlusion", "1.5", "a number in [0, 1]"),
    ("shading.occlusion_spread", "-1", "shading.occlusion_spread", "-1", "a number in [0, 64]"),
    ("shading.shadow", "nan", "shading.shadow", "nan", "a number in [0, 1]"),
    ("shading.shadow_spread", "65", "shading.shadow_spread", "65", "a number in [0, 64]"),
    ("shading.light_step", "0.4", "shading.light_step", "0.4", "a number in [0.5, 16]"),
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
    (
        "splatting.interpolation",
        "'cubic'",
        "splatting.interpolation",
        "\"cubic\"",
        "\"smooth\" or \"exact\" or \"auto\"",
    ),
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
        "method, radius, falloff, slab_width, slab_profile, classification, interpolation, footprint",
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
        (
            "[volumes]\npath = 'a'",
            "volumes: found an unknown key (perhaps volume), allowed: volume, transfer, channel, camera",
        ),
        ("[volume]\npath = 'a'\n[a.b]", "a: found an unknown key, allowed: volume, transfer, channel, camera"),
        ("\"a\\nb\" = 1", "a\\nb: found an unknown key, allowed: volume, transfer, channel, camera"),
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
        assert_eq!(parse(&format!("{text}{volume}"), &[]).unwrap().channels[0].transfer.labels.len(), 1, "{volume}");
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
        ("zoom=1", "zoom: found an unknown key, allowed: volume, transfer, channel, camera".to_owned()),
        ("zoom.x=1", "zoom: found an unknown key, allowed: volume, transfer, channel, camera".to_owned()),
        ("camera.up=[0,0", "camera.up: found \"[0,0\" (string), allowed: 3 numbers".to_owned()),
        ("image.width=", "image.width: found \"\" (string), allowed: an integer from 1".to_owned()),
        (
            "transfer.opacity[0]=1",
            "transfer.opacity[0]: found an unknown key (perhaps opacity), allowed: color, opacity".to_owned(),
        ),
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
