//! The fuzz targets: a function for every kind of file, which must not panic. Included by the libFuzzer package and by `tests/hostile`, which needs no
//! libFuzzer.

use std::fs;
use std::path::Path;

use sheetsplat_volume::{RawLayout, SampleType, Volume, VolumeError};

use crate::input::{FOLDER, Target, file};

/// The targets by name.
pub(crate) const TARGETS: [(&str, Target); 12] = [
    ("nrrd", |bytes| volume("volume.nrrd", bytes, Volume::open)),
    ("nifti", |bytes| volume("volume.nii", bytes, Volume::open)),
    ("metaimage", |bytes| volume("volume.mha", bytes, Volume::open)),
    ("mgh", |bytes| volume("volume.mgh", bytes, Volume::open)),
    ("npz", |bytes| volume("volume.npz", bytes, Volume::open)),
    ("npy", |bytes| volume("volume.npy", bytes, Volume::open)),
    ("raw", raw),
    ("tiff", |bytes| volume("volume.tif", bytes, Volume::open)),
    ("dicom", |bytes| volume("volume.dcm", bytes, Volume::open)),
    ("vti", |bytes| volume("volume.vti", bytes, Volume::open)),
    ("vtk", |bytes| volume("volume.vtk", bytes, Volume::open)),
    ("zarr", zarr),
];

/// Opens bytes as a file with this name, which gives a whole volume or an error.
fn volume(name: &str, bytes: &[u8], open: impl Fn(&Path) -> Result<Volume, VolumeError>) {
    let opened = open(&file(name, bytes));
    if let Err(error) = &opened {
        // Readers make errors of their decoders' panics.
        assert!(!error.to_string().contains("a decoder that gave up"), "{error}");
    }
    if let Ok(volume) = opened {
        assert_eq!(volume.values().len(), volume.dims().element_product() as usize);
        let holes = volume.values().iter().filter(|value| value.is_nan()).count() as u64;
        assert!(holes == volume.holes() && holes < volume.values().len() as u64);
        assert!(!volume.values().iter().any(|value| value.is_infinite()));
    }
}

/// The first bytes give the layout of the others.
fn raw(bytes: &[u8]) {
    let Some(([x, y, z, kind, offset], samples)) = bytes.split_first_chunk() else { return };
    let kinds = [SampleType::I8, SampleType::U16, SampleType::I32, SampleType::F32, SampleType::F64, SampleType::U64];
    let layout = RawLayout {
        dims: [*x, *y, *z].map(u32::from).into(),
        sample_type: kinds[usize::from(*kind) % kinds.len()],
        big_endian: kind & 0x80 != 0,
        offset: (*offset).into(),
    };
    volume("volume.raw", samples, |path| Volume::open_raw(path, &layout));
}

/// The first byte chooses the codecs of a single chunk or shard, which the others are.
fn zarr(bytes: &[u8]) {
    const CODECS: [&str; 6] = [
        r#"{"name": "blosc", "configuration": {}}"#,
        r#"{"name": "gzip", "configuration": {}}"#,
        r#"{"name": "zstd", "configuration": {}}"#,
        r#"{"name": "numcodecs.zlib", "configuration": {}}"#,
        r#"{"name": "numcodecs.bz2", "configuration": {}}"#,
        r#"{"name": "crc32c"}"#,
    ];
    let Some((kind, code)) = bytes.split_first() else { return };
    let (kind, little) = (usize::from(*kind), r#"{"name": "bytes", "configuration": {"endian": "little"}}"#);
    let codecs = match CODECS.get(kind) {
        Some(codec) => format!("[{little}, {codec}]"),
        None => format!(
            r#"[{{"name": "sharding_indexed", "configuration": {{"chunk_shape": [2, 4, 4], "codecs": [{little}, {}],
            "index_codecs": [{little}]}}}}]"#,
            CODECS[kind % CODECS.len()]
        ),
    };
    let metadata = format!(
        r#"{{"zarr_format": 3, "node_type": "array", "shape": [4, 8, 8], "data_type": "uint16", "fill_value": 0,
        "chunk_grid": {{"name": "regular", "configuration": {{"chunk_shape": [4, 8, 8]}}}},
        "chunk_key_encoding": {{"name": "default", "configuration": {{"separator": "."}}}}, "codecs": {codecs}}}"#
    );
    file("zarr.json", metadata.as_bytes());
    file("c.0.0.0", code);
    let volume = Volume::open(&FOLDER);
    for name in ["zarr.json", "c.0.0.0"] {
        _ = fs::remove_file(FOLDER.join(name));
    }
    if let Ok(volume) = volume {
        assert_eq!(volume.values().len(), 256);
    }
}
