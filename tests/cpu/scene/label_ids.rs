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
    let visible = [1, 2, 3].map(|label| transfer.tables(Some(label)).visible);
    assert_eq!(visible, [false, true, true]);
    assert_eq!(transfer.tables(Some(2)).color.at(0.0), DVec3::new(0.0, 0.5, 1.0));
    assert_eq!(transfer.tables(Some(3)).color.at(0.0), DVec3::X);
    assert_eq!(transfer.tables(Some(1)).color.at(0.0), categories::color((70_000 % 65_521) as u16));
    // A saved scene has the same numbers, and so the same tables.
    let saved = scene.explicit(&volume).to_toml(folder.path()).unwrap();
    let again = Scene::parse(&saved, "scene.toml", folder.path(), &[]).unwrap();
    assert_eq!(again.transfer.labels.keys().copied().collect::<Vec<_>>(), IDS);
    assert_eq!(again.resolve(&volume).labels, transfer.labels);
}
