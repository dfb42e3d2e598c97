//! Labels beyond 16 bits in scenes: tables, colours and saved scenes speak the file's numbers.

use std::fs;

use glam::DVec3;
use sheetsplat::appearance::categories;
use sheetsplat::scene::Scene;

/// The numbers of the labels of eight voxels along x; those from the second on lie beyond 16 bits, the last one beyond TOML's integers.
const IDS: [u64; 4] = [0, 70_000, 312_782_547, u64::MAX];

#[test]
fn tables_of_labels_are_by_their_numbers_in_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let header = |kind: &str| {
        format!("NRRD0004\ntype: {kind}\ndimension: 3\nsizes: 8 2 2\nspacings: 1 1 1\nendian: little\nencoding: raw\n")
    };
    let names = "Segment0_LabelValue:=312782547\nSegment0_Name:=area\nSegment0_Color:=0 0.5 1\n\n";
    let labels = (0..32).flat_map(|at| IDS[at % 8 / 2].to_le_bytes());
    let labels: Vec<u8> = (header("uint64") + names).into_bytes().into_iter().chain(labels).collect();
    let scan: Vec<u8> = (header("uint8") + "\n").into_bytes().into_iter().chain(0..32).collect();
    fs::write(folder.path().join("labels.nrrd"), labels).unwrap();
    fs::write(folder.path().join("scan.nrrd"), scan).unwrap();
    let text = "preset = 'labels'\nvolume.path = 'scan.nrrd'\nvolume.labels = 'labels.nrrd'\n\
                [[transfer.label]]\nlabel = 70000\nvisible = false\n\
                [[transfer.label]]\nlabel = '18446744073709551615'\ncolor = [[0, [1, 0, 0]]]\n\
                [[transfer.label]]\nlabel = 3\nvisible = false";
    let scene = Scene::parse(text, "scene.toml", folder.path(), &[]).unwrap();
    let volume = scene.load_volume().unwrap();
    assert_eq!(volume.label_ids(), Some(&IDS[..]));
    let transfer = scene.resolve(&volume);
    // Number 3 is no label of the file, whose third label it must not hide.
    let visible = [1, 2, 3].map(|label| transfer[0].tables(Some(label)).visible);
    assert_eq!(visible, [false, true, true]);
    assert_eq!(transfer[0].tables(Some(2)).color.at(0.0), DVec3::new(0.0, 0.5, 1.0));
    assert_eq!(transfer[0].tables(Some(3)).color.at(0.0), DVec3::X);
    assert_eq!(transfer[0].tables(Some(1)).color.at(0.0), categories::color((70_000 % 65_521) as u16));
    // A saved scene has the same numbers, and so the same tables.
    let saved = scene.explicit(&volume).to_toml(folder.path()).unwrap();
    let again = Scene::parse(&saved, "scene.toml", folder.path(), &[]).unwrap();
    assert_eq!(again.channels[0].transfer.labels.keys().copied().collect::<Vec<_>>(), IDS);
    assert_eq!(again.resolve(&volume)[0].labels, transfer[0].labels);
}

/// Ramps and intervals of a label map are over the file's numbers, and a saved scene's too.
#[test]
fn ramps_of_label_maps_are_over_their_numbers_in_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let header =
        "NRRD0004\ntype: uint64\ndimension: 3\nsizes: 8 2 2\nspacings: 1 1 1\nendian: little\nencoding: raw\n\n";
    let labels = (0..32).flat_map(|at| IDS[at % 8 / 2].to_le_bytes());
    let labels: Vec<u8> = header.bytes().chain(labels).collect();
    fs::write(folder.path().join("labels.nrrd"), labels).unwrap();
    let parse = |text: &str| Scene::parse(text, "scene.toml", folder.path(), &[]).unwrap();
    let text = "volume.path = 'labels.nrrd'\n[transfer]\n\
                color = [[70000, [1, 0, 0]], [312782547, [0, 1, 0]], [312852547, [0, 0, 1]]]\n\
                opacity = [[0, 0], [140000, 1]]\niso_ranges = [[1, 70000], [312782547, 1e30], [80000, 90000]]";
    let scene = parse(text);
    let volume = scene.load_volume().unwrap();
    assert_eq!((volume.label_ids(), volume.values().at(7)), (Some(&IDS[..]), 3.0));
    let transfer = scene.resolve(&volume);
    let colors = [0, 1, 2, 3].map(|place| transfer[0].color.at(f64::from(place)));
    assert_eq!(colors, [DVec3::X, DVec3::X, DVec3::Y, DVec3::Z]);
    assert_eq!([0, 1, 2, 3].map(|place| transfer[0].opacity.at(f64::from(place))), [0.0, 0.5, 1.0, 1.0]);
    assert_eq!(transfer[0].iso_ranges, Some(vec![[1.0, 1.0], [2.0, 3.0]]));
    let saved = scene.explicit(&volume).to_toml(folder.path()).unwrap();
    let again = parse(&saved);
    assert_eq!(again.resolve(&volume), transfer);
    let ends: Vec<f64> = again.channels[0].transfer.iso_ranges.clone().unwrap().concat();
    assert_eq!(ends, [70_000.0, 70_000.0, 312_782_547.0, u64::MAX as f64]);
    // No number of the file lies there.
    let nowhere = parse("volume.path = 'labels.nrrd'\ntransfer.iso_ranges = [[5, 6]]").resolve(&volume);
    assert!((0..4).all(|place| !nowhere[0].tables(None).in_iso_range(f64::from(place))));
    // Ramps that a scene leaves open are chosen over places.
    let chosen = parse("volume.path = 'labels.nrrd'");
    let colors = [1, 2].map(|place| chosen.resolve(&volume)[0].color.at(f64::from(place)));
    assert_eq!(colors, [70_000, 312_782_547].map(|id| categories::color((id % 65_521) as u16)));
    let again = parse(&chosen.explicit(&volume).to_toml(folder.path()).unwrap());
    assert_eq!([1, 2].map(|place| again.resolve(&volume)[0].color.at(f64::from(place))), colors);
}
