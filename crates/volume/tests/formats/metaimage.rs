//! MetaImage, as ITK writes it.

use crate::*;

const RAS_FROM_LPS: DVec3 = DVec3::new(-1.0, -1.0, 1.0);

/// An `int16` volume in its header's own file; the tests replace lines.
const PLAIN: &str = "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = True\n\
                     DimSize = 5 4 3\nElementType = MET_SHORT\nElementDataFile = LOCAL\n";

/// Big-endian samples.
fn data() -> Vec<u8> {
    values().iter().flat_map(|&value| (value as i16).to_be_bytes()).collect()
}

fn local(header: &str, data: &[u8]) -> Result<Volume, VolumeError> {
    Folder::new().open("a.mha", &[header.as_bytes(), data].concat())
}

#[test]
fn of_itk() {
    let axes = DMat3::from_diagonal(RAS_FROM_LPS) * rotation();
    for name in ["local.mha", "zlib.mha", "zlib.mhd"] {
        assert_lies(&open(name), axes, RAS_FROM_LPS * ORIGIN);
    }
}

/// ITK flipped the array, and says so in direction and origin.
#[test]
fn flipped_by_itk() {
    let volume = Volume::open(&fixture("flipped.mhd")).unwrap();
    let rows: Vec<f32> = values().chunks(5).flat_map(|row| row.iter().rev().copied()).collect();
    assert_eq!((volume.dims(), in_file_order(&volume)), (DIMS, rows));
    // Turned, it is the array again.
    assert_eq!(volume.values(), values());
    let axes = DMat3::from_diagonal(RAS_FROM_LPS) * rotation();
    let flipped = axes * DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
    assert_lies(&volume, flipped, RAS_FROM_LPS * ORIGIN + axes.x_axis * 4.0 * SPACING.x);
}

#[test]
fn big_endian_and_single_bytes() {
    let volume = local(PLAIN, &data()).unwrap();
    assert_eq!((volume.values(), volume.dims()), ((&values()).into(), DIMS));
    assert_eq!((volume.spacing(), volume.orientation()), (DVec3::ONE, None));
    let bytes: Vec<u8> = values().iter().map(|&value| value as u8).collect();
    let header = PLAIN.replace("BinaryDataByteOrderMSB = True\n", "").replace("MET_SHORT", "MET_UCHAR");
    assert_eq!(local(&header, &bytes).unwrap().values(), values());
}

#[test]
fn spellings_slope_and_size() {
    let header = PLAIN
        .replace("BinaryDataByteOrderMSB = True", "ElementByteOrderMSB = true\r")
        .replace("DimSize", "ElementToIntensityFunctionSlope = 2\nElementToIntensityFunctionOffset=-1\nDimSize")
        .replace("DimSize", "ElementSize = 1 2 4\nRotation = 0 1 0 -1 0 0 0 0 1\nPosition = 1 2 3\nDimSize");
    let volume = local(&header, &data()).unwrap();
    assert!(volume.values().iter().zip(values()).all(|(found, value)| found == 2.0 * value - 1.0));
    assert_eq!(volume.unit(), None);
    let micrometers = header.replace("DimSize", "DistanceUnits = um\nDimSize");
    assert_eq!(local(&micrometers, &data()).unwrap().unit(), Some("µm"));
    assert_eq!(volume.spacing(), DVec3::new(1.0, 2.0, 4.0));
    let orientation = volume.orientation().unwrap();
    assert_eq!(orientation.axes, DMat3::from_cols(DVec3::NEG_Y, DVec3::X, DVec3::Z));
    assert_eq!(orientation.origin, DVec3::new(-1.0, -2.0, 3.0));
}

#[test]
fn data_files() {
    let folder = Folder::new();
    let open = |fields: &str, data: &[u8]| {
        fs::write(folder.0.path().join("a b.raw"), data).unwrap();
        let header = PLAIN.replace("LOCAL", "a b.raw").replace("DimSize", &format!("{fields}DimSize"));
        folder.open("a.mhd", header.as_bytes())
    };
    let headed = [b"head", &data()[..]].concat();
    for (fields, data) in [("", data()), ("HeaderSize = 4\n", headed.clone()), ("HeaderSize = -1\n", headed.clone())] {
        assert_eq!(open(fields, &data).unwrap().values(), values(), "{fields}");
    }
    assert_refused(open("", &headed), "a b.raw", "data", "124 bytes", "120 bytes (60 samples of 2)");
    assert_refused(open("HeaderSize = 5\n", &headed), "a b.raw", "data", "119 bytes", "120 bytes");
    assert_refused(open("HeaderSize = -1\n", &data()[1..]), "a b.raw", "data", "119 bytes", "120 bytes");
    assert_refused(open("HeaderSize = -2\n", &headed), "a.mhd", "HeaderSize", "-2", "a number of bytes, or -1");
    let zlib = "CompressedData = True\nHeaderSize = 4\n";
    assert_refused(open(zlib, &headed), "a.mhd", "HeaderSize", "4", "if the data are not compressed");
    let missing = folder.open("b.mhd", PLAIN.replace("LOCAL", "none.raw").as_bytes());
    assert!(matches!(missing, Err(VolumeError::Io { path, .. }) if path.ends_with("none.raw")));
}

#[test]
fn wrong_fields() {
    let types = "MET_LONG_LONG";
    for (line, replacement, field, found, allowed) in [
        ("ObjectType = Image", "ObjectType = Tube", "ObjectType", "Tube", "Image"),
        ("NDims = 3", "NDims = 4", "DimSize", "5 4 3", "a number of times"),
        ("NDims = 3", "NDims = 5", "NDims", "5", "3 or 4"),
        ("NDims = 3\n", "", "NDims", "no such field", "3 or 4"),
        ("NDims = 3", "NDims = 3\nElementNumberOfChannels = 3", "data", "120 bytes", "360 bytes"),
        ("NDims = 3", "NDims = 3\nElementNumberOfChannels = 65", "ElementNumberOfChannels", "65", "1 to 64"),
        ("BinaryData = True", "BinaryData = False", "BinaryData", "False", "True"),
        ("MSB = True", "MSB = Perhaps", "BinaryDataByteOrderMSB", "Perhaps", "True or False"),
        ("BinaryDataByteOrderMSB = True\n", "", "BinaryDataByteOrderMSB", "no such field", "True or False"),
        ("NDims", "ElementByteOrderMSB = False\nNDims", "BinaryDataByteOrderMSB", "true", "false, as Element"),
        ("DimSize = 5 4 3", "DimSize = 5 4", "DimSize", "5 4", "three positive integers"),
        ("DimSize = 5 4 3", "DimSize = 5 4 0", "DimSize", "5 4 0", "three positive integers"),
        ("DimSize = 5 4 3", "DimSize = 5 4 -3", "DimSize", "5 4 -3", "three positive integers"),
        ("DimSize = 5 4 3", "DimSize = 65536 65536 1", "DimSize", "65536", "at most 4294967295 voxels"),
        ("DimSize = 5 4 3", "DimSize = 5 4 3\nDimSize = 5 4 3", "DimSize", "twice", "once"),
        ("MET_SHORT", "MET_SHORT_ARRAY", "ElementType", "MET_SHORT_ARRAY", types),
        ("LOCAL", "LIST 4", "ElementDataFile", "LIST 4", "how many axes a file has whole"),
        ("LOCAL", "slice%s.raw 1 3 1", "ElementDataFile", "%s", "a pattern with one %d"),
        ("LOCAL", "", "ElementDataFile", "", "LOCAL, the name of one file"),
        ("NDims", "CompressedData = maybe\nNDims", "CompressedData", "maybe", "True or False"),
        ("NDims", "ElementSpacing = 1 -1 1\nNDims", "ElementSpacing", "[1.0, -1.0, 1.0]", "positive"),
        ("NDims", "ElementSpacing = 1 nan 1\nNDims", "ElementSpacing", "1 nan 1", "3 of them"),
        ("NDims", "TransformMatrix = 1 0 0 0 1 0\nNDims", "TransformMatrix", "1 0 0 0 1 0", "9 of them"),
        ("NDims", "TransformMatrix = 1 0 0 0.5 1 0 0 0 1\nNDims", "TransformMatrix", "not orthogonal", "orthogonal"),
        ("NDims", "TransformMatrix = 2 0 0 0 1 0 0 0 1\nNDims", "TransformMatrix", "lengths [2.0", "lengths of 1"),
        ("NDims", "TransformMatrix = 0 0 0 0 1 0 0 0 1\nNDims", "TransformMatrix", "lengths [0.0", "orthogonal"),
        ("NDims", "TransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = 1 2\nNDims", "Offset", "1 2", "3 of them"),
        ("NDims", "no equals sign\nNDims", "header", "no equals sign", "`Field = value`"),
        ("ElementDataFile = LOCAL\n", "", "header", "", ""),
    ] {
        assert!(PLAIN.contains(line), "{line}");
        assert_refused(local(&PLAIN.replacen(line, replacement, 1), &data()), "a.mha", field, found, allowed);
    }
}

#[test]
fn damage() {
    for name in ["local.mha", "zlib.mha"] {
        let whole = fs::read(fixture(name)).unwrap();
        assert_exact(name, &whole);
    }
    let zlib = fs::read(fixture("zlib.mha")).unwrap();
    let refused = Folder::new().open("a.mha", &[&zlib[..], b"x"].concat());
    assert_refused(
        refused,
        "a.mha",
        "data",
        "bytes after the end of the stream",
        "one whole and undamaged zlib stream",
    );
}

#[test]
fn promises_of_more_than_the_file_holds_cost_nothing() {
    let large = PLAIN.replace("5 4 3", "1600 1600 1600");
    assert_refused(local(&large, &data()), "a.mha", "data", "120 bytes", "samples of 2");
    let large = large.replace("NDims", "CompressedData = True\nNDims");
    assert_refused(local(&large, &data()), "a.mha", "data", "at most", "samples of 2");
}
