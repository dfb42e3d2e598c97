//! Plain Zarr arrays that name their axes, which `tests/fixtures/make_zarr.py` writes by zarr-python.

use std::fs;

use serde_json::{Value, json};
use sheetsplat_volume::{ReadOptions, Volume, VolumeError, open_store};

use super::{DIMS, assert_warned, fixture, open, values, warned};

#[test]
fn arrays_name_their_axes() {
    for version in [2, 3] {
        let (volume, warnings) = warned(|| open(&format!("zarr/named.zip:x-y-z-{version}")));
        assert!(warnings.is_empty() && volume.channels().count() == 1, "{warnings:?}");
        let times = format!("zarr/named.zip:time-depth-row-column-{version}");
        let (volume, warnings) = warned(|| open(&times));
        assert_warned(&warnings, "2 times: the first is read");
        assert_eq!((volume.channels().count(), volume.encoding().unwrap().times), (1, 2));
        let second = Volume::open_with(&fixture(&times), &ReadOptions::default().with_time(1)).unwrap();
        assert_eq!(second.values(), values().iter().map(|value| value + 10000.0).collect::<Vec<_>>());
        let channels = open(&format!("zarr/named.zip:y-c-x-z-{version}"));
        assert_eq!(channels.channels().count(), 2);
        let of_second: Vec<f32> = values().iter().map(|value| value + 1000.0).collect();
        assert_eq!(channels.channel(1).unwrap().values(), of_second);
        let store = open_store(&fixture(&format!("zarr/named.zip:x-y-z-{version}")), &ReadOptions::default()).unwrap();
        assert_eq!(store.levels()[0].grid.dims, DIMS);
    }
}

/// An array of one chunk with some metadata, uncompressed.
fn with(version: u32, names: &Value) -> Result<Volume, VolumeError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("named.zarr");
    let bytes: Vec<u8> = values().iter().flat_map(|&value| (value as u16).to_le_bytes()).collect();
    let (metadata, chunk) = match version {
        2 => {
            let array = json!({
                "zarr_format": 2, "shape": [3, 4, 5], "chunks": [3, 4, 5], "dtype": "<u2", "fill_value": 0, "order": "C",
                "compressor": null, "filters": null,
            });
            (vec![(".zarray", array), (".zattrs", json!({"_ARRAY_DIMENSIONS": names}))], "0.0.0")
        }
        _ => {
            let array = json!({
                "zarr_format": 3, "node_type": "array", "shape": [3, 4, 5], "data_type": "uint16", "fill_value": 0,
                "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": [3, 4, 5]}},
                "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}},
                "codecs": [{"name": "bytes", "configuration": {"endian": "little"}}], "dimension_names": names,
            });
            (vec![("zarr.json", array)], "c/0/0/0")
        }
    };
    fs::create_dir_all(path.join(chunk).parent().unwrap()).unwrap();
    for (name, value) in metadata {
        fs::write(path.join(name), value.to_string()).unwrap();
    }
    fs::write(path.join(chunk), bytes).unwrap();
    Volume::open(&path)
}

#[test]
fn names_that_say_nothing() {
    for version in [2, 3] {
        for names in [json!(["lat", "y", "x"]), json!(["z", null, "x"]), json!(["z", "z", "x"]), json!(["t", "z", "x"])]
        {
            let (volume, warnings) = warned(|| with(version, &names));
            assert_eq!(volume.unwrap().values(), values(), "{names}");
            assert_warned(&warnings, ": taken to be z, y, x");
        }
        for names in [json!(null), json!(["dim_0", "dim_1", "dim_2"]), json!([null, null, null])] {
            let (volume, warnings) = warned(|| with(version, &names));
            assert!(warnings.is_empty() && volume.unwrap().values() == values(), "{names}: {warnings:?}");
        }
        let key = if version == 2 { ".zattrs: _ARRAY_DIMENSIONS: " } else { "zarr.json: dimension_names: " };
        for names in [json!(["y", "x"]), json!("zyx"), json!([1, 2, 3]), json!({}), json!([])] {
            let error = with(version, &names).unwrap_err().to_string();
            assert!(error.contains(key) && error.contains("a list of 3 names, one for each axis"), "{error}");
        }
    }
}
