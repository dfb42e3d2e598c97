//! MGH and MGZ, as nibabel writes them.

use std::io::Write;

use flate2::{Compression, write::GzEncoder};
use sheetsplat_volume::{Encoding, Labels, SampleType};

use crate::*;

const FILES: [(&str, SampleType); 4] = [
    ("byte.mgh", SampleType::U8),
    ("plain.mgh", SampleType::I16),
    ("int.mgz", SampleType::I32),
    ("float.mgz", SampleType::F32),
];

#[test]
fn every_type_of_nibabel() {
    for (name, sample_type) in FILES {
        let volume = open(name);
        assert_lies(&volume, rotation(), ORIGIN);
        assert_eq!(volume.unit(), Some("mm"));
        assert_eq!(volume.encoding(), Some(Encoding { format: "MGH", sample_type, channels: 1, times: 1 }), "{name}");
        assert!(Labels::open(&fixture(name)).unwrap().values.iter().map(|&label| f32::from(label)).eq(values()));
    }
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

/// Scan parameters and a history may follow the samples.
#[test]
fn data_after_the_samples_is_ignored() {
    let folder = Folder::new();
    let bytes = fs::read(fixture("plain.mgh")).unwrap();
    let bare = &bytes[..284 + 120];
    let long = [&bytes[..], &[7; 1000]].concat();
    for whole in [bare, &long] {
        assert_eq!(folder.open("a.mgh", whole).unwrap().values(), values());
        for name in ["a.mgz", "a.MGZ", "a.mgh.gz", "a.mgh"] {
            assert_eq!(folder.open(name, &gzip(whole)).unwrap().values(), values(), "{name}");
        }
    }
    // A damaged checksum still counts as damage.
    let mut damaged = gzip(&long);
    let at = damaged.len() - 8;
    damaged[at] ^= 1;
    assert_refused(folder.open("a.mgz", &damaged), "a.mgz", "data", "", "whole and undamaged gzip members");
}

/// Without `goodRASFlag` FreeSurfer assumes coronal slices.
#[test]
fn without_ras_flag_slices_are_coronal() {
    let volume = Folder::new().open("a.mgh", &patched("plain.mgh", 28, &[0, 0])).unwrap();
    assert_eq!((in_file_order(&volume), volume.spacing()), (values(), DVec3::ONE));
    let orientation = volume.file_orientation().unwrap();
    assert_eq!(orientation.axes, DMat3::from_cols(DVec3::NEG_X, DVec3::NEG_Z, DVec3::Y));
    // The centre, 0 in right-anterior-superior, is at voxel (2.5, 2, 1.5).
    assert_eq!(orientation.origin, DVec3::new(2.5, -1.5, 2.0));
}

#[test]
fn wrong_fields() {
    let folder = Folder::new();
    let refused = |at: usize, bytes: &[u8], field: &str, found: &str, allowed: &str| {
        assert_refused(folder.open("a.mgh", &patched("plain.mgh", at, bytes)), "a.mgh", field, found, allowed);
    };
    let nan = f32::NAN.to_be_bytes();
    refused(0, &[0, 0, 0, 2], "version", "2", "1");
    refused(4, &[0; 4], "width, height, depth", "[0, 4, 3]", "three positive integers");
    refused(8, &[0xff; 4], "width, height, depth", "[5, -1, 3]", "three positive integers");
    refused(4, &[0x7f, 0xff, 0xff, 0xff].repeat(3), "width, height, depth", "2147483647", "at most 4294967295");
    refused(16, &[0; 4], "nframes", "0", "a positive number of frames");
    refused(16, &[0xff; 4], "nframes", "-1", "a positive number of frames");
    refused(16, &[0, 0, 1, 0], "data", "bytes", "30720 bytes (256 volumes of 60 samples)");
    refused(20, &[0, 0, 0, 2], "type", "2", "0 (uint8), 1 (int32), 3 (float32), 4 (int16)");
    refused(20, &[0, 0, 0, 3], "data", "", "240 bytes (60 samples of 4)");
    refused(30, &nan, "spacing", "NaN", "finite");
    refused(30, &[0; 4], "spacing", "[0, 2, 3]", "three positive numbers");
    refused(42, &nan, "x_ras, y_ras, z_ras", "NaN", "finite");
    refused(42, &[0; 12], "x_ras, y_ras, z_ras", "lengths [0.0", "positive finite length");
    refused(78, &nan, "c_ras", "NaN", "finite");
}

#[test]
fn damage() {
    let folder = Folder::new();
    for (name, _) in FILES {
        let whole = fs::read(fixture(name)).unwrap();
        let values = values();
        for length in 0..whole.len() {
            // What follows the samples may be missing, except gzip's own end.
            if let Ok(volume) = folder.open(name, &whole[..length]) {
                assert!(name.ends_with("mgh") && volume.values() == values, "{name}: {length} bytes");
            }
        }
    }
}
