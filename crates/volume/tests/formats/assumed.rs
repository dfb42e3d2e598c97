//! Headers that say that values are labels, and the facts that are assumed where files state none.

use std::fs;
use std::path::Path;

use serde_json::{Value, json};
use sheetsplat_volume::{Labels, RawLayout, ReadOptions, SampleType, Volume, open_store, sample};

use super::{DIMS, Folder, fixture, patched};

/// `NIFTI_INTENT_LABEL`, 1002, in both versions and orders of bytes, whole and read by boxes.
#[test]
fn nifti_labels_by_their_intent() {
    let folder = Folder::new();
    let code = 1002_i16;
    for (name, at, bytes) in [
        ("sform.nii", 68, code.to_le_bytes().to_vec()),
        ("nifti2.nii", 504, i32::from(code).to_le_bytes().to_vec()),
        ("nifti2-big.nii", 504, i32::from(code).to_be_bytes().to_vec()),
    ] {
        let plain = Volume::open(&fixture(name)).unwrap();
        assert!(!plain.is_known_label_map(), "{name}");
        let path = folder.write("labels.nii", &[&patched(name, at, &bytes)]);
        let labels = Volume::open(&path).unwrap();
        assert!(labels.is_known_label_map() && labels.label_names().is_empty(), "{name}");
        assert_eq!(labels.values(), plain.values(), "{name}");
        let store = open_store(&path, &ReadOptions::default()).unwrap();
        assert!(store.facts().are_labels && sample("a", &*store, 1 << 20).unwrap().is_known_label_map(), "{name}");
    }
    // 1001 is an estimate, and Analyze has another field there.
    let path = folder.write("estimate.nii", &[&patched("sform.nii", 68, &1001_i16.to_le_bytes())]);
    assert!(!Volume::open(&path).unwrap().is_known_label_map());
}

/// Copies a folder.
fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let to = to.join(path.file_name().unwrap());
        if path.is_dir() { copy(&path, &to) } else { _ = fs::copy(&path, &to).unwrap() }
    }
}

/// An image of OME-Zarr with `image-label`, be it empty, or in a group `labels` that lists it.
#[test]
fn zarr_labels_by_their_metadata() {
    let folder = Folder::new();
    let store = folder.0.path().join("a.zarr");
    copy(&fixture("zarr/image-0.5.zarr"), &store);
    let cells = store.join("labels/cells");
    let metadata: Value = serde_json::from_slice(&fs::read(cells.join("zarr.json")).unwrap()).unwrap();
    let is_known = |image_label: Option<Value>, list: Value, path: &Path| {
        let mut of_image = metadata.clone();
        let ome = of_image["attributes"]["ome"].as_object_mut().unwrap();
        ome.remove("image-label");
        ome.extend(image_label.map(|value| ("image-label".to_owned(), value)));
        fs::write(path.join("zarr.json"), of_image.to_string()).unwrap();
        let group = json!({"attributes": {"ome": {"labels": list}}, "zarr_format": 3, "node_type": "group"});
        fs::write(path.parent().unwrap().join("zarr.json"), group.to_string()).unwrap();
        let volume = Volume::open(path).unwrap();
        assert_eq!(open_store(path, &ReadOptions::default()).unwrap().facts().are_labels, volume.is_known_label_map());
        assert!(volume.label_names().is_empty());
        volume.is_known_label_map()
    };
    assert!(is_known(Some(json!({})), json!([]), &cells));
    assert!(is_known(None, json!(["others", "cells"]), &cells));
    assert!(!is_known(None, json!(["others"]), &cells));
    // A list in a group of another name is no list of labels.
    let elsewhere = store.join("images/cells");
    copy(&cells, &elsewhere);
    assert!(!is_known(None, json!(["cells"]), &elsewhere));
    assert!(!Volume::open(&store).unwrap().is_known_label_map());
    assert!(!Labels::open(&cells).unwrap().values.is_empty());
}

#[test]
fn assumptions_are_those_facts_that_files_leave_open() {
    let of = |name: &str| Volume::open(&fixture(name)).unwrap().assumptions();
    let array = "axes: the array's last ones are z, y and x";
    let (spacing, unit) = ("spacing: 1 along each axis", "unit: none");
    let orientation = "orientation: that of no patient, with right-handed axes";
    assert_eq!(of("c.npy"), [array, spacing, unit, orientation]);
    assert_eq!(of("zarr/v3.zip:uint16"), [array, spacing, unit, orientation]);
    assert_eq!(of("itk.nii.gz"), [""; 0]);
    assert_eq!(of("sform.nii"), [unit]);
    assert_eq!(of("imagej.tif"), [orientation]);
    assert_eq!(of("plain.tif"), ["axes: pages are slices along z", orientation]);
    assert_eq!(of("slices")[0], "axes: files are slices along z, in the order of their names");
    // Arrays that name their axes have only these.
    let named = of("zarr/image-0.4.zarr");
    assert!(!named.iter().any(|fact| fact.starts_with("axes") || fact.starts_with("spacing")), "{named:?}");

    let layout = RawLayout { dims: DIMS, sample_type: SampleType::U8, big_endian: false, offset: 0 };
    let folder = Folder::new();
    let path = folder.write("a.bin", &[&[7; 60]]);
    let raw = Volume::open_raw(&path, &layout).unwrap();
    assert_eq!(raw.assumptions(), ["axes: x is the fastest, then y, then z", spacing, unit, orientation]);
    // Stated later, they are assumed no more.
    let stated = raw.with_spacing("a", [1.0, 2.0, 3.0].into()).unwrap().with_unit("mm");
    assert_eq!(stated.assumptions(), ["axes: x is the fastest, then y, then z", orientation]);
    assert!(Volume::new("made", DIMS, [1.0; 3].into(), vec![1.0; 60]).unwrap().assumptions().is_empty());
}
