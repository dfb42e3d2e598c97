//! VTK's own files, as VTK writes them.

use sheetsplat_volume::{Encoding, Labels, SampleType};

use crate::*;

const IMAGE_DATA: [&str; 8] = [
    "text.vti",
    "base64.vti",
    "base64-zlib.vti",
    "appended.vti",
    "appended-lz4.vti",
    "appended-zlib.vti",
    "appended-base64.vti",
    "appended-base64-lz4.vti",
];
const LEGACY: [&str; 4] = ["text.vtk", "binary.vtk", "text-field.vtk", "binary-field.vtk"];

#[track_caller]
fn refused(name: &str, text: &str, instead: &str, field: &str, found: &str, allowed: &str) {
    assert_refused(Folder::new().open(name, &replaced(name, text, instead)), name, field, found, allowed);
}

#[test]
fn of_vtk() {
    use SampleType::{F32, F64, I16, I32, I64, U8, U16, U64};
    let types = [I16, F32, I32, U8, F64, U16, U64, I64];
    for (name, sample_type) in IMAGE_DATA.into_iter().zip(types) {
        let volume = open(name);
        assert_eq!((volume.spacing(), volume.orientation(), volume.unit()), (SPACING, None, None), "{name}");
        assert_eq!(volume.encoding(), Some(Encoding { format: "VTI", sample_type, channels: 1, times: 1 }), "{name}");
    }
    for (name, sample_type) in LEGACY.into_iter().zip([F32, I16, U8, F64]) {
        let volume = open(name);
        assert_eq!((volume.spacing(), volume.orientation(), volume.unit()), (SPACING, None, None), "{name}");
        assert_eq!(volume.encoding(), Some(Encoding { format: "VTK", sample_type, channels: 1, times: 1 }), "{name}");
    }
    let labels = Labels::open(&fixture("appended-lz4.vti")).unwrap();
    assert!(labels.values.iter().map(|&label| f32::from(label)).eq(values()));
}

/// VTK's writer writes the same text for either byte order: `SetByteOrderToBigEndian` changes nothing but this attribute.
#[test]
fn text_has_no_byte_order() {
    use SampleType::{F32, F64, I16, I32, U8, U64};
    let types = [("Int16", I16), ("UInt8", U8), ("Int32", I32), ("Float32", F32), ("Float64", F64), ("UInt64", U64)];
    for (kind, sample_type) in types {
        let text = String::from_utf8(replaced("text.vti", "byte_order=\"LittleEndian\"", "byte_order=\"BigEndian\""));
        let text = text.unwrap().replace("Int16", kind);
        let volume = Folder::new().open("text.vti", text.as_bytes()).unwrap();
        assert_eq!(volume.values(), values(), "{kind}");
        assert_eq!(volume.encoding().unwrap().sample_type, sample_type, "{kind}");
    }
}

#[test]
fn defaults_of_missing_attributes() {
    let folder = Folder::new();
    let plain = |name: &str, text: &str| folder.open(name, &replaced(name, text, "")).unwrap();
    assert_eq!(plain("text.vti", " Spacing=\"0.5 2 3\"").spacing(), DVec3::ONE);
    assert_eq!(plain("text.vtk", "SPACING 0.5 2 3\n").spacing(), DVec3::ONE);
    assert_eq!(plain("text.vti", " byte_order=\"LittleEndian\"").values(), values());
    assert_eq!(plain("base64-zlib.vti", " header_type=\"UInt32\"").values(), values());
    // Without an active array, the first one with one component counts.
    assert!(plain("text.vti", " Scalars=\"values\"").values().iter().all(|value| value == 0.0));
}

#[test]
fn wrong_image_data() {
    let refused = |text: &str, instead: &str, field: &str, found: &str, allowed: &str| {
        refused("text.vti", text, instead, field, found, allowed);
    };
    refused("type=\"ImageData\"", "type=\"StructuredGrid\"", "type", "StructuredGrid", "ImageData");
    refused("<VTKFile", "<!--<VTKFile--><File", "header", "", "well-formed XML");
    refused("Name=\"values\"", "Name=\"value\"", "Scalars", "values", "the name of an array that is there");
    refused("</VTKFile>", "", "header", "the end of the file", "an XML file of VTK");
    refused("LittleEndian", "MiddleEndian", "byte_order", "MiddleEndian", "LittleEndian or BigEndian");
    refused("WholeExtent=\"0 4 0 3 0 2\"", "WholeExtent=\"0 4 0 3 2\"", "WholeExtent", "0 4 0 3 2", "six integers");
    refused(
        "WholeExtent=\"0 4 0 3 0 2\"",
        "WholeExtent=\"0 4 0 3 0 5\"",
        "Extent",
        "[0, 4, 0, 3, 0, 2]",
        "as the whole",
    );
    refused(
        "Spacing=\"0.5 2 3\"",
        "Spacing=\"0.5 -1 3\"",
        "Spacing",
        "0.5 -1 3",
        "three positive finite numbers, or 0",
    );
    refused("Direction=\"0.6666", "Direction=\"0.7666", "Direction", "not orthogonal", "orthogonal axes");
    refused("Direction=\"0.6666666666666666", "Direction=\"", "Direction", "-0.33", "nine finite numbers");
    refused("<CellData>", "<Piece/><CellData>", "Piece", "more than one", "one");
    refused("type=\"Int16\" Name=\"values\"", "type=\"Bit\" Name=\"values\"", "type", "Bit", "Int8, UInt8");
    refused("234\n", "40000\n", "data", "\"40000\", no number of type int16", "numbers");
    refused("234\n", "23.5\n", "data", "\"23.5\", no number of type int16", "numbers");
    refused("234\n", "\n", "data", "118 bytes", "120 bytes (60 samples of 2)");
    refused("234\n", "234 0\n", "data", "more than 120 bytes", "120 bytes");
    refused("Name=\"values\" format=\"ascii\"", "Name=\"values\" format=\"hex\"", "format", "hex", "ascii, binary");
    let sizes = "three positive integers";
    let large = "0 65535 0 65535 0 65535";
    let both = String::from_utf8(replaced("text.vti", "0 4 0 3 0 2", large)).unwrap().replace("0 4 0 3 0 2", large);
    assert_refused(Folder::new().open("text.vti", both.as_bytes()), "text.vti", "WholeExtent", "65535", sizes);
    let ends = both.replace(large, "-9223372036854775808 9223372036854775807 0 3 0 2");
    assert_refused(Folder::new().open("text.vti", ends.as_bytes()), "text.vti", "WholeExtent", "-9223", sizes);
}

#[test]
fn without_an_array_of_numbers_the_first_one_is_read() {
    let text = String::from_utf8(fs::read(fixture("text.vti")).unwrap()).unwrap();
    let vectors = |count: &str| {
        let more = text.replace("format=\"ascii\"", &format!("NumberOfComponents=\"{count}\" format=\"ascii\""));
        more.replace("NumberOfComponents=\"3\" ", "").replace("Scalars=\"values\"", "")
    };
    for count in ["65", "0", "two"] {
        let found = format!("flow ({count} components), zeros ({count} components), values ({count} components)");
        let refused = Folder::new().open("a.vti", vectors(count).as_bytes());
        assert_refused(refused, "a.vti", "DataArray", &found, "at least one with 1 to 64 components");
    }
    let flow = vectors("65").replacen("NumberOfComponents=\"65\"", "NumberOfComponents=\"3\"", 1);
    let volume = Folder::new().open("a.vti", flow.as_bytes()).unwrap();
    assert_eq!((volume.channels().count(), volume.values()), (3, [1.0; 60][..].into()));
}

#[test]
fn wrong_bytes() {
    let blocks = "as many bytes as the header says";
    refused("base64.vti", "header_type=\"UInt32\"", "header_type=\"UInt64\"", "data", "", "240 bytes");
    refused("base64.vti", "header_type=\"UInt32\"", "header_type=\"UInt16\"", "header_type", "UInt16", "UInt32 or");
    refused("base64-zlib.vti", "vtkZLibData", "vtkLZMAData", "compressor", "vtkLZMADataCompressor", "vtkLZ4DataComp");
    refused("base64-zlib.vti", "vtkZLibData", "vtkLZ4Data", "data", "", "blocks as the header says");
    refused("appended.vti", "<AppendedData", "<Data", "header", "invalid utf-8", "well-formed XML");
    refused("appended.vti", "encoding=\"raw\"", "encoding=\"hex\"", "encoding", "hex", "raw or base64");
    refused("appended.vti", "   _", "   ", "AppendedData", "no underscore", "one before the data");
    refused("appended-lz4.vti", "Int16\" Name=\"zeros\"", "", "header", "", "well-formed XML");
    // The same number of bytes for more or fewer samples.
    refused(
        "base64.vti",
        "type=\"Float32\" Name=\"values\"",
        "type=\"Float64\" Name=\"values\"",
        "data",
        "240",
        "480 bytes",
    );
    refused(
        "appended-zlib.vti",
        "type=\"UInt16\"",
        "type=\"UInt8\"",
        "data",
        "blocks of 64 bytes, the last of 56",
        blocks,
    );
}

#[test]
fn wrong_legacy_headers() {
    let refused = |text: &str, instead: &str, field: &str, found: &str, allowed: &str| {
        refused("text.vtk", text, instead, field, found, allowed);
    };
    refused("ASCII", "UTF-8", "encoding", "UTF-8", "ASCII or BINARY");
    refused("STRUCTURED_POINTS", "POLYDATA", "header", "DATASET POLYDATA", "a file of STRUCTURED_POINTS");
    refused("DIMENSIONS 5 4 3", "DIMENSIONS 5 4", "DIMENSIONS", "5 4 SPACING", "three numbers");
    refused("DIMENSIONS 5 4 3\n", "", "DIMENSIONS", "no such field", "three positive integers");
    refused("DIMENSIONS 5 4 3", "DIMENSIONS 5 4 2", "POINT_DATA", "60", "40, as DIMENSIONS says");
    refused("SPACING 0.5 2 3", "SPACING 0.5 2 nan", "SPACING", "0.5 2 nan", "three positive finite numbers");
    refused("POINT_DATA 60", "POINT_DATA many", "POINT_DATA", "many", "a number of points");
    refused("SCALARS values float", "SCALARS values half", "type", "half", "char, signed_char");
    refused("LOOKUP_TABLE default\n", "", "SCALARS", "0", "LOOKUP_TABLE in the next line");
    refused("time 1 2 double", "time 1 double", "time", "double", "a number of points, cells or components");
    refused("time 1 2 double", "time 1 200 double", "header", "\"1\"", "a file of STRUCTURED_POINTS");
    refused("224 230", "224 2x0", "data", "\"2x0\", no number of type float32", "numbers as text");
    refused("224 230", "224", "data", "236 bytes", "240 bytes");
    refused("224 230", "224 1 230", "data", "more than 240 bytes", "240 bytes");
}

/// Keywords count, line breaks do not.
#[test]
fn legacy_headers_are_of_keywords() {
    let folder = Folder::new();
    for (name, text, instead) in [
        ("binary.vtk", "BINARY\n", "\n\nBINARY\n"),
        ("text.vtk", "ASCII\n", "\n  ascii\n\n"),
        ("text.vtk", "vtk output\n", "\n"),
        ("binary.vtk", "DATASET STRUCTURED_POINTS", "dataset structured_points"),
        ("binary.vtk", "DIMENSIONS 5 4 3\nSPACING 0.5 2 3\n", "DIMENSIONS 5\n4 3 SPACING\n0.5 2 3\n"),
        ("text.vtk", "LOOKUP_TABLE default\n", "\nlookup_table default "),
        ("binary-field.vtk", "values 1 60 double\n", "values\n1 60\n\ndouble\n"),
    ] {
        let volume =
            folder.open(name, &replaced(name, text, instead)).unwrap_or_else(|error| panic!("{instead:?}: {error}"));
        assert_eq!(
            (volume.dims(), volume.spacing(), volume.values()),
            (DIMS, SPACING, (&values()).into()),
            "{instead:?}"
        );
    }
}

/// Arrays before the first one with one component are skipped by their sizes, which VTK's format of files states.
#[test]
fn legacy_arrays_before_the_samples() {
    let folder = Folder::new();
    let arrays = [
        ("TENSORS t float\n", 9 * 60, 4),
        ("TENSORS6 t double\n", 6 * 60, 8),
        ("TEXTURE_COORDINATES t 2 float\n", 2 * 60, 4),
        ("COLOR_SCALARS c 3\n", 3 * 60, 1),
        ("LOOKUP_TABLE l 7\n", 4 * 7, 1),
        ("NORMALS n float\n", 3 * 60, 4),
        ("GLOBAL_IDS i long\n", 60, 8),
        ("FIELD f 2\na 2 60 short\n", 2 * 60, 2),
    ];
    for (array, numbers, bytes) in arrays {
        let more = |numbers: usize| "1 ".repeat(numbers);
        let field = if array.starts_with("FIELD") { "b 1 9 int\n1 2 3 4 5 6 7 8 9\n" } else { "" };
        let text = |numbers: usize| format!("POINT_DATA 60\n{array}{}\n{field}", more(numbers));
        let open = |numbers| folder.open("a.vtk", &replaced("text.vtk", "POINT_DATA 60\n", &text(numbers)));
        assert_eq!(open(numbers).unwrap().values(), values(), "{array}");
        for wrong in [numbers - 1, numbers + 1] {
            assert!(matches!(open(wrong), Err(VolumeError::Invalid { .. })), "{array}");
        }
        // Bytes that would be keywords if they were text.
        let field = if array.starts_with("FIELD") { [&b"b 1 9 int\n"[..], &[b'S'; 36]].concat() } else { Vec::new() };
        let whole = fs::read(fixture("binary.vtk")).unwrap();
        let at = whole.windows(14).position(|window| window == b"POINT_DATA 60\n").unwrap() + 14;
        let with = |length: usize| {
            [&whole[..at], array.as_bytes(), &b"SCALARS x ".repeat(1000)[..length], b"\n", &field, &whole[at..]]
                .concat()
        };
        assert_eq!(folder.open("a.vtk", &with(numbers * bytes)).unwrap().values(), values(), "{array}");
    }
    // Bits take an eighth of a byte, and strings as text are words.
    let bits = "POINT_DATA 60\nSCALARS mask bit\nLOOKUP_TABLE default\n".to_owned() + &"0 1 ".repeat(30) + "\n";
    assert_eq!(folder.open("a.vtk", &replaced("text.vtk", "POINT_DATA 60\n", &bits)).unwrap().values(), values());
    let names = "POINT_DATA 60\nFIELD f 1\nnames 1 60 string\n".to_owned() + &"a%20b\n".repeat(60);
    assert_eq!(folder.open("a.vtk", &replaced("text.vtk", "POINT_DATA 60\n", &names)).unwrap().values(), values());
    let unknown = "POINT_DATA 60\nTENSORS t half\n";
    refused("text.vtk", "POINT_DATA 60\n", unknown, "type", "half", "char, signed_char");
}

/// Points may start at any number, but not count down.
#[test]
fn extents_may_begin_below_0() {
    let with = |name: &str, text: &str, extent: &str| {
        let all = String::from_utf8_lossy(&fs::read(fixture(name)).unwrap()).replace(text, extent);
        Folder::new().open("a.vti", all.as_bytes())
    };
    assert_eq!(with("text.vti", "0 4 0 3 0 2", "-7 -3 -3 0 -2 0").unwrap().values(), values());
    let cells = |extent: &str| {
        let text = fs::read_to_string(fixture("text.vti")).unwrap().replace("PointData", "CellData");
        let empty = text.replace("<CellData>\n      </CellData>", "").replace("0 4 0 3 0 2", extent);
        Folder::new().open("a.vti", empty.as_bytes())
    };
    assert_eq!(cells("-5 0 -4 0 0 3").unwrap().values(), values());
    let allowed = "a last point behind the first one, or the same";
    for extent in ["0 4 3 0 0 2", "0 4 0 -1 0 2"] {
        assert_refused(with("text.vti", "0 4 0 3 0 2", extent), "a.vti", "WholeExtent", "0, 4", allowed);
    }
    // A flat grid has one layer of cells; a grid whose points count down has none.
    assert_refused(cells("0 60 1 0 0 0"), "a.vti", "WholeExtent", "60", allowed);
    assert_eq!(cells("0 60 1 1 0 0").unwrap().dims(), UVec3::new(60, 1, 1));
}

#[test]
fn legacy_samples_and_what_follows() {
    let folder = Folder::new();
    let binary = fs::read(fixture("binary.vtk")).unwrap();
    let end = binary.windows(17).rposition(|window| window == b"FIELD FieldData 2").unwrap();
    assert_eq!(folder.open("a.vtk", &binary[..end]).unwrap().values(), values());
    let longer = [&binary[..end - 1], b"\0\0"].concat();
    assert_refused(folder.open("a.vtk", &longer), "a.vtk", "data", "122 bytes", "120 bytes (60 samples of 2)");
    assert_refused(folder.open("a.vtk", &binary[..end - 2]), "a.vtk", "data", "119 bytes", "120 bytes");
    // A long has 8 bytes.
    let types = replaced("binary.vtk", "SCALARS values short", "SCALARS values long");
    assert!(matches!(folder.open("a.vtk", &types), Err(VolumeError::Invalid { field, .. }) if field == "data"));
}

/// Grids without the row at y = -14.5: between its neighbours lie their means, as VTK's own interpolation has them, and labels are those of a neighbour.
#[test]
fn rectilinear_grids() {
    let files = ["text.vtr", "base64-zlib.vtr", "appended.vtr", "appended-lz4.vtr", "text-grid.vtk", "binary-grid.vtk"];
    let row = |y: f32, z: f32| (0..5).map(move |x| x as f32 + 10.0 * y + 100.0 * z);
    let rows = |between: f32| [0.0, 1.0, 2.0, between, 3.0];
    let slice = |between: f32, z: f32| rows(between).into_iter().flat_map(move |y| row(y, z));
    let expected = |between: f32| (0..3).flat_map(|z| slice(between, z as f32)).collect::<Vec<f32>>();
    for name in files {
        let (volume, warnings) = warned(|| Volume::open(&fixture(name)).unwrap_or_else(|error| panic!("{error}")));
        assert_eq!((volume.dims(), volume.values()), (UVec3::new(5, 5, 3), (&expected(2.5)).into()), "{name}");
        assert_near(volume.spacing(), SPACING);
        assert_warned(&warnings, "distances from 2.0000 to 4.0000: resampled from 4 to 5 samples, 2.0000 apart");
        let labels = Labels::open(&fixture(name)).unwrap();
        assert!(labels.values.iter().map(|&label| f32::from(label)).eq(expected(3.0)), "{name}");
    }
    // Without uneven places nothing is resampled.
    let folder = Folder::new();
    let text = fs::read_to_string(fixture("text-grid.vtk")).unwrap();
    assert!(text.contains("-20.5 -18.5 -16.5 -12.5"));
    let (even, warnings) = warned(|| folder.open("a.vtk", text.replace("-12.5", "-14.5").as_bytes()).unwrap());
    assert_eq!((even.dims(), even.values(), warnings.len()), (DIMS, (&values()).into(), 0));
    assert_near(even.spacing(), SPACING);
}

#[test]
fn wrong_rectilinear_grids() {
    let folder = Folder::new();
    let refused = |name: &str, text: &str, instead: &str, field: &str, found: &str, allowed: &str| {
        let all = fs::read_to_string(fixture(name)).unwrap();
        assert!(all.contains(text), "{name}: {text}");
        assert_refused(folder.open(name, all.replace(text, instead).as_bytes()), name, field, found, allowed);
    };
    let legacy = |text: &str, instead: &str, field: &str, found: &str, allowed: &str| {
        refused("text-grid.vtk", text, instead, field, found, allowed);
    };
    let four = "4 times as many samples";
    legacy("-12.5", "12.5", "Y_COORDINATES", "distances from 2.0000 to 29.0000, which need 18 samples", four);
    legacy("-12.5", "-16.5", "Y_COORDINATES", "-16.5 before -16.5", "ascending finite numbers");
    legacy("-12.5", "-20", "Y_COORDINATES", "-16.5 before -20", "ascending finite numbers");
    legacy("-12.5", "nan", "Y_COORDINATES", "-16.5 before NaN", "ascending finite numbers");
    legacy("-12.5", "1e308", "Y_COORDINATES", "distances from 2.0000", four);
    legacy("-12.5", "x", "Y_COORDINATES", "\"x\"", "4 numbers of type float64");
    legacy("Y_COORDINATES 4", "Y_COORDINATES 5", "Y_COORDINATES", "Z_COORDINATES", "5 numbers of type float64");
    legacy("-16.5 -12.5", "-16.5", "Y_COORDINATES", "Z_COORDINATES", "4 numbers");
    legacy(
        "Y_COORDINATES 4 double\n-20.5 -18.5 -16.5 -12.5",
        "",
        "Y_COORDINATES",
        "0 numbers",
        "4, as DIMENSIONS says",
    );
    legacy("DIMENSIONS 5 4 3", "DIMENSIONS 4 5 3", "X_COORDINATES", "5 numbers", "4, as DIMENSIONS says");
    legacy("double\n-20.5", "half\n-20.5", "type", "half", "char, signed_char");
    legacy("RECTILINEAR_GRID", "STRUCTURED_GRID", "header", "DATASET STRUCTURED_GRID", "RECTILINEAR_GRID");
    let xml = |text: &str, instead: &str, field: &str, found: &str, allowed: &str| {
        refused("text.vtr", text, instead, field, found, allowed);
    };
    xml("Coordinates>", "Coordinate>", "Coordinates", "0 arrays", "three arrays, along x, y and z");
    xml("-16.5 -12.5", "-16.5 -16.5", "Coordinates of y", "-16.5 before -16.5", "ascending finite numbers");
    xml("-16.5 -12.5", "-16.5", "Coordinates of y", "24 bytes", "32 bytes (4 numbers of type float64)");
    xml("type=\"RectilinearGrid\"", "type=\"Grid\"", "type", "Grid", "ImageData or RectilinearGrid");
    // Binary coordinates, of which more are promised than there are.
    let whole = fs::read(fixture("binary-grid.vtk")).unwrap();
    let with = |count: &str| {
        let at = whole.windows(15).position(|window| window == b"Z_COORDINATES 4").unwrap();
        let count = format!("Z_COORDINATES {count}");
        folder.open("a.vtk", &[&whole[..at], count.as_bytes(), &whole[at + 15..]].concat())
    };
    assert_refused(with("100000"), "a.vtk", "Z_COORDINATES", "the end of the file", "100000 numbers");
    assert_refused(with("9999999999"), "a.vtk", "Z_COORDINATES", "9999999999", "less than 1048576 bytes");
}

#[test]
fn damage() {
    for name in IMAGE_DATA.into_iter().chain(LEGACY) {
        let whole = fs::read(fixture(name)).unwrap();
        let folder = Folder::new();
        for length in 0..whole.len() {
            // The missing end may be another array.
            if let Ok(volume) = folder.open(name, &whole[..length]) {
                assert_eq!((volume.dims(), volume.values()), (DIMS, (&values()).into()), "{name}: {length} bytes");
            }
        }
    }
}
