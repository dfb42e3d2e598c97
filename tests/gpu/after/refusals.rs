//! Settings that exclude `after` are refused by their keys.

use std::path::Path;

use sheetsplat::RenderError;
use sheetsplat::internals::reference;
use sheetsplat::scene::Scene;
use sheetsplat::settings::{Classification, Splatting};

fn parse(sets: &[&str]) -> Result<Scene, sheetsplat::scene::SceneError> {
    let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
    Scene::parse("volume.builtin = 'head:16'", "scene.toml", Path::new(""), &sets)
}

#[test]
fn settings_that_exclude_after_are_named() {
    let after = "splatting.classification=after";
    for (sets, key, found, allowed) in [
        (&["splatting.method=axis-aligned"][..], "classification", "method = \"axis-aligned\"", "\"before\" with it"),
        (&["splatting.method=composite-every-sample"], "classification", "composite-every-sample", "\"before\""),
        (
            &["splatting.experimental.whole_below=0.1"],
            "classification",
            "\"after\" with splatting.experimental.whole_below = 0.1",
            "\"before\" with it, or splatting.experimental.whole_below = 0",
        ),
        (
            &["splatting.experimental.beta=0.9"],
            "classification",
            "\"after\" with splatting.experimental.beta = 0.9",
            "\"before\" with it, or splatting.experimental.beta = 1",
        ),
        (
            &["splatting.experimental.resolution=0.01"],
            "classification",
            "\"after\" with splatting.experimental.resolution = 0.01",
            "\"before\" with it, or splatting.experimental.resolution = 0",
        ),
        (&["splatting.falloff=11.5"], "falloff", "11.5 with splatting.classification", "at most 11"),
        (
            &["splatting.interpolation=exact", "splatting.falloff=0.94"],
            "interpolation",
            "\"exact\" with splatting.radius = 2 and splatting.falloff = 0.94",
            "\"smooth\" with them, or a larger falloff",
        ),
    ] {
        // Without `after` they are valid.
        parse(sets).unwrap().splatting.check().unwrap();
        let text = parse(&[&[after], sets].concat()).unwrap_err().to_string();
        assert!([key, found, allowed].iter().all(|words| text.contains(words)), "{sets:?}: {text}");
        // They are refused without a scene file, too.
        let mut scene = parse(sets).unwrap();
        scene.splatting.classification = Classification::After;
        let volume = scene.load_volume().unwrap();
        let error = reference::render(&volume, &[scene.channels[0].transfer.resolve(&volume)], &scene).unwrap_err();
        let RenderError::OutOfRange(error) = error else { panic!("{error}") };
        let (at, was, may) = (error.key, error.found.to_string(), error.allowed.to_string());
        assert_eq!(at, format!("splatting.{key}"), "{sets:?}");
        assert!(was.contains(found) && may.contains(allowed), "{sets:?}: found {was}, allowed {may}");
    }
    for sets in [["splatting.falloff=11", "image.width=8"], ["splatting.interpolation=exact", "splatting.falloff=0.95"]]
    {
        parse(&[&[after], &sets[..]].concat()).unwrap().splatting.check().unwrap();
    }
}

#[test]
fn the_preset_labels_excludes_after() {
    let error = parse(&["preset=labels", "splatting.classification=after"]).unwrap_err().to_string();
    let expected =
        "--set: splatting.classification: found \"after\" with preset = \"labels\", allowed: \"before\" with it";
    assert_eq!(error, expected);
    parse(&["preset=labels", "splatting.classification=before"]).unwrap();
    parse(&["preset=labels"]).unwrap();
    assert_eq!(Splatting::default().classification, Classification::Before);
}
