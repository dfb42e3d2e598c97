//! Samples that are no `f32`: whole numbers beyond 24 bits are rounded, with a warning that names the largest error.

use sheetsplat_volume::{Labels, RawLayout, ReadOptions, SampleType, open_store};

use crate::*;

const TYPES: [(&str, SampleType); 4] =
    [("u4", SampleType::U32), ("i8", SampleType::I64), ("u8", SampleType::U64), ("f8", SampleType::F64)];

fn bytes(kind: SampleType, numbers: [f64; 2]) -> Vec<u8> {
    let bytes = |number: f64| match kind {
        SampleType::U32 => (number as u32).to_le_bytes().to_vec(),
        SampleType::I64 => (number as i64).to_le_bytes().to_vec(),
        SampleType::U64 => (number as u64).to_le_bytes().to_vec(),
        _ => number.to_le_bytes().to_vec(),
    };
    numbers.map(bytes).concat()
}

fn npy(descr: &str, data: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '<{descr}', 'fortran_order': False, 'shape': (1, 1, 2), }}\n");
    [b"\x93NUMPY\x01\0", &(header.len() as u16).to_le_bytes()[..], header.as_bytes(), data].concat()
}

fn nrrd(kind: SampleType, data: &[u8]) -> Vec<u8> {
    let name = if kind == SampleType::F64 { "double".to_owned() } else { kind.to_string() };
    let header = format!("NRRD0004\ntype: {name}\ndimension: 3\nsizes: 2 1 1\nendian: little\nencoding: raw\n\n");
    [header.as_bytes(), data].concat()
}

/// The errors are those of `numpy.float32(x).astype(object) - x`: ids of the Allen Institute's atlas, and others.
#[test]
fn the_largest_error_is_named_once() {
    let folder = Folder::new();
    for (descr, kind) in TYPES {
        for (largest, error) in [(614_454_277.0, "by up to 5"), (16_777_217.0, "by up to 1"), (16_777_216.0, "")] {
            let data = bytes(kind, [7.0, largest]);
            let files = [("a.npy", npy(descr, &data)), ("a.nrrd", nrrd(kind, &data))];
            for (name, file) in files {
                let (volume, warnings) = warned(|| folder.open(name, &file).unwrap());
                assert_eq!(volume.values(), [7.0, largest as f32], "{name} {kind}");
                match error {
                    "" => assert!(warnings.is_empty(), "{warnings:?}"),
                    error => {
                        assert_warned(&warnings, error);
                        assert_warned(&warnings, &format!("{name}: {kind} samples beyond 16777216"));
                    }
                }
            }
            let layout = RawLayout { dims: UVec3::new(2, 1, 1), sample_type: kind, big_endian: false, offset: 0 };
            let raw = folder.write("a.raw", &[&data]);
            let (_, warnings) = warned(|| Volume::open_raw(&raw, &layout).unwrap());
            assert_eq!(warnings.len(), usize::from(!error.is_empty()), "{warnings:?}");
        }
    }
    // 2^60 + 1 is no `f64` either.
    let id = (1_u64 << 60) + 1;
    let (_, warnings) = warned(|| folder.open("a.npy", &npy("u8", &[id; 2].map(u64::to_le_bytes).concat())).unwrap());
    assert_warned(&warnings, "uint64 samples beyond 16777216 are rounded to float32, by up to 1");
}

/// Fractions are rounded as everywhere, unless that shows among the values.
#[test]
fn fractions_that_are_noticeably_rounded() {
    let folder = Folder::new();
    let cases = [
        ([0.1, 0.7], None),
        ([0.1, 0.1], None),
        ([1e20, 3e20], None),
        ([f64::NAN, 0.3], None),
        ([f64::INFINITY, 0.3], None),
        ([5_000_000.1, 5_000_000.4], Some("rounded to float32, by up to 1.0e-1")),
        ([1.0, 1e39], Some("float64 samples beyond 3.4028235e38 become holes")),
    ];
    for (numbers, words) in cases {
        let (volume, warnings) = warned(|| folder.open("a.npy", &npy("f8", &bytes(SampleType::F64, numbers))));
        volume.unwrap();
        match words {
            None => assert!(warnings.is_empty(), "{numbers:?}: {warnings:?}"),
            Some(words) => assert_warned(&warnings, words),
        }
    }
}

/// What becomes a label is never rounded, and a file that is read by boxes warns once.
#[test]
fn labels_are_exact_and_boxes_warn_once() {
    let folder = Folder::new();
    let path = folder.write("a.nrrd", &[&nrrd(SampleType::U32, &bytes(SampleType::U32, [3.0, 614_454_277.0]))]);
    let (labels, warnings) = warned(|| Labels::open(&path));
    assert!(labels.is_err() && warnings.is_empty(), "{warnings:?}");
    let store = open_store(&path, &ReadOptions::default()).unwrap();
    let (_, warnings) = warned(|| {
        for _ in 0..2 {
            store.read(0, UVec3::ZERO, UVec3::new(2, 1, 1), &mut [0.0; 2]).unwrap();
        }
    });
    assert_warned(&warnings, "by up to 5");
}
