//! Channels and times, and limits on files and memory.

use std::fs;
use std::path::Path;

use sheetsplat::Scene;
use sheetsplat::scene::VolumeSource;
use sheetsplat::volume::{Files, ReadOptions, Volume, VolumeError};

use crate::{fixture, values};

#[test]
fn keys_choose_a_channel_and_a_time() {
    for (name, channel, time) in
        [("both.npy", 0, 2), ("both.npy", 1, 0), ("imagej.tif", 1, 2), ("times.nii", 0, 1), ("vectors.vti", 1, 0)]
    {
        let path = fixture("channels").join(name);
        let options = ReadOptions::default().with_channel(channel).with_time(time);
        let expected = Volume::open_with(&path, &options).unwrap();
        let sets = [format!("volume.index={channel}"), format!("volume.time={time}")];
        let scene = Scene::from_volume(VolumeSource::File(path), &sets).unwrap();
        assert_eq!(scene.load_volume().unwrap(), expected, "{name}");
    }
}

/// A folder with slices of two series, by the number of one or its identity; saved scenes keep it, and nothing but DICOM has any.
#[test]
fn a_key_chooses_a_series() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["IM1", "IM2", "IM3.dcm"] {
        fs::copy(fixture("series").join(name), folder.path().join(name)).unwrap();
    }
    fs::copy(fixture("jpeg2000-large.dcm"), folder.path().join("large")).unwrap();
    let source = || VolumeSource::File(folder.path().to_owned());
    let dims = |series: &str| {
        let scene = Scene::from_volume(source(), &[format!("volume.series={series}")]).unwrap();
        let saved = Scene::parse(&scene.to_toml(Path::new("")).unwrap(), "scene.toml", Path::new(""), &[]).unwrap();
        assert_eq!(saved.channels[0].series, scene.channels[0].series);
        saved.load_volume().map(|volume| volume.dims().to_array())
    };
    assert_eq!(
        [dims("0").unwrap(), dims("\"1\"").unwrap(), dims("1.2.4").unwrap()],
        [[5, 4, 3], [70, 50, 1], [5, 4, 3]]
    );
    let message = dims("2").unwrap_err().to_string();
    assert!(
        message.contains("series: found 2, allowed: a number or a SeriesInstanceUID of 0: 3 of 5 × 4"),
        "{message}"
    );
    let scene = Scene::from_volume(VolumeSource::File(fixture("c.npy")), &["volume.series=0".to_owned()]).unwrap();
    let message = scene.load_volume().unwrap_err().to_string();
    assert!(message.contains("series: found 0, allowed: no series, which only DICOM has"), "{message}");
    assert!(Scene::from_volume(source(), &["volume.series=-1".to_owned()]).is_err());
}

/// Asserts that the message names the file.
#[track_caller]
fn assert_outside(result: Result<Volume, VolumeError>, file: &str) {
    let message = result.unwrap_err().to_string();
    assert!(message.contains(&format!("{file}: file: found a path that leads elsewhere, allowed: ")), "{message}");
}

#[test]
fn files_are_confined() {
    let folder = tempfile::tempdir().unwrap();
    let inside = folder.path().join("in");
    fs::create_dir(&inside).unwrap();
    fs::copy(fixture("c.npy"), inside.join("c.npy")).unwrap();
    for name in ["c.npy", "part0.bin"] {
        fs::copy(fixture(name), folder.path().join(name)).unwrap();
    }
    let options = ReadOptions::default().confined_to(&inside);
    let load = |text: &str| Scene::parse(text, "scene.toml", &inside, &[]).unwrap().load_volume_with(&options);
    assert_eq!(load("volume.path = 'c.npy'\nvolume.labels = 'c.npy'").unwrap().values(), values());
    assert_outside(load("volume.path = '../c.npy'"), "c.npy");
    assert_outside(load("volume.path = 'c.npy'\nvolume.labels = '../c.npy'"), "c.npy");
    assert_outside(
        load("volume = { path = '../part0.bin', dims = [5, 4, 1], type = 'uint16', endian = 'little' }"),
        "part0.bin",
    );
    fs::write(inside.join("../scene.toml"), "volume.builtin = 'cube:8'").unwrap();
    let error = Scene::open_with(&inside.join("../scene.toml"), &[], &options).unwrap_err().to_string();
    assert!(error.contains("scene.toml: file: found a path that leads elsewhere"), "{error}");
    fs::rename(inside.join("../scene.toml"), inside.join("scene.toml")).unwrap();
    assert!(Scene::open_with(&inside.join("scene.toml"), &[], &options).is_ok());
}

#[test]
fn memory_is_limited_for_all_of_a_scene() {
    let load = |text: &str, bytes: u64| {
        let folder = fixture("");
        Scene::parse(text, "scene.toml", &folder, &[])
            .unwrap()
            .load_volume_with(&ReadOptions::default().with_memory(bytes))
    };
    let labelled = "volume.path = 'c.npy'\nvolume.labels = 'c.npy'";
    assert!(load(labelled, 60 + 120).is_ok());
    let message = load(labelled, 60 + 119).unwrap_err().to_string();
    assert!(
        message.ends_with(
            "take 120 bytes of memory, allowed: at most the memory limit of 179 bytes, of which 60 are taken"
        ),
        "{message}"
    );
    let raw = "volume = { path = 'part0.bin', dims = [5, 4, 1], type = 'uint16', endian = 'little' }";
    assert!(load(raw, 40).is_ok());
    assert!(load(raw, 39).unwrap_err().to_string().contains("part0.bin: data: found 5 × 4 × 1 voxels"));
    // Values and labels together.
    assert!(load("volume.builtin = 'head:8'", 8 * 8 * 5 * 6).is_ok());
    let message = load("volume.builtin = 'head:8'", 8 * 8 * 5 * 6 - 1).unwrap_err().to_string();
    assert!(message.starts_with("builtin:head:8: size: found 8 × 8 × 5 voxels, which take 1920 bytes"), "{message}");
    let message = load("volume.builtin = 'cube:1024'", 1 << 20).unwrap_err().to_string();
    assert!(message.contains("4294967296 bytes"), "{message}");
}

#[test]
fn scenes_in_memory_name_files_in_memory() {
    let text = "volume.path = \"./c.npy\"\nimage = { width = 8, height = 8 }\n";
    let files: Files =
        [("c.npy", fs::read(fixture("c.npy")).unwrap()), ("scene.toml", text.into()), ("bad.toml", vec![0xff, 0xfe])]
            .into_iter()
            .collect();
    let options = ReadOptions::default().with_files(files);
    let open = |name: &str| Scene::open_with(Path::new(name), &[], &options);
    assert_eq!(open("scene.toml").unwrap().load_volume_with(&options).unwrap().values(), values());
    let missing = open("other.toml").unwrap_err().to_string();
    assert!(missing.starts_with("other.toml: no such file among those given: "), "{missing}");
    let bad = open("bad.toml").unwrap_err().to_string();
    assert!(bad.starts_with("bad.toml: ") && bad.contains("utf-8"), "{bad}");
}
