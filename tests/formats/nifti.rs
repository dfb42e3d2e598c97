//! NIfTI, as nibabel and ITK write it.

use std::io::Write;
use std::time::{Duration, Instant};

use flate2::{Compression, write::GzEncoder};
use sheetsplat::volume::{Encoding, Labels, SampleType};

use crate::*;

/// One of the data types, and how its number -2, 3.5 or 200 is written.
type Kind = (i16, i16, Vec<u8>, f32);

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

#[test]
fn sform_slope_and_intercept() {
    let volume = Volume::open(&fixture("sform.nii")).unwrap();
    let expected: Vec<f32> = values().iter().map(|value| 0.5 * value - 3.0).collect();
    assert_eq!((volume.dims(), volume.values()), (DIMS, expected.as_slice()));
    assert_lies(&volume, rotation(), ORIGIN);
    assert!(!volume.orientation().unwrap().is_mirrored());
}

#[test]
fn qform_mirrored_big_endian_and_gzipped() {
    let volume = open("qform-big.nii.gz");
    assert_lies(&volume, rotation() * DMat3::from_diagonal(DVec3::new(1.0, 1.0, -1.0)), ORIGIN);
    assert!(volume.orientation().unwrap().is_mirrored());
}

#[test]
fn version_2() {
    let volume = open("nifti2.nii");
    assert_eq!((volume.spacing(), volume.orientation()), (SPACING, None));
    assert_lies(&open("nifti2-big.nii"), rotation(), ORIGIN);
}

#[test]
fn pairs_open_by_either_name() {
    for name in ["pair.hdr", "pair.img"] {
        assert_lies(&open(name), rotation(), ORIGIN);
    }
    let folder = Folder::new();
    let [header, data] = ["pair.hdr", "pair.img"].map(|name| fs::read(fixture(name)).unwrap());
    assert!(matches!(folder.open("a.hdr", &header), Err(VolumeError::Io { path, .. }) if path.ends_with("a.img")));
    fs::write(folder.0.path().join("a.img.gz"), gzip(&data)).unwrap();
    assert_eq!(folder.open("a.hdr.gz", &gzip(&header)).unwrap().values(), values());
    fs::write(folder.0.path().join("a.img"), &data[1..]).unwrap();
    assert_refused(folder.open("a.hdr", &header), "a.img", "data", "119 bytes", "120 bytes (60 samples of 2)");
    assert_refused(folder.open("a.nii", &header), "a.nii", "magic", "pair", ".hdr");
}

/// ITK's coordinates are LPS; in NIfTI it writes RAS.
#[test]
fn of_itk() {
    let lps = DVec3::new(-1.0, -1.0, 1.0);
    let volume = open("itk.nii.gz");
    assert_lies(&volume, DMat3::from_diagonal(lps) * rotation(), lps * ORIGIN);
    assert_eq!(volume.unit(), Some("mm"));
    assert_eq!(volume.encoding(), Some(Encoding { format: "NIfTI", sample_type: SampleType::F64 }));
}

#[test]
fn units() {
    let folder = Folder::new();
    // Bits 3 to 5 are the unit of time.
    for (code, unit) in [(0, None), (9, Some("m")), (2, Some("mm")), (11, Some("µm")), (8, None), (4, None)] {
        assert_eq!(folder.open("a.nii", &patched("sform.nii", 123, &[code])).unwrap().unit(), unit, "{code}");
        assert_eq!(folder.open("a.nii", &patched("nifti2.nii", 500, &[code])).unwrap().unit(), unit, "{code}");
    }
}

#[test]
fn labels() {
    let labels = Labels::open(&fixture("qform-big.nii.gz")).unwrap();
    assert!(labels.values.iter().map(|&label| f32::from(label)).eq(values()));
    let error = Labels::open(&fixture("sform.nii")).unwrap_err().to_string();
    assert!(error.contains("data: found -3 at voxel [0, 0, 0], allowed: labels, whole numbers"), "{error}");
}

#[test]
fn every_type_and_both_byte_orders() {
    let folder = Folder::new();
    let kinds: [Kind; 10] = [
        (2, 8, 200_u8.to_le_bytes().into(), 200.0),
        (4, 16, (-2_i16).to_le_bytes().into(), -2.0),
        (8, 32, (-2_i32).to_le_bytes().into(), -2.0),
        (16, 32, 3.5_f32.to_le_bytes().into(), 3.5),
        (64, 64, 3.5_f64.to_le_bytes().into(), 3.5),
        (256, 8, (-2_i8).to_le_bytes().into(), -2.0),
        (512, 16, 200_u16.to_le_bytes().into(), 200.0),
        (768, 32, 200_u32.to_le_bytes().into(), 200.0),
        (1024, 64, (-2_i64).to_le_bytes().into(), -2.0),
        (1280, 64, 200_u64.to_le_bytes().into(), 200.0),
    ];
    for (name, header, big) in [("nifti2.nii", 540, false), ("nifti2-big.nii", 540, true)] {
        for (code, bits, sample, value) in &kinds {
            let mut file = fs::read(fixture(name)).unwrap()[..header + 4].to_vec();
            let order = |mut bytes: Vec<u8>| {
                if big {
                    bytes.reverse();
                }
                bytes
            };
            file.splice(12..14, order(code.to_le_bytes().into()));
            file.splice(14..16, order(bits.to_le_bytes().into()));
            file.extend(order(sample.clone()).repeat(60));
            assert_eq!(folder.open("a.nii", &file).unwrap().values(), [*value; 60], "{code} in {name}");
        }
    }
}

#[test]
fn wrong_fields() {
    let folder = Folder::new();
    let refused = |at: usize, bytes: &[u8], field: &str, found: &str, allowed: &str| {
        assert_refused(folder.open("a.nii", &patched("sform.nii", at, bytes)), "a.nii", field, found, allowed);
    };
    let nan = f32::NAN.to_le_bytes();
    refused(0, &[7, 0, 0, 0], "sizeof_hdr", "7", "348 or 540, in either byte order");
    refused(344, b"abc\0", "magic", "\"abc\\x00\"", "n+1 or ni1");
    refused(40, &[2, 0], "dim", "[2, 5, 4, 3, ", "3 to 7");
    refused(40, &[8, 0], "dim", "[8, ", "3 to 7");
    refused(40, &[4, 0, 5, 0, 4, 0, 3, 0, 2, 0], "dim", "[4, 5, 4, 3, 2, ", "any further sizes 1");
    for size in [0_i16, -5] {
        refused(42, &size.to_le_bytes(), "dim", &size.to_string(), "three positive integers");
    }
    refused(70, &[128, 0], "datatype", "128", "4 (int16)");
    refused(72, &[8, 0], "bitpix", "8", "16, as datatype 4");
    for (offset, found) in [(348.0_f32, "348"), (353.5, "353.5"), (-1.0, "-1"), (f32::NAN, "NaN"), (1e30, "1000000")] {
        refused(108, &offset.to_le_bytes(), "vox_offset", found, "a whole number from 352");
    }
    refused(108, &1e18_f32.to_le_bytes(), "data", "0 bytes", "120 bytes");
    refused(112, &nan, "scl_slope", "NaN", "finite");
    refused(116, &nan, "scl_inter", "NaN", "finite");
    refused(280, &nan, "srow_x, srow_y, srow_z", "NaN", "orthogonal");
    refused(280, &[0; 48], "srow_x, srow_y, srow_z", "lengths [0.0", "orthogonal");
    refused(280, &9_f32.to_le_bytes(), "srow_x, srow_y, srow_z", "not orthogonal", "cosines of at most 0.0001");
    refused(292, &nan, "srow_x, srow_y, srow_z", "NaN", "finite");

    // By the qform, or neither.
    let by_qform = |qform: u8, at: usize, bytes: &[u8]| {
        let mut file = patched("sform.nii", 252, &[qform, 0, 0, 0]);
        file[at..at + bytes.len()].copy_from_slice(bytes);
        folder.open("a.nii", &file)
    };
    assert_eq!(by_qform(0, 252, &[]).unwrap().orientation(), None);
    for spacing in [0.0_f32, -1.0, f32::INFINITY] {
        assert_refused(by_qform(0, 80, &spacing.to_le_bytes()), "a.nii", "pixdim", "", "three positive finite numbers");
    }
    for wrong in [nan, 1.1_f32.to_le_bytes()] {
        let field = "quatern_b, quatern_c, quatern_d";
        assert_refused(by_qform(1, 256, &wrong), "a.nii", field, "", "add up to at most 1");
    }
    assert_refused(by_qform(1, 268, &nan), "a.nii", "qoffset_x, qoffset_y, qoffset_z", "NaN", "finite");
}

#[test]
fn slopes_of_0_stand_for_none() {
    let volume = Folder::new().open("a.nii", &patched("sform.nii", 112, &[0; 4])).unwrap();
    assert_eq!(volume.values(), values());
}

#[test]
fn damage() {
    for name in ["sform.nii", "nifti2-big.nii", "qform-big.nii.gz"] {
        let whole = fs::read(fixture(name)).unwrap();
        assert_exact(name, &whole);
    }
}

#[test]
fn promises_of_more_than_the_file_holds_cost_nothing() {
    let (folder, start) = (Folder::new(), Instant::now());
    let file = patched("sform.nii", 42, &[0xff, 0x05, 0xff, 0x05, 0xff, 0x05]);
    assert_refused(folder.open("a.nii", &file), "a.nii", "data", "120 bytes", "samples of 2");
    assert_refused(folder.open("a.nii.gz", &gzip(&file)), "a.nii.gz", "data", "at most", "samples of 2");
    let file = patched("sform.nii", 42, &[0xff, 0x7f, 0xff, 0x7f, 0xff, 0x7f]);
    assert_refused(folder.open("a.nii", &file), "a.nii", "dim", "32767", "at most 4294967295 voxels");
    assert!(start.elapsed() < Duration::from_secs(5));
}

/// A scan in its own file and in the NRRD file that was made of it, without the slope.
#[test]
fn measured() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data");
    if !folder.is_dir() {
        println!("skipped: no {}", folder.display());
        return;
    }
    let nifti = Volume::open(&folder.join("seg3d-head-MR.nii.gz")).unwrap();
    let nrrd = Volume::open(&folder.join("mr-head.nrrd")).unwrap();
    assert_eq!(nifti.dims(), nrrd.dims());
    assert_near(nifti.spacing(), nrrd.spacing());
    let slope = f64::from(2.007_843_f32);
    let largest = nifti.values().iter().zip(nrrd.values()).map(|(&a, &b)| (f64::from(a) - slope * f64::from(b)).abs());
    assert!(largest.fold(0.0, f64::max) < 1e-3);
}
