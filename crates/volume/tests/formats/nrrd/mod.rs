//! The NRRD reader: every type and layout, every error, and files that are damaged or contradict themselves.

mod damage;
mod encodings;
mod orientation;
mod segments;

use std::fs;
use std::io::Write;

use flate2::Compression;
use flate2::write::GzEncoder;
use glam::{DVec3, UVec3};
use sheetsplat_volume::{Volume, VolumeError};

use crate::{Folder, assert_refused, shared};

/// The header of a 2×3×4 volume of `uint8`; the tests replace or add lines.
const PLAIN: &str = "NRRD0005\ntype: uint8\ndimension: 3\nsizes: 2 3 4\nencoding: raw\n";

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

fn bytes() -> Vec<u8> {
    (10..34).collect()
}

impl Folder {
    /// Opens an attached file of this header, a blank line, and the data.
    fn attached(&self, header: &str, data: &[u8]) -> Result<Volume, VolumeError> {
        Volume::open(&self.write("volume.nrrd", &[header.as_bytes(), b"\n", data]))
    }

    /// Opens a detached header, with the data in `data.raw`.
    fn detached(&self, header: &str, data: &[u8]) -> Result<Volume, VolumeError> {
        self.write("data.raw", &[data]);
        Volume::open(&self.write("volume.nhdr", &[header.as_bytes()]))
    }
}

#[track_caller]
fn assert_plain(volume: &Volume) {
    assert_eq!(volume.dims(), UVec3::new(2, 3, 4));
    let values: Vec<f32> = bytes().into_iter().map(f32::from).collect();
    assert_eq!(volume.values(), values);
}

/// Asserts that `PLAIN` with one line replaced (or added, if `line` is empty) is refused.
#[track_caller]
fn assert_line_refused(line: &str, replacement: &str, field: &str, found: &str, allowed: &str) {
    let header = if line.is_empty() {
        format!("{PLAIN}{replacement}\n")
    } else {
        assert!(PLAIN.contains(line), "{line}");
        PLAIN.replace(&format!("{line}\n"), replacement)
    };
    assert_refused(Folder::new().attached(&header, &bytes()), "volume.nrrd", field, found, allowed);
}

/// A byte string and the values it stands for, for one type.
type Samples = (Vec<u8>, Vec<f32>);

macro_rules! samples {
    ($type:ty, $big:expr) => {{
        let values: Vec<$type> = [<$type>::MIN, 0 as $type, 1 as $type, 57 as $type, 100 as $type, <$type>::MAX]
            .map(|value| value.clamp(f32::MIN as $type, f32::MAX as $type))
            .to_vec();
        let bytes = values.iter().flat_map(|v| if $big { v.to_be_bytes() } else { v.to_le_bytes() }.to_vec()).collect();
        (bytes, values.iter().map(|&value| value as f32).collect())
    }};
}

#[test]
fn every_type_both_byte_orders_and_both_encodings() {
    type Make = fn(bool) -> Samples;
    let types: [(&[&str], Make); 10] = [
        (&["signed char", "int8", "int8_t"], |big| samples!(i8, big)),
        (&["uchar", "unsigned char", "uint8", "uint8_t", "UInt8"], |big| samples!(u8, big)),
        (&["short", "short int", "signed short", "signed short int", "int16", "int16_t"], |big| samples!(i16, big)),
        (&["ushort", "unsigned short", "unsigned short int", "uint16", "uint16_t"], |big| samples!(u16, big)),
        (&["int", "signed int", "int32", "int32_t"], |big| samples!(i32, big)),
        (&["uint", "unsigned int", "uint32", "uint32_t", "unsigned  int"], |big| samples!(u32, big)),
        (
            &["longlong", "long long", "long long int", "signed long long", "signed long long int", "int64", "int64_t"],
            |big| samples!(i64, big),
        ),
        (&["ulonglong", "unsigned long long", "unsigned long long int", "uint64", "uint64_t"], |big| {
            samples!(u64, big)
        }),
        (&["float", "FLOAT"], |big| samples!(f32, big)),
        (&["double"], |big| samples!(f64, big)),
    ];
    let folder = Folder::new();
    for (names, make) in types {
        for (big, endian) in [(false, "little"), (true, "big")] {
            let (bytes, values) = make(big);
            for name in names {
                for (encoding, data) in [("raw", bytes.clone()), ("gzip", gzip(&bytes)), ("gz", gzip(&bytes))] {
                    let header = format!(
                        "NRRD0004\ntype: {name}\nendian: {endian}\ndimension: 3\nsizes: 1 2 3\nencoding: {encoding}\n"
                    );
                    let volume = folder.attached(&header, &data).unwrap();
                    assert_eq!(volume.dims(), UVec3::new(1, 2, 3), "{header}");
                    assert_eq!(volume.values(), values, "{header}");
                    assert_eq!(volume.spacing(), DVec3::ONE);
                }
            }
        }
    }
}

#[test]
fn more_samples_than_one_chunk() {
    let folder = Folder::new();
    let values: Vec<i16> = (0..70 * 50 * 30).map(|i| (i * 7 % 60_001 - 30_000) as i16).collect();
    let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_be_bytes()).collect();
    for (encoding, data) in [("raw", bytes.clone()), ("gzip", gzip(&bytes))] {
        let header =
            format!("NRRD0001\ntype: short\nendian: big\ndimension: 3\nsizes: 70 50 30\nencoding: {encoding}\n");
        let volume = folder.attached(&header, &data).unwrap();
        assert!(volume.values().iter().zip(&values).all(|(read, &wrote)| read == f32::from(wrote)));
        assert_eq!(volume.values().len(), values.len());
        assert_eq!(volume.value(UVec3::new(3, 2, 1)), f32::from(values[3 + 70 * (2 + 50)]));
    }
}

#[test]
fn magics() {
    let folder = Folder::new();
    for version in 1..=5 {
        let header = PLAIN.replace("NRRD0005", &format!("NRRD000{version}"));
        assert_plain(&folder.attached(&header, &bytes()).unwrap());
    }
    for magic in ["NRRD0006", "NRRD0000", "nrrd0004", "NRRD00004", "P5", "", "NRRD0004 and more"] {
        let header = PLAIN.replace("NRRD0005", magic);
        let found = magic.get(..9).unwrap_or(magic);
        assert_refused(folder.attached(&header, &bytes()), "volume.nrrd", "magic", found, "NRRD0001 to NRRD0005");
    }
    let nothing = Volume::open(&folder.write("empty.nrrd", &[]));
    assert_refused(nothing, "empty.nrrd", "magic", "\"\"", "NRRD0001");
    let magic_only = Volume::open(&folder.write("magic.nrrd", &[b"NRRD0004"]));
    assert_refused(magic_only, "magic.nrrd", "magic", "NRRD0004", "NRRD0001");
}

#[test]
fn headers_as_people_write_them() {
    let header = "NRRD0004\n# a comment: with a colon\n#\nTYPE: Unsigned Char\ncontent: a:=b, 3: 4\nkey:=value\nkey:=again\n\
        sizes:x:=a key with a colon\nlabels: \"x\" \"y\" \"z\"\nkinds: domain domain domain\ncentroids: unheard of\n\
        old min: 3\nspace: left-posterior-superior\nspace units: \"mm\" \"mm\" \"mm\"\nDimension:   3  \nSizes:2 3 4\n\
        Spacings: 0.5 1 2.25\nmeasurement frame: (1,0,0) (0,1,0) (0,0,1)\nEncoding: RAW\nunits:\n";
    let folder = Folder::new();
    for header in [header.to_owned(), header.replace('\n', "\r\n") + "\r"] {
        let volume = folder.attached(&header, &bytes()).unwrap();
        assert_plain(&volume);
        assert_eq!(volume.spacing(), DVec3::new(0.5, 1.0, 2.25));
    }
}

#[test]
fn detached() {
    let folder = Folder::new();
    for field in ["data file", "datafile", "Data File"] {
        let header = format!("{PLAIN}{field}: data.raw\n");
        assert_plain(&folder.detached(&header, &bytes()).unwrap());
        assert_plain(&folder.detached(&format!("{header}\nanything: here"), &bytes()).unwrap());
    }
    let compressed = format!("{}data file: ./data.raw", PLAIN.replace("raw", "gzip"));
    assert_plain(&folder.detached(&compressed, &gzip(&bytes())).unwrap());

    fs::create_dir(folder.0.path().join("deep")).unwrap();
    folder.write("deep/50 % of it", &[&bytes()]);
    let header = format!("{PLAIN}data file: deep/50 % of it\n");
    assert_plain(&folder.detached(&header, &[]).unwrap());

    // In a header without the data file field, the data follows, whatever the file's name.
    assert_plain(&Volume::open(&folder.write("whole.nhdr", &[PLAIN.as_bytes(), b"\n", &bytes()])).unwrap());
}

#[test]
fn data_file_errors() {
    let folder = Folder::new();
    let open = |value: &str| folder.detached(&format!("{PLAIN}data file: {value}\n"), &bytes());
    for wrong in ["LIST two", "LIST 0", "slice%s.raw 1 4 1", "slice%03d.raw 1 4 1 4", ""] {
        assert_refused(open(wrong), "volume.nhdr", "data file", wrong, "the name of one file");
    }
    for (files, found) in
        [("LIST", "0 files"), ("slice%03d.raw 1 3 1", "3 files"), ("slice%03d.raw 1 11 1 1", "11 files")]
    {
        assert_refused(open(files), "volume.nhdr", "data file", found, ", one for each ");
    }
    let missing = open("missing.raw").expect_err("a volume");
    assert!(matches!(&missing, VolumeError::Io { path, .. } if path.ends_with("missing.raw")), "{missing}");
    assert!(missing.to_string().contains("missing.raw"));
    assert_refused(open("."), ".", "file", "folder", "regular file");
    for (data, found) in [(&bytes()[1..], "23"), (&[&bytes()[..], b"\n"].concat(), "25"), (&[], "0")] {
        let result = folder.detached(&format!("{PLAIN}data file: data.raw\n"), data);
        assert_refused(result, "data.raw", "data", &format!("{found} bytes"), "24 bytes (24 samples of 1)");
    }
    assert!(matches!(Volume::open(&folder.0.path().join("none.nrrd")), Err(VolumeError::Io { .. })));
}

#[test]
fn skips() {
    let folder = Folder::new();
    let detached = |fields: &str, data: &[u8]| folder.detached(&format!("{PLAIN}data file: data.raw\n{fields}"), data);
    let lines = [b"P5\n2 12\r\n255\n", &bytes()[..]].concat();
    assert_plain(&detached("line skip: 3\n", &lines).unwrap());
    assert_plain(&detached("lineskip: 1\nbyteskip: 10\n", &lines).unwrap());
    assert_plain(&detached("byte skip: 13\n", &lines).unwrap());
    assert_plain(&detached("byte skip: -1\n", &lines).unwrap());
    assert_plain(&detached("line skip: 2\nbyte skip: -1\n", &lines).unwrap());
    let with_tail = [&lines[..], b"tail"].concat();
    assert_plain(&detached("line skip: 3\n", &with_tail).unwrap());
    assert_plain(&detached("byte skip: 0\n", &[&bytes()[..], b"tail"].concat()).unwrap());
    assert_plain(
        &folder.attached(&format!("{PLAIN}line skip: 1\nbyte skip: 2\n"), &[b"x\nyz", &bytes()[..]].concat()).unwrap(),
    );

    let zipped = |fields: &str, data: &[u8]| {
        folder.detached(&format!("{}data file: data.raw\n{fields}", PLAIN.replace("raw", "gzip")), data)
    };
    assert_plain(&zipped("line skip: 3\nbyte skip: 13\n", &[b"1\n2\n3\n", &gzip(&lines)[..]].concat()).unwrap());

    for (fields, field, found) in [
        ("line skip: -1", "line skip", "-1"),
        ("line skip: 1.5", "line skip", "1.5"),
        ("line skip:", "line skip", "\"\""),
        ("byte skip: -2", "byte skip", "-2"),
        ("byte skip: 99999999999999999999", "byte skip", "99999999999999999999"),
    ] {
        assert_refused(detached(&format!("{fields}\n"), &lines), "volume.nhdr", field, found, "a number of");
    }
    assert_refused(zipped("byte skip: -1\n", &gzip(&lines)), "volume.nhdr", "byte skip", "-1", "encoding is raw");
    assert_refused(
        detached("line skip: 18446744073709551615\n", &lines),
        "data.raw",
        "line skip",
        "18446744",
        "at most",
    );
    for skip in ["14", "1000", "9223372036854775808", "18446744073709551615"] {
        assert_refused(detached(&format!("byte skip: {skip}\n"), &lines), "data.raw", "data", "bytes", "24");
        assert_refused(zipped(&format!("byte skip: {skip}\n"), &gzip(&lines)), "data.raw", "data", "bytes", "24");
    }
    assert_refused(detached("byte skip: -1\n", &bytes()[1..]), "data.raw", "data", "23 bytes", "24");
    // An attached header is not counted as data.
    let short = folder.attached(&format!("{PLAIN}byte skip: -1\n"), &bytes()[1..]);
    assert_refused(short, "volume.nrrd", "data", "23 bytes", "24");
}

#[test]
fn field_errors() {
    let types = "int8, uint8, int16, uint16, int32, uint32, int64, uint64, float, double";
    for wrong in ["block", "char", "long", "float16", "half", "complex", "", "uint 8"] {
        assert_line_refused("type: uint8", &format!("type: {wrong}\n"), "type", wrong, types);
    }
    for wrong in ["zip", "base64", "zrl", "", "raw raw"] {
        assert_line_refused("encoding: raw", &format!("encoding: {wrong}\n"), "encoding", wrong, "raw, gzip or gz");
    }
    for wrong in ["2", "6", "0", "-3", "3.0", "three", "99999999999"] {
        assert_line_refused("dimension: 3", &format!("dimension: {wrong}\n"), "dimension", wrong, "3 or 4");
    }
    for wrong in ["2 3", "2 3 4 1", "0 3 4", "2 -3 4", "2 3 4.0", "2,3,4", "", "65536 65536 1", "60000 60000 60000"] {
        assert_line_refused("sizes: 2 3 4", &format!("sizes: {wrong}\n"), "sizes", wrong, "three positive integers");
    }
    for line in ["type: uint8", "dimension: 3", "sizes: 2 3 4", "encoding: raw"] {
        let field = line.split(':').next().unwrap();
        assert_line_refused(line, "", field, "no such field", "");
        assert_line_refused("", line, field, "the field twice", "each field once");
        assert_line_refused(line, &format!("{}\n", line.replace(": ", ":=")), field, "no such field", "");
    }
    assert_line_refused("type: uint8", "type: uint16\n", "endian", "no such field", "little or big");
    assert_line_refused("", "endian: middle", "endian", "middle", "little or big");
    assert_line_refused("", "line skip: 0\nlineskip: 0", "line skip", "twice", "once");
    assert_line_refused("", "byte skip: 0\nByteSkip: 0", "byte skip", "twice", "once");
    assert_line_refused("", "content: a\nCONTENT: b", "content", "twice", "once");
    assert_line_refused(
        "",
        "no colon in it",
        "header",
        "no colon in it",
        "`field: value`, `key:=value` or `# comment`",
    );
    assert_line_refused("", " ", "header", " ", "`field: value`");
}

#[test]
#[ignore = "needs the shared data: SHEETSPLAT_SHARED=FOLDER"]
fn shared_volumes() {
    let micrometres = DVec3::new(0.022_491_86, 0.022_491_86, 0.125);
    for (name, dims, spacing, range) in [
        ("ct-head.nrrd", [256, 256, 113], DVec3::new(1.0, 1.0, 2.0), [0.0, 3272.0]),
        ("colin27-t1.nrrd", [181, 217, 181], DVec3::ONE, [0.0, 254.0]),
        ("beads-confocal.nrrd", [150, 150, 41], micrometres, [1.0, 156.0]),
    ] {
        let volume = Volume::open(&shared(&format!("data/{name}"))).unwrap();
        assert_eq!(volume.dims(), UVec3::from_array(dims), "{name}");
        assert!((volume.spacing() - spacing).abs().max_element() < 1e-8, "{name}: {}", volume.spacing());
        let least = volume.values().iter().fold(f32::INFINITY, f32::min);
        let most = volume.values().iter().fold(f32::NEG_INFINITY, f32::max);
        assert_eq!([least, most], range, "{name}");
    }
}
