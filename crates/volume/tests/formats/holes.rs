//! Samples that are not finite are holes, in every format with such samples.

use sheetsplat_volume::{Labels, RawLayout, SampleType};

use crate::*;

/// Asserts that all values are the fixtures', except that voxel [2, 1, 1] is a hole.
#[track_caller]
fn assert_hole(name: &str, volume: Result<Volume, VolumeError>) {
    let volume = volume.unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(volume.holes(), 1, "{name}");
    for (at, (found, expected)) in volume.values().iter().zip(values()).enumerate() {
        let is_right = if at == 27 { found.is_nan() } else { found == expected };
        assert!(is_right, "{name}: {found} at {at}, not {expected}");
    }
}

/// A fixture with the first occurrence of some bytes replaced.
#[track_caller]
fn with_bytes(name: &str, bytes: &[u8], instead: &[u8]) -> Vec<u8> {
    let whole = fs::read(fixture(name)).unwrap();
    let at = whole.windows(bytes.len()).position(|window| window == bytes).unwrap();
    [&whole[..at], instead, &whole[at + bytes.len()..]].concat()
}

/// The bytes of the values.
fn encoded<const N: usize>(encode: impl Fn(f32) -> [u8; N]) -> Vec<u8> {
    values().into_iter().flat_map(encode).collect()
}

#[test]
fn in_binary_files() {
    let folder = Folder::new();
    for hole in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::from_bits(0xffff_ffff)] {
        // The DICOM file's second frame has an intercept of -1.
        for (name, sample) in [("imagej-large.tif", 112.0_f32), ("float.dcm", 113.0)] {
            let bytes = with_bytes(name, &sample.to_le_bytes(), &hole.to_le_bytes());
            assert_hole(name, folder.open(&format!("a{}", &name[name.len() - 4..]), &bytes));
        }
        let data = encoded(|value| (if value == 112.0 { hole } else { value }).to_le_bytes());
        let nifti = [&patched("sform.nii", 70, &[16, 0, 32, 0])[..352], &data].concat();
        let plain = [&nifti[..112], &[0; 8], &nifti[120..]].concat();
        assert_hole("NIfTI", folder.open("a.nii", &plain));
        let header =
            "ObjectType = Image\nNDims = 3\nBinaryDataByteOrderMSB = False\nDimSize = 5 4 3\nElementType = MET_FLOAT\n";
        let meta_image = format!("{header}ElementDataFile = LOCAL\n");
        assert_hole("MetaImage", folder.open("a.mha", &[meta_image.as_bytes(), &data].concat()));
        let nrrd = "NRRD0004\ntype: float\ndimension: 3\nsizes: 5 4 3\nendian: little\nencoding: raw\n\n";
        assert_hole("NRRD", folder.open("a.nrrd", &[nrrd.as_bytes(), &data].concat()));
        let layout = RawLayout { dims: DIMS, sample_type: SampleType::F32, big_endian: false, offset: 0 };
        assert_hole("raw", Volume::open_raw(&folder.write("a.bin", &[&data]), &layout));
    }
}

/// A sample is finite if it is finite as `f32`.
#[test]
fn where_f32_ends() {
    let folder = Folder::new();
    for hole in [1e39, -1e300, f64::INFINITY, f64::NAN] {
        let [little, big] = [f64::to_le_bytes, f64::to_be_bytes];
        for (name, encode) in [("version2.npy", little), ("binary-field.vtk", big)] {
            let bytes = with_bytes(name, &encode(112.0), &encode(hole));
            assert_hole(name, folder.open(&format!("a{}", &name[name.len() - 4..]), &bytes));
        }
    }
    // The slope makes all samples except 0 and 1 infinite.
    let steep = folder.open("a.nii", &patched("sform.nii", 112, &f32::MAX.to_le_bytes())).unwrap();
    assert_eq!((steep.holes(), steep.values().at(0), steep.values().at(1)), (58, -3.0, f32::MAX));
    assert!(steep.values().slice(2..).iter().all(|value| value.is_nan()));
}

#[test]
fn in_text() {
    let folder = Folder::new();
    for hole in ["nan", "inf", "-inf", "1e39"] {
        let vtk = replaced("text.vtk", "112 ", &format!("{hole} "));
        assert_hole(hole, folder.open("a.vtk", &vtk));
        let vti = String::from_utf8(replaced("text.vti", "112 ", &format!("{hole} "))).unwrap();
        let floats = vti.replace("type=\"Int16\" Name=\"values\"", "type=\"Float32\" Name=\"values\"");
        assert_hole(hole, folder.open("a.vti", floats.as_bytes()));
    }
}

#[test]
fn nothing_but_holes_is_no_volume() {
    let folder = Folder::new();
    let nrrd = "NRRD0004\ntype: float\ndimension: 3\nsizes: 5 4 3\nendian: little\nencoding: raw\n\n";
    let all = [nrrd.as_bytes(), &encoded(|value| (value / 0.0).to_le_bytes())].concat();
    assert_refused(folder.open("a.nrrd", &all), "a.nrrd", "data", "only NaN or infinite", "one finite sample");
    let one = [&all[..all.len() - 4], &[0; 4]].concat();
    assert_eq!(folder.open("a.nrrd", &one).unwrap().holes(), 59);
}

/// A label cannot be a hole.
#[test]
fn labels_have_no_holes() {
    let folder = Folder::new();
    let nrrd = "NRRD0004\ntype: float\ndimension: 3\nsizes: 5 4 3\nendian: little\nencoding: raw\n\n";
    let data = encoded(|value| (if value == 112.0 { f32::NAN } else { value }).to_le_bytes());
    let path = folder.0.path().join("a.nrrd");
    fs::write(&path, [nrrd.as_bytes(), &data].concat()).unwrap();
    let message = Labels::open(&path).unwrap_err().to_string();
    assert!(message.contains("NaN at voxel [2, 1, 1]") && message.contains("whole numbers"), "{message}");
}
