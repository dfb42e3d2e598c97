//! The NRRD reader: every type and layout, every error, and files that are damaged or contradict themselves.

#![expect(clippy::unwrap_used, reason = "tests")]

#[path = "common/shared.rs"]
mod shared;

use std::fs;
use std::io::Write;
use std::path::PathBuf;

use flate2::Compression;
use flate2::write::GzEncoder;
use glam::{DMat3, DVec3, UVec3};
use sheetsplat::Camera;
use sheetsplat::volume::{Orientation, PatientSide, Volume, VolumeError};
use tempfile::TempDir;

use shared::shared;

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

/// A folder for one test's files.
struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn write(&self, name: &str, parts: &[&[u8]]) -> PathBuf {
        let path = self.0.path().join(name);
        // Overwriting a file may wait for the disk; creating a new one does not.
        _ = fs::remove_file(&path);
        fs::write(&path, parts.concat()).unwrap();
        path
    }

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

/// Asserts that the message names the file, the field, what was found and what is allowed.
#[track_caller]
fn assert_refused(result: Result<Volume, VolumeError>, file: &str, field: &str, found: &str, allowed: &str) {
    let error = result.expect_err("a volume");
    let message = error.to_string();
    let VolumeError::Invalid { origin, field: at, found: what, allowed: instead, .. } = error else {
        panic!("{message}")
    };
    assert!(origin.ends_with(file), "{message}");
    assert_eq!(at, field, "{message}");
    assert!(what.contains(found), "found {found:?}: {message}");
    assert!(instead.contains(allowed), "allowed {allowed:?}: {message}");
    for part in [origin, at, what, instead] {
        assert!(message.contains(&part), "{part}: {message}");
    }
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
        assert!(volume.values().iter().zip(&values).all(|(&read, &wrote)| read == f32::from(wrote)));
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
fn spacings() {
    let folder = Folder::new();
    let open = |line: &str| folder.attached(&format!("{PLAIN}{line}\n"), &bytes());
    assert_eq!(open("spacings: 1 0.5e-3\t+2.").unwrap().spacing(), DVec3::new(1.0, 0.5e-3, 2.0));
    let allowed = "three positive finite numbers";
    for wrong in
        ["1 1", "1 1 1 1", "nan 1 1", "1 NaN 1", "1 1 inf", "1 -1 1", "0 1 1", "1 1 x", "", "1,1,1", "1 1 1e400"]
    {
        assert_refused(open(&format!("spacings: {wrong}")), "volume.nrrd", "spacings", wrong, allowed);
    }
}

#[test]
fn units() {
    let folder = Folder::new();
    let unit = |fields: &str| {
        let volume = folder.attached(&format!("{PLAIN}{fields}\n"), &bytes()).unwrap();
        volume.unit().map(str::to_owned)
    };
    assert_eq!(unit("spacings: 1 1 1"), None);
    assert_eq!(unit("units: \"um\" \"um\" \"micron\"").as_deref(), Some("µm"));
    assert_eq!(unit("space units: \"mm\" \"mm\" \"mm\"\nunits: \"m\" \"m\" \"m\"").as_deref(), Some("mm"));
    assert_eq!(unit("units: \"mm\" \"mm\" \"s\""), None);
    assert_eq!(unit("units: mm"), None);
}

#[test]
fn space_directions() {
    let folder = Folder::new();
    let open = |value: &str| folder.attached(&format!("{PLAIN}space directions: {value}\n"), &bytes());
    let spacing = |value: &str| open(value).unwrap().spacing();
    assert_eq!(spacing("(1,0,0) (0,1,0) (0,0,1)"), DVec3::ONE);
    assert_eq!(spacing("(0,-2,0)(0.5,0,0)( 0 , 0 , 3 )"), DVec3::new(2.0, 0.5, 3.0));

    let rotation = glam::DMat3::from_euler(glam::EulerRot::XYZ, 0.3, -1.1, 2.0);
    let expected = DVec3::new(0.7, 0.7, 3.25);
    let directions = |matrix: glam::DMat3| {
        let vectors = matrix.to_cols_array_2d().map(|[x, y, z]| format!("({x},{y},{z})"));
        vectors.join(" ")
    };
    let rotated = spacing(&directions(rotation * glam::DMat3::from_diagonal(expected)));
    assert!((rotated - expected).abs().max_element() < 1e-14, "{rotated}");

    let skewed = |cosine: f64| format!("(1,0,0) ({cosine},1,0) (0,0,1)");
    assert_eq!(spacing(&skewed(0.9e-4)).y, 1.0_f64.hypot(0.9e-4));
    for skew in [6.0, -1e9] {
        let allowed = "each less than 80° from a right angle";
        assert_refused(open(&skewed(skew)), "volume.nrrd", "space directions", "from a right angle", allowed);
    }
    let allowed = "three vectors (x,y,z) of positive finite length";
    for wrong in [
        "none (0,1,0) (0,0,1)",
        "(1,0,0) (0,1,0)",
        "(1,0,0) (0,1,0) (0,0,1) (0,0,1)",
        "(1,0) (0,1) (0,0)",
        "(1,0,0) (0,1,0) (0,0,0)",
        "(1,0,0) (0,1,0) (0,0,nan)",
        "(1,0,0) (0,1,0) (0,0,1e200)",
        "(1,0,0) (0,1,0) (0,0,1",
        "(1,0,0) (0,1,0) 0,0,1)",
        "1 0 0",
        "",
    ] {
        assert_refused(open(wrong), "volume.nrrd", "space directions", wrong, allowed);
    }
    let both = open("(1,0,0) (0,1,0) (0,0,1)\nspacings: 1 1 1");
    assert_refused(both, "volume.nrrd", "space directions", "`spacings` as well", "one of");
}

#[test]
fn orientation() {
    let folder = Folder::new();
    let open = |space: &str, rest: &str| {
        let directions = "space directions: (0,-2,0) (0.5,0,0) (0,0,3)";
        folder.attached(&format!("{PLAIN}space: {space}\n{directions}\n{rest}"), &bytes())
    };
    for (names, signs) in [
        (["right-anterior-superior", "RAS"], DVec3::ONE),
        (["left-anterior-superior", "las"], DVec3::new(-1.0, 1.0, 1.0)),
        (["Left-Posterior-Superior", "LPS"], DVec3::new(-1.0, -1.0, 1.0)),
    ] {
        let axes = [DVec3::NEG_Y, DVec3::X, DVec3::Z].map(|axis| axis * signs);
        for name in names {
            let volume = open(name, "space origin: (1, 2.5, -3)\n").unwrap();
            let orientation = volume.orientation().unwrap();
            assert_eq!(orientation.axes, DMat3::from_cols_array_2d(&axes.map(|axis| axis.to_array())), "{name}");
            assert_eq!(orientation.origin, DVec3::new(1.0, 2.5, -3.0) * signs, "{name}");
            assert_eq!(orientation.is_mirrored(), signs.element_product() < 0.0, "{name}");
            assert_eq!(open(name, "").unwrap().orientation().unwrap().origin, DVec3::ZERO);
        }
    }
    // Spaces other than a patient's have no orientation.
    assert_eq!(open("scanner-xyz", "").unwrap().orientation(), None);
    assert_eq!(
        folder.attached(&format!("{PLAIN}space: RAS\nspacings: 1 1 1\n"), &bytes()).unwrap().orientation(),
        None
    );
    for wrong in ["1 2 3", "(1,2)", "(1,2,nan)", "none"] {
        let refused = open("RAS", &format!("space origin: {wrong}\n"));
        assert_refused(refused, "volume.nrrd", "space origin", wrong, "a vector (x,y,z)");
    }
}

#[test]
fn anatomical_views() {
    // A volume whose x runs to the patient's left, y to the head, z to the front.
    let folder = Folder::new();
    let header = format!("{PLAIN}space: LPS\nspace directions: (1,0,0) (0,0,1) (0,-1,0)\n");
    let volume = folder.attached(&header, &bytes()).unwrap();
    let orientation = volume.orientation().unwrap();
    assert!(!orientation.is_mirrored());
    let [left, up, front] = DMat3::IDENTITY.to_cols_array_2d().map(DVec3::from_array);
    for (view, expected) in [
        (PatientSide::Front, [-front, up]),
        (PatientSide::Back, [front, up]),
        (PatientSide::Left, [-left, up]),
        (PatientSide::Right, [left, up]),
        (PatientSide::Top, [-up, front]),
        (PatientSide::Bottom, [up, front]),
    ] {
        assert_eq!(orientation.direction_and_up(view), expected, "{view:?}");
    }
    // Seen from the front, the patient's left is on the right.
    let [direction, up] = orientation.direction_and_up(PatientSide::Front);
    assert_eq!(Camera { direction, up, ..Camera::default() }.basis().u, left);
}

#[test]
fn orientations_are_orthonormal() {
    let volume = Folder::new().attached(PLAIN, &bytes()).unwrap();
    let set = |axes: DMat3, origin: DVec3| volume.clone().with_orientation("here", Some(Orientation { axes, origin }));
    let mirrored = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
    assert!(set(mirrored, DVec3::ONE).unwrap().orientation().unwrap().is_mirrored());
    let skewed = DMat3::from_cols(DVec3::X, DVec3::new(1e-3, 1.0, 0.0), DVec3::Z);
    let wrong = [(skewed, DVec3::ZERO), (DMat3::IDENTITY * 1.001, DVec3::ZERO), (DMat3::IDENTITY, DVec3::NAN)];
    for (axes, origin) in wrong.into_iter().chain([(DMat3::NAN, DVec3::ZERO)]) {
        assert_refused(set(axes, origin), "here", "orientation", "[", "finite orthogonal unit vectors");
    }
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
    for wrong in ["2", "4", "0", "-3", "3.0", "three", "99999999999"] {
        assert_line_refused("dimension: 3", &format!("dimension: {wrong}\n"), "dimension", wrong, "3");
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
fn endless_headers() {
    let folder = Folder::new();
    let open = |parts: &[&[u8]]| Volume::open(&folder.write("volume.nrrd", parts));
    let long = vec![b'x'; 70_000];
    assert_refused(open(&[b"NRRD0005\n", &long]), "volume.nrrd", "header", "more", "lines of less than 65536 bytes");
    assert_refused(open(&[&long]), "volume.nrrd", "magic", "xxxxxxxxxx", "NRRD0001");
    let comments = b"# a comment\n".repeat(100_000);
    assert_refused(open(&[b"NRRD0005\n", &comments]), "volume.nrrd", "header", "more", "1048576 bytes in all");
    assert_refused(open(&[PLAIN.as_bytes()]), "volume.nrrd", "header", "the end of the file", "a blank line");

    // A long but legal line is shortened in the message.
    let line = format!("{PLAIN}endian: {}\n", "é".repeat(30_000));
    let message = folder.attached(&line, &bytes()).expect_err("a volume").to_string();
    assert!(message.contains("éé") && message.chars().count() < 500, "{message}");
}

#[test]
fn damaged_data() {
    let folder = Folder::new();
    let raw = |data: &[u8]| folder.attached(PLAIN, data);
    assert_refused(raw(&bytes()[1..]), "volume.nrrd", "data", "23 bytes", "24");
    assert_refused(raw(&[&bytes()[..], b"\n"].concat()), "volume.nrrd", "data", "25 bytes", "24");

    let zipped = |data: &[u8]| folder.attached(&PLAIN.replace("raw", "gzip"), data);
    let whole = gzip(&bytes());
    assert_plain(&zipped(&whole).unwrap());
    assert_plain(&zipped(&[gzip(&bytes()[..7]), gzip(&[]), gzip(&bytes()[7..])].concat()).unwrap());
    assert_refused(zipped(&gzip(&bytes()[1..])), "volume.nrrd", "data", "23 bytes", "24");
    assert_refused(zipped(&gzip(&[1; 25])), "volume.nrrd", "data", "more than 24 bytes", "24");
    assert_refused(zipped(&[&whole[..], &whole[..]].concat()), "volume.nrrd", "data", "more than 24 bytes", "24");
    assert_refused(zipped(&[&whole[..], b"tail of a file"].concat()), "volume.nrrd", "data", "", "gzip members");
    assert_refused(zipped(&bytes()), "volume.nrrd", "data", "", "gzip members");
    assert_refused(zipped(&[]), "volume.nrrd", "data", "0 bytes", "24");
    for at in [whole.len() - 1, whole.len() - 8] {
        let mut wrong = whole.clone();
        wrong[at] ^= 1;
        assert_refused(zipped(&wrong), "volume.nrrd", "data", "", "gzip members");
    }
}

#[test]
fn promises_of_more_than_the_file_holds_cost_nothing() {
    let folder = Folder::new();
    for (sizes, field) in [
        ("60000 60000 60000", "sizes"),
        ("4294967295 4294967295 4294967295", "sizes"),
        ("18446744073709551616 1 1", "sizes"),
        ("4294967295 1 1", "data"),
        ("1600 1600 1600", "data"),
    ] {
        for encoding in ["raw", "gzip"] {
            let header = PLAIN.replace("2 3 4", sizes).replace("raw", encoding).replace("uint8", "double\nendian: big");
            let refused = folder.attached(&header, &gzip(&bytes()));
            assert_refused(refused, "volume.nrrd", field, "", if field == "data" { "samples of 8" } else { "voxels" });
        }
    }
}

/// One valid file of each kind: the header's length, and the whole.
fn valid_files() -> Vec<(usize, Vec<u8>)> {
    let header = "NRRD0004\ntype: short\ndimension: 3\nsizes: 5 4 3\nendian: big\nencoding: raw\nspacings: 1 2 0.5\n\n";
    let directions = "space directions: (1,0,0) (0,2,0) (0,0,.5)\nline skip: 0\nbyte skip: 0";
    let samples: Vec<u8> = (0..60_i16).flat_map(|i| (i * 311).to_be_bytes()).collect();
    let file = |header: String, data: &[u8]| (header.len(), [header.as_bytes(), data].concat());
    vec![
        file(header.to_owned(), &samples),
        file(header.replace("raw", "gzip").replace("spacings: 1 2 0.5", directions), &gzip(&samples)),
    ]
}

#[test]
fn truncated_files_are_refused() {
    let folder = Folder::new();
    for (_, whole) in valid_files() {
        assert!(Volume::open(&folder.write("volume.nrrd", &[&whole])).is_ok());
        for length in 0..whole.len() {
            let result = Volume::open(&folder.write("volume.nrrd", &[&whole[..length]]));
            assert!(matches!(result, Err(VolumeError::Invalid { .. })), "{length} of {} bytes", whole.len());
        }
    }
}

#[test]
fn mutated_files_are_volumes_or_errors() {
    let folder = Folder::new();
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let mut random = |below: usize| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state % below as u64) as usize
    };
    let mut volumes = 0;
    for (header, whole) in valid_files() {
        for round in 0..1500 {
            let mut mutant = whole.clone();
            // Half of the mutants spare the data, where damage to a stream would hide the header's effect.
            let reach = if round % 2 == 0 { header } else { whole.len() };
            for _ in 0..=random(3) {
                let at = random(reach.min(mutant.len()));
                match random(5) {
                    0 => mutant[at] = random(256) as u8,
                    1 => mutant[at] ^= 1 << random(8),
                    2 => mutant[at] = b"0123456789-+.:=# \r\n()"[random(21)],
                    3 => mutant.insert(at, b'0' + random(10) as u8),
                    _ => _ = mutant.remove(at),
                }
            }
            match Volume::open(&folder.write("volume.nrrd", &[&mutant])) {
                Ok(volume) => {
                    assert_eq!(volume.values().len(), volume.dims().element_product() as usize);
                    assert!(volume.spacing().min_element() > 0.0);
                    volumes += 1;
                }
                Err(error) => assert!(error.to_string().contains("volume.nrrd"), "{error}"),
            }
        }
    }
    // The mutants are neither harmless nor hopeless: a file with a changed sample or comment is still valid.
    assert!((100..2900).contains(&volumes), "{volumes}");
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
        let least = volume.values().iter().copied().fold(f32::INFINITY, f32::min);
        let most = volume.values().iter().copied().fold(f32::NEG_INFINITY, f32::max);
        assert_eq!([least, most], range, "{name}");
    }
}
