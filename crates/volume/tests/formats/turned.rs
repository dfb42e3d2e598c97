//! Files with left-handed axes, whose first axis is turned. The right values are nibabel's, which wrote the pair of fixtures by `as_reoriented`.

use std::sync::Arc;

use serde_json::{Value, json};
use sheetsplat_volume::internals::{Access, Resampling};
use sheetsplat_volume::{
    Grid, IndexedStore, Labels, ReadOptions, Store, StoreIndex, StreamedChannel, StreamedLevel, StreamedVolume,
    open_store,
};

use super::boxes::assert_holds;
use crate::*;

fn pair(name: &str) -> PathBuf {
    fixture("turned").join(name)
}

fn access() -> Access {
    Access::new(&ReadOptions::default()).unwrap()
}

#[test]
fn left_handed_files_are_turned() {
    let [ras, las] = ["ras.nii", "las.nii"].map(|name| Volume::open(&pair(name)).unwrap());
    assert!(ras.values() == las.values() && ras.orientation() == las.orientation());
    assert_eq!((ras.grid().is_turned(), las.grid().is_turned()), (false, true));
    let rows: Vec<f32> = ras.values().to_vec().chunks(24).flat_map(|row| row.iter().rev().copied()).collect();
    assert_eq!(in_file_order(&las), rows);
    let own = las.file_orientation().unwrap();
    assert_eq!((own.axes.x_axis, own.origin), (DVec3::NEG_X, DVec3::new(23.0, 0.0, 0.0)));
    assert_eq!(las.grid().file_voxel(UVec3::new(1, 2, 3)), UVec3::new(22, 2, 3));
    assert_eq!(las.grid().file_voxel(UVec3::new(22, 2, 3)), UVec3::new(1, 2, 3));
}

#[test]
fn labels_are_turned_with_their_volume() {
    let [ras, las] = ["ras.nii", "las.nii"].map(|name| Volume::open(&pair(name)).unwrap());
    let expected = Labels::open(&pair("labels-ras.nii")).unwrap().values;
    for volume in [&ras, &las] {
        for name in ["labels-ras.nii", "labels-las.nii"] {
            let (labelled, warnings) = warned(|| volume.clone().with_labels_of(&pair(name), false, &access()).unwrap());
            assert!(labelled.labels().unwrap() == &*expected && warnings.is_empty(), "{name}: {warnings:?}");
        }
    }
    // Labels of an array, and those of a file that states no place, are in the order of the volume's file.
    let own = Labels::open(&pair("labels-las.nii")).unwrap();
    assert!(las.clone().with_labels(own.clone()).unwrap().labels().unwrap() == &*expected);
    let folder = Folder::new();
    let header = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 24 20 18\nencoding: raw\n\n";
    let bytes: Vec<u8> = own.values.iter().map(|&label| label as u8).collect();
    let plain = folder.write("plain.nrrd", &[header.as_bytes(), &bytes]);
    assert!(las.clone().with_labels_of(&plain, true, &access()).unwrap().labels().unwrap() == &*expected);
    // And so are channels.
    let channel = Volume::open(&plain).unwrap();
    let (onto, warnings) = warned(|| channel.onto(&las, Resampling::Nearest, ("channel", &plain), &access()).unwrap());
    let labels: Vec<f32> = expected.iter().map(|&label| f32::from(label)).collect();
    // Its spacing of 1 is another one.
    assert_warned(&warnings, "resampled");
    let middle = |volume: &[f32]| volume[24 * (10 + 20 * 9)..][..24].to_vec();
    assert_eq!(middle(&onto.values().to_vec()), middle(&labels));
    let back = Volume::open(&pair("labels-las.nii")).unwrap().onto(&ras, Resampling::Nearest, ("b", &plain), &access());
    assert!(back.unwrap().values() == labels);
}

#[test]
fn streamed_labels_are_turned_with_their_volume() {
    let open = |name: &str| StreamedLevel::new(name, open_store(&pair(name), &ReadOptions::default()).unwrap(), 0);
    let expected = Labels::open(&pair("labels-ras.nii")).unwrap().values;
    let folder = Folder::new();
    let header = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 24 20 18\nencoding: raw\n\n";
    let own = Labels::open(&pair("labels-las.nii")).unwrap();
    let bytes: Vec<u8> = own.values.iter().map(|&label| label as u8).collect();
    let plain = folder.write("plain.nrrd", &[header.as_bytes(), &bytes]);
    let plain = StreamedLevel::new("plain", open_store(&plain, &ReadOptions::default()).unwrap(), 0);
    for labels in [open("labels-ras.nii"), open("labels-las.nii"), plain] {
        let channel = StreamedChannel::from(open("las.nii")).with_labels(labels).unwrap();
        let volume = StreamedVolume::of_channels(channel, 1 << 30).unwrap();
        assert!(volume.sample.labels().unwrap() == &*expected);
    }
    // An error tells the file's own voxel.
    let damaged = [header.replace("uint8", "int8").as_bytes(), &[&[0xff][..], &bytes[1..]].concat()].concat();
    let damaged = folder.write("damaged.nrrd", &[&damaged]);
    let labels = StreamedLevel::new("damaged", open_store(&damaged, &ReadOptions::default()).unwrap(), 0);
    let channel = StreamedChannel::from(open("las.nii")).with_labels(labels).unwrap();
    let error = StreamedVolume::of_channels(channel, 1 << 30).unwrap_err().to_string();
    assert!(error.contains("-1 at voxel [0, 0, 0]"), "{error}");
}

#[test]
fn boxes_of_left_handed_files() {
    let store = open_store(&pair("las.nii"), &ReadOptions::default()).unwrap();
    assert_holds(&store, &Volume::open(&pair("ras.nii")).map(|ras| as_turned(ras, &pair("las.nii"))).unwrap(), "las");
    assert_ne!(store.identity(), open_store(&pair("ras.nii"), &ReadOptions::default()).unwrap().identity());
    let mut values = [0.0; 2];
    for from in [UVec3::new(23, 0, 0), UVec3::new(24, 0, 0), UVec3::MAX] {
        let error = store.read(0, from, UVec3::new(2, 1, 1), &mut values).unwrap_err().to_string();
        assert!(error.contains("a box within the [24, 20, 18] voxels of level 0"), "{error}");
    }
    assert!(store.contains(0, UVec3::ONE).is_err());
    // Colours of voxels, and channels after the first.
    let folder = Folder::new();
    for (name, kinds, sizes) in
        [("rgb", "RGB-color domain domain domain", "3 5 4 3"), ("planes", "domain domain domain list", "5 4 3 3")]
    {
        let of = |space: &str| {
            let directions =
                if name == "rgb" { "none (1,0,0) (0,1,0) (0,0,2)" } else { "(1,0,0) (0,1,0) (0,0,2) none" };
            let header = format!(
                "NRRD0004\ntype: uint8\ndimension: 4\nsizes: {sizes}\nkinds: {kinds}\nspace: {space}\n\
                 space directions: {directions}\nencoding: raw\n\n"
            );
            folder.write(&format!("{name}-{space}.nrrd"), &[header.as_bytes(), &(0..180).collect::<Vec<u8>>()])
        };
        let [ras, las] = ["RAS", "LAS"].map(of);
        let options = ReadOptions::default().with_channel(if name == "rgb" { 0 } else { 2 });
        assert_holds(&open_store(&las, &options).unwrap(), &Volume::open_with(&las, &options).unwrap(), name);
        let [ras, las] = [ras, las].map(|path| Volume::open(&path).unwrap());
        for (one, other) in ras.channels().zip(las.channels()) {
            let turned: Vec<f32> = one.values().to_vec().chunks(5).flat_map(|row| row.iter().rev().copied()).collect();
            assert!(other.values() == turned && other.grid().is_turned(), "{name}");
        }
        let Some(colors) = ras.colors() else { continue };
        let turned: Vec<_> = colors.chunks(5).flat_map(|row| row.iter().rev().copied()).collect();
        assert_eq!(las.colors().unwrap(), turned);
    }
}

/// A volume with the name and encoding of the file that it equals once that is turned.
fn as_turned(ras: Volume, las: &Path) -> Volume {
    let las = Volume::open(las).unwrap();
    assert!(ras.values() == las.values());
    las
}

/// Spaces that are no patient's have handedness, too.
#[test]
fn spaces_without_a_patient() {
    let folder = Folder::new();
    let samples: Vec<u8> = (0..60).collect();
    let nrrd = |space: &str, directions: &str| {
        let header = format!(
            "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 5 4 3\n{space}\nspace directions: {directions}\nencoding: raw\n\n"
        );
        let path = folder.write("a.nrrd", &[header.as_bytes(), &samples]);
        let volume = Volume::open(&path).unwrap();
        assert_holds(&open_store(&path, &ReadOptions::default()).unwrap(), &volume, space);
        assert_eq!((volume.orientation(), in_file_order(&volume).len()), (None, 60));
        volume.grid().is_turned()
    };
    let [right, left] = ["(1,0,0) (0,1,0) (0,0,2)", "(1,0,0) (0,0,2) (0,1,0)"];
    for (space, is_left) in [
        ("space: 3D-right-handed", false),
        ("space: scanner-xyz", false),
        ("space dimension: 3", false),
        ("space: 3D-left-handed", true),
        ("space: 3DLH", true),
    ] {
        assert_eq!([nrrd(space, right), nrrd(space, left)], [is_left, !is_left], "{space}");
    }
    let text = fs::read_to_string(fixture("text.vti")).unwrap();
    let (before, rest) = text.split_once("Direction=\"").unwrap();
    let (_, after) = rest.split_once('"').unwrap();
    let with =
        |direction: &str| folder.open("a.vti", format!("{before}Direction=\"{direction}\"{after}").as_bytes()).unwrap();
    assert!(!with("0 1 0 -1 0 0 0 0 1").grid().is_turned());
    let turned = with("-1 0 0 0 1 0 0 0 1");
    assert!(turned.grid().is_turned() && in_file_order(&turned) == values());
}

/// A store of 7 × 4 × 3 voxels in chunks of 3 × 4 × 3, of which the middle one is missing. Axes state an orientation.
fn store(folder: &Folder, x: &Value, y: &Value, z: &Value) -> PathBuf {
    let path = folder.0.path().join(format!("{x}.zarr").replace(['"', '/', '{', '}', ':'], ""));
    let write = |name: &str, bytes: &[u8]| {
        let path = path.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    };
    let axis = |name: &str, to: &Value| json!({"name": name, "type": "space", "orientation": {"type": "anatomical", "value": to}});
    let level = |path: &str, scale: [f64; 3], first: [f64; 3]| json!({"path": path, "coordinateTransformations": [{"type": "scale", "scale": scale}, {"type": "translation", "translation": first}]});
    let group = json!({"zarr_format": 3, "node_type": "group", "attributes": {"ome": {"version": "0.6", "multiscales": [{
        "axes": [axis("z", z), axis("y", y), axis("x", x)],
        "datasets": [level("0", [2.0, 1.0, 1.0], [5.0, 0.0, 10.0]), level("1", [2.0, 1.0, 2.0], [5.0, 0.0, 10.5])],
    }]}}});
    let array = |width: u32, chunk: u32| {
        json!({
            "zarr_format": 3, "node_type": "array", "shape": [3, 4, width], "data_type": "uint8", "fill_value": 9,
            "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": [3, 4, chunk]}},
            "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}}, "codecs": [{"name": "bytes"}],
        })
    };
    write("zarr.json", group.to_string().as_bytes());
    write("0/zarr.json", array(7, 3).to_string().as_bytes());
    write("1/zarr.json", array(3, 3).to_string().as_bytes());
    let chunk = |first: u8| (0..36).map(|at| first + at % 3).collect::<Vec<u8>>();
    write("0/c/0/0/0", &chunk(10));
    write("0/c/0/0/2", &chunk(16));
    write("1/c/0/0/0", &chunk(30));
    path
}

#[test]
fn orientations_of_ome_zarr() {
    let folder = Folder::new();
    let [x, y, z] = ["left-to-right", "posterior-to-anterior", "inferior-to-superior"].map(Value::from);
    let left = Value::from("right-to-left");
    let ras = Volume::open(&store(&folder, &x, &y, &z)).unwrap();
    let row = [10.0, 11.0, 12.0, 9.0, 9.0, 9.0, 16.0];
    assert_eq!((&ras.values().to_vec()[..7], ras.grid().is_turned()), (&row[..], false));
    assert_eq!(ras.orientation().unwrap(), &Orientation { axes: DMat3::IDENTITY, origin: DVec3::new(10.0, 0.0, 5.0) });
    let path = store(&folder, &left, &y, &z);
    let las = Volume::open(&path).unwrap();
    assert_eq!(in_file_order(&las), ras.values().to_vec());
    assert_eq!(las.orientation().unwrap().origin, DVec3::new(-16.0, 0.0, 5.0));
    let store_of = || open_store(&path, &ReadOptions::default()).unwrap();
    let opened = store_of();
    assert_eq!(opened.facts().orientation, las.orientation().copied());
    // The file's chunks begin at the other end: of the turned ones, the first is of the last and the missing one.
    let held = [0, 1, 2].map(|x| opened.contains(0, UVec3::new(x, 0, 0)).unwrap());
    assert_eq!(held, [true, true, true]);
    let index = StoreIndex::new(&*opened, "store", &|| {}).unwrap();
    let indexed = IndexedStore::new(store_of(), index, "index").unwrap();
    let range = |x| indexed.chunk_range(0, UVec3::new(x, 0, 0)).unwrap();
    assert_eq!([range(0), range(1), range(2)], [[9.0, 16.0], [9.0, 12.0], [10.0, 10.0]]);
    // Both levels, and all of them by boxes.
    for level in 0..2 {
        let volume = Volume::open_with(&path, &ReadOptions::default().with_level(level)).unwrap();
        let Grid { dims, .. } = *volume.grid();
        let mut found = vec![0.0; dims.element_product() as usize];
        indexed.read(level as usize, UVec3::ZERO, dims, &mut found).unwrap();
        assert!(volume.values() == found && volume.grid().is_turned());
        assert_eq!(*volume.grid(), indexed.levels()[level as usize].grid);
    }
    let stores: Arc<dyn Store> = Arc::new(indexed);
    let sampled = StreamedVolume::new("store", stores, 0, 1 << 30).unwrap().sample;
    assert!(sampled.values() == las.values());
}

/// Orientations that are not all known state no patient, and contradictory ones are refused.
#[test]
fn strange_orientations_of_ome_zarr() {
    let folder = Folder::new();
    let [y, z] = ["posterior-to-anterior", "inferior-to-superior"].map(Value::from);
    for strange in [json!(null), json!("dorsal-to-palmar"), json!(7), json!({}), json!("")] {
        let volume = Volume::open(&store(&folder, &strange, &y, &z)).unwrap();
        assert_eq!((volume.orientation(), volume.grid().is_turned()), (None, false), "{strange}");
    }
    let twice = Volume::open(&store(&folder, &json!("anterior-to-posterior"), &y, &z));
    assert_refused(
        twice,
        "zarr.json",
        "attributes.ome.multiscales[0].axes",
        "",
        "orientations along three different lines",
    );
}
