//! NIfTI, as nibabel and ITK write it.

use std::io::Write;

use flate2::{Compression, write::GzEncoder};
use sheetsplat_volume::{Encoding, Labels, SampleType};

use crate::*;

/// A data type, and the encoding of its number -2, 3.5 or 200.
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
    assert_eq!((volume.dims(), volume.values()), (DIMS, (&expected).into()));
    assert_lies(&volume, rotation(), ORIGIN);
}

#[test]
fn qform_mirrored_big_endian_and_gzipped() {
    let volume = open("qform-big.nii.gz");
    assert_lies(&volume, rotation() * DMat3::from_diagonal(DVec3::new(1.0, 1.0, -1.0)), ORIGIN);
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

/// ITK's coordinates are LPS, but in NIfTI it writes RAS.
#[test]
fn of_itk() {
    let lps = DVec3::new(-1.0, -1.0, 1.0);
    let volume = open("itk.nii.gz");
    assert_lies(&volume, DMat3::from_diagonal(lps) * rotation(), lps * ORIGIN);
    assert_eq!(volume.unit(), Some("mm"));
    assert_eq!(
        volume.encoding(),
        Some(Encoding { format: "NIfTI", sample_type: SampleType::F64, channels: 1, times: 1 })
    );
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
    refused(40, &[4, 0, 5, 0, 4, 0, 3, 0, 2, 0], "data", "120 bytes", "240 bytes");
    let six = [6, 0, 5, 0, 4, 0, 3, 0, 1, 0, 1, 0, 2, 0];
    refused(40, &six, "dim", "[6, 5, 4, 3, 1, 1, 2, ", "any further sizes 1");
    let components = [5, 0, 5, 0, 4, 0, 3, 0, 1, 0, 65, 0];
    refused(40, &components, "dim", "[5, 5, 4, 3, 1, 65, ", "at most 64 components");
    for size in [0_i16, -5] {
        refused(42, &size.to_le_bytes(), "dim", &size.to_string(), "three positive integers");
    }
    refused(70, &[1, 0], "datatype", "1", "4 (int16)");
    refused(70, &[128, 0], "bitpix", "16", "24, as datatype 128");
    refused(72, &[8, 0], "bitpix", "8", "16, as datatype 4");
    for (offset, found) in [(348.0_f32, "348"), (353.5, "353.5"), (-1.0, "-1"), (f32::NAN, "NaN"), (1e30, "1000000")] {
        refused(108, &offset.to_le_bytes(), "vox_offset", found, "a whole number from 352");
    }
    refused(108, &1e18_f32.to_le_bytes(), "data", "0 bytes", "120 bytes");
    refused(116, &nan, "scl_inter", "NaN", "finite number, as the slope is 0.5");
    refused(280, &nan, "srow_x, srow_y, srow_z", "NaN", "positive finite length");
    refused(280, &[0; 48], "srow_x, srow_y, srow_z", "lengths [0.0", "positive finite length");
    let flat = [[1_f32, 0.0, 2.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.1, 0.0]].as_flattened().to_vec();
    let flat: Vec<u8> = flat.iter().flat_map(|number| number.to_le_bytes()).collect();
    refused(280, &flat, "srow_x, srow_y, srow_z", "axes at 87.14° from a right angle", "each less than 80°");
    refused(
        280,
        &99_f32.to_le_bytes(),
        "srow_x, srow_y, srow_z",
        "an orthogonal grid of [5.0, 70.0",
        "at most 16 times",
    );
    refused(292, &nan, "srow_x, srow_y, srow_z", "NaN", "finite");

    // By the qform, or by neither.
    let by_qform = |qform: u8, at: usize, bytes: &[u8]| {
        let mut file = patched("sform.nii", 252, &[qform, 0, 0, 0]);
        file[at..at + bytes.len()].copy_from_slice(bytes);
        folder.open("a.nii", &file)
    };
    assert_eq!(by_qform(0, 252, &[]).unwrap().orientation(), None);
    for spacing in [f32::NAN, f32::INFINITY] {
        assert_refused(by_qform(0, 80, &spacing.to_le_bytes()), "a.nii", "pixdim", "", "three finite numbers");
    }
    for wrong in [nan, 1.1_f32.to_le_bytes()] {
        let field = "quatern_b, quatern_c, quatern_d";
        assert_refused(by_qform(1, 256, &wrong), "a.nii", field, "", "add up to at most 1");
    }
    assert_refused(by_qform(1, 268, &nan), "a.nii", "qoffset_x, qoffset_y, qoffset_z", "NaN", "finite");
}

/// As in nibabel, the intercept, -3, is then ignored too.
#[test]
fn invalid_slopes_do_not_scale() {
    for slope in [0.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let volume = Folder::new().open("a.nii", &patched("sform.nii", 112, &slope.to_le_bytes())).unwrap();
        assert_eq!(volume.values(), values(), "{slope}");
    }
}

/// As in nibabel and ITK, 0 is read as 1 and signs are ignored. With an sform, `pixdim` is not used.
#[test]
fn invalid_spacings_are_read_with_a_warning() {
    let folder = Folder::new();
    for (written, read) in [(0.0_f32, 1.0), (-0.5, 0.5)] {
        for qform in [0_u8, 1] {
            let mut file = patched("sform.nii", 252, &[qform, 0, 0, 0]);
            file[80..84].copy_from_slice(&written.to_le_bytes());
            let (volume, warnings) = warned(|| folder.open("a.nii", &file).unwrap());
            assert_eq!(volume.spacing(), SPACING.with_x(read));
            assert_warned(&warnings, &format!("a.nii: pixdim: [{written:?}, 2.0, 3.0] is not a spacing"));
            if qform == 1 {
                assert_near(volume.orientation().unwrap().axes.x_axis, rotation().x_axis);
                assert_near(volume.orientation().unwrap().origin, ORIGIN);
            }
        }
        let by_sform = patched("sform.nii", 80, &written.to_le_bytes());
        let (volume, warnings) = warned(|| folder.open("a.nii", &by_sform).unwrap());
        assert_near(volume.spacing(), SPACING);
        assert!(warnings.is_empty(), "{warnings:?}");
    }
}

#[test]
fn magnitudes_of_complex_samples() {
    for (name, sample_type) in [("complex.nii", SampleType::F32), ("complex-double.nii.gz", SampleType::F64)] {
        let (volume, warnings) = warned(|| Volume::open(&fixture(name)).unwrap());
        assert_warned(&warnings, "the samples are complex: the values are their magnitudes");
        assert_eq!((volume.dims(), volume.encoding().unwrap().sample_type), (DIMS, sample_type));
        let largest = volume.values().iter().zip(values()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(largest < 1e-4, "{name}: {largest}");
        assert_lies(&volume, rotation(), ORIGIN);
        assert_exact(name, &fs::read(fixture(name)).unwrap());
    }
    // Slope and intercept apply to the complex numbers: |2 (3 + 4i) - 1| = |5 + 8i|.
    let mut file = fs::read(fixture("complex.nii")).unwrap()[..352].to_vec();
    file[112..116].copy_from_slice(&2_f32.to_le_bytes());
    file[116..120].copy_from_slice(&(-1_f32).to_le_bytes());
    file.extend([3_f32, 4.0].map(f32::to_le_bytes).concat().repeat(60));
    let folder = Folder::new();
    assert_eq!(folder.open("a.nii", &file).unwrap().values(), [89_f32.sqrt(); 60]);
    let error = Labels::open(&fixture("complex.nii")).unwrap_err().to_string();
    assert!(error.contains("allowed: labels, whole numbers"), "{error}");
    assert_refused(
        folder.open("a.nii", &patched("complex.nii", 72, &[32, 0])),
        "a.nii",
        "bitpix",
        "32",
        "64, as datatype 32",
    );
    let wide = patched("complex.nii", 42, &[0xff, 0x7f, 0xff, 0x7f, 3, 0]);
    assert_refused(folder.open("a.nii", &wide), "a.nii", "dim", "[32767, 32767, 3]", "2147483647 complex voxels");
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
    let folder = Folder::new();
    let file = patched("sform.nii", 42, &[0xff, 0x05, 0xff, 0x05, 0xff, 0x05]);
    assert_refused(folder.open("a.nii", &file), "a.nii", "data", "120 bytes", "samples of 2");
    assert_refused(folder.open("a.nii.gz", &gzip(&file)), "a.nii.gz", "data", "at most", "samples of 2");
    let file = patched("sform.nii", 42, &[0xff, 0x7f, 0xff, 0x7f, 0xff, 0x7f]);
    assert_refused(folder.open("a.nii", &file), "a.nii", "dim", "32767", "at most 4294967295 voxels");
}

/// A scan in its own file, and in the NRRD file made from it without the slope.
#[test]
#[ignore = "needs the shared data: SHEETSPLAT_SHARED=FOLDER"]
fn shared_scan() {
    let nifti = Volume::open(&shared("data/seg3d-head-MR.nii.gz")).unwrap();
    let nrrd = Volume::open(&shared("data/mr-head.nrrd")).unwrap();
    assert_eq!(nifti.dims(), nrrd.dims());
    assert_near(nifti.spacing(), nrrd.spacing());
    let slope = f64::from(2.007_843_f32);
    for (a, b) in nifti.values().iter().zip(nrrd.values()) {
        assert!((f64::from(a) - slope * f64::from(b)).abs() < 1e-3, "{a}, not {slope} times {b}");
    }
}

#[test]
fn sizes_without_a_number_are_refused() {
    let file = patched("nifti2.nii", 16, &i64::MIN.to_le_bytes());
    assert_refused(Folder::new().open("a.nii", &file), "a.nii", "dim", "-9223372036854775808", "3 to 7");
}
