//! One label alone.

use std::fs;
use std::path::Path;

use sheetsplat::Volume;
use sheetsplat::scene::Scene;

/// A scene and its volume.
fn loaded(text: &str, folder: &Path) -> (Scene, Volume) {
    let scene = Scene::parse(text, "scene.toml", folder, &[]).unwrap();
    let volume = scene.load_volume().unwrap();
    (scene, volume)
}

/// The numbers of the labels of voxels that take part.
fn shown(volume: &Volume, scene: &Scene) -> Vec<u64> {
    let transfer = scene.resolve(volume);
    let takes_part = |&index: &u32| {
        let (tables, value) = (transfer[0].tables(volume.label(index)), f64::from(volume.values().at(index as usize)));
        tables.visible && tables.in_iso_range(value) && tables.opacity.at(value) > 0.0
    };
    let label = |index: u32| volume.label(index).unwrap_or(volume.values().at(index as usize) as u16);
    let indices = (0..volume.values().len() as u32).filter(takes_part);
    let mut labels: Vec<u64> = indices.map(|index| volume.label_id(label(index))).collect();
    labels.sort_unstable();
    labels.dedup();
    labels
}

#[test]
fn all_other_labels_of_a_segmented_volume_are_hidden() {
    let (scene, volume) = loaded("volume.builtin = 'head:40'", "".as_ref());
    let all = shown(&volume, &scene);
    assert!(all.len() > 2, "{all:?}");
    for (&label, name) in volume.label_names().iter().filter(|(label, _)| all.contains(&u64::from(**label))) {
        let only = scene.only(name, &volume).unwrap();
        assert_eq!(shown(&volume, &only), [u64::from(label)], "{name}");
        assert_eq!(scene.only(&label.to_string(), &volume).unwrap(), only, "{name}");
    }
    let message = scene.only("livr", &volume).unwrap_err().to_string();
    assert!(message.starts_with("only: found \"livr\", allowed: "), "{message}");
    assert!(volume.label_names().values().all(|name| message.contains(&format!("\"{name}\""))), "{message}");
    assert!(scene.only("60000", &volume).is_err());
}

#[test]
fn a_label_map_shows_one_label() {
    let folder = tempfile::tempdir().unwrap();
    let header = "NRRD0004\ntype: uint32\ndimension: 3\nsizes: 8 4 4\nspacings: 1 1 1\nendian: little\nencoding: raw\n";
    let names = "Segment0_LabelValue:=2\nSegment0_Name:=kidney\nSegment1_LabelValue:=70000\nSegment1_Name:=kidney\n\n";
    let labels = (0..128_u32).flat_map(|at| [0, 2, 9, 70_000_u32][at as usize % 8 / 2].to_le_bytes());
    let bytes: Vec<u8> = header.bytes().chain(names.bytes()).chain(labels).collect();
    fs::write(folder.path().join("labels.nrrd"), bytes).unwrap();
    let (scene, volume) = loaded("volume.path = 'labels.nrrd'", folder.path());
    assert_eq!(shown(&volume, &scene), [2, 9, 70_000]);
    for (label, numbers) in [("kidney", &[2, 70_000][..]), ("2", &[2]), ("9", &[9]), ("70000", &[70_000])] {
        assert_eq!(shown(&volume, &scene.only(label, &volume).unwrap()), numbers, "{label}");
    }
    let message = scene.only("3", &volume).unwrap_err().to_string();
    assert_eq!(message, "only: found \"3\", allowed: 0, \"kidney\", 9, \"kidney\", or a label's number");
}

#[test]
fn values_have_no_label_alone() {
    let (scene, volume) = loaded("volume.builtin = 'cube:12'", "".as_ref());
    let message = scene.only("2", &volume).unwrap_err().to_string();
    assert_eq!(message, "only: found \"2\", allowed: a label map, or a volume with labels");
}
