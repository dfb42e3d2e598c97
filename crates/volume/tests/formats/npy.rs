//! NPY, as NumPy writes it.

use sheetsplat_volume::{Labels, ReadOptions, SampleType, open_store};

use crate::*;

const HEADER: &str = "{'descr': '<i2', 'fortran_order': False, 'shape': (3, 4, 5), }\n";

fn npy(header: &str) -> Vec<u8> {
    let data: Vec<u8> = values().iter().flat_map(|&value| (value as i16).to_le_bytes()).collect();
    [b"\x93NUMPY\x01\x00", &(header.len() as u16).to_le_bytes()[..], header.as_bytes(), &data].concat()
}

#[test]
fn of_numpy() {
    for (name, order) in [("c.npy", "False"), ("fortran-big.npy", "True"), ("version2.npy", "False")] {
        let header = String::from_utf8_lossy(&fs::read(fixture(name)).unwrap()).into_owned();
        assert!(header.contains(&format!("'fortran_order': {order}")), "{name}");
        let volume = open(name);
        assert_eq!((volume.spacing(), volume.orientation()), (DVec3::ONE, None));
    }
}

/// Numbers of 16 bits in either byte order, which are read by boxes, too, and truth.
#[test]
fn halves_and_truth_of_numpy() {
    for name in ["half.npy", "half-big.npy"] {
        let volume = open(name);
        assert_eq!(volume.encoding().unwrap().sample_type, SampleType::F16, "{name}");
        let mut boxed = vec![0.0; 60];
        let store = open_store(&fixture(name), &ReadOptions::default()).unwrap();
        store.read(0, UVec3::ZERO, DIMS, &mut boxed).unwrap();
        assert_eq!(boxed, values(), "{name}");
        assert!(Labels::open(&fixture(name)).unwrap().values.iter().map(|&label| f32::from(label)).eq(values()));
    }
    let truth = Volume::open(&fixture("bool.npy")).unwrap();
    let expected: Vec<f32> = values().iter().map(|value| f32::from(value % 3.0 == 0.0)).collect();
    assert_eq!((truth.dims(), truth.values()), (DIMS, (&expected).into()));
    // Those that are no whole numbers, infinite or NaN are as NumPy reads them.
    let bits: [u16; 5] = [0x3555, 0x0001, 0xfbff, 0x7c00, 0x7e00];
    let header = "{'descr': '>f2', 'fortran_order': False, 'shape': (1, 1, 5), }\n";
    let data = bits.map(u16::to_be_bytes).concat();
    let file = [b"\x93NUMPY\x01\x00", &(header.len() as u16).to_le_bytes()[..], header.as_bytes(), &data].concat();
    let volume = Folder::new().open("a.npy", &file).unwrap();
    let found = volume.values().to_vec();
    assert_eq!(found[..3], [0.333_251_95, 5.960_464_5e-8, -65504.0]);
    assert_eq!(volume.holes(), 2);
}

#[test]
fn labels() {
    let labels = Labels::open(&fixture("fortran-big.npy")).unwrap();
    assert_eq!(labels.spacing, None);
    assert!(labels.values.iter().map(|&label| f32::from(label)).eq(values()));
}

/// Numbers indexed by an array's axes, in Fortran order: the first axis changes first.
fn fortran(shape: &[usize], of: impl Fn(&[usize]) -> i16) -> Vec<u8> {
    let sides: String = shape.iter().map(|side| format!("{side}, ")).collect();
    let header = format!("{{'descr': '<i2', 'fortran_order': True, 'shape': ({sides}), }}\n");
    let mut bytes = [b"\x93NUMPY\x01\x00", &(header.len() as u16).to_le_bytes()[..], header.as_bytes()].concat();
    for mut at in 0..shape.iter().product() {
        let place: Vec<usize> = shape
            .iter()
            .map(|side| {
                let along = at % side;
                at /= side;
                along
            })
            .collect();
        bytes.extend(of(&place).to_le_bytes());
    }
    bytes
}

#[test]
fn channels_times_and_colours_in_fortran_order() {
    let folder = Folder::new();
    let value = |z: usize, y: usize, x: usize| (x + 10 * y + 100 * z) as i16;
    let path = folder.0.path().join("a.npy");
    let of = |channel: f32, time: f32| values().iter().map(|value| value + 1000.0 * channel + 10000.0 * time).collect();
    fs::write(&path, fortran(&[2, 3, 4, 5], |at| value(at[1], at[2], at[3]) + 1000 * at[0] as i16)).unwrap();
    let volume = Volume::open(&path).unwrap();
    let [first, second]: [Vec<f32>; 2] = [of(0.0, 0.0), of(1.0, 0.0)];
    assert_eq!((volume.values(), volume.channel(1).unwrap().values()), ((&first).into(), (&second).into()));
    let times = fortran(&[3, 2, 3, 4, 5], |at| value(at[2], at[3], at[4]) + 1000 * at[1] as i16 + 10000 * at[0] as i16);
    fs::write(&path, times).unwrap();
    for (channel, time) in (0..2).flat_map(|channel| (0..3).map(move |time| (channel, time))) {
        let options = ReadOptions::default().with_channel(channel).with_time(time);
        let volume = Volume::open_with(&path, &options).unwrap();
        let expected: Vec<f32> = of(channel as f32, time as f32);
        assert_eq!(volume.values(), expected, "{channel} {time}");
        assert_eq!((volume.encoding().unwrap().channels, volume.encoding().unwrap().times), (2, 3));
    }
    // Signed colours have the largest positive number for 1.
    fs::write(&path, fortran(&[3, 4, 5, 3], |at| 100 * value(at[0], at[1], at[2]) + at[3] as i16)).unwrap();
    let colors = Volume::open(&path).unwrap();
    for index in 0..60 {
        let voxel = colors.grid().voxel_at(index);
        let red = f64::from(100 * (voxel.x + 10 * voxel.y + 100 * voxel.z));
        let found = colors.color(index).unwrap().truncate() * 32767.0;
        assert!(found.abs_diff_eq(DVec3::new(red, red + 1.0, red + 2.0), 0.6), "{voxel}: {found}");
    }
}

/// An invalid label is named by its voxel, in either order.
#[test]
fn voxels_by_either_order() {
    let folder = Folder::new();
    let path = folder.0.path().join("a.npy");
    let header = HEADER.len() + 10;
    // The sample after the tenth: in C order in row 2, in Fortran order in the plane x = 0.
    for (fortran, voxel) in [("False", "[1, 2, 0]"), ("True ", "[0, 3, 2]")] {
        let mut bytes = npy(&HEADER.replace("False", fortran));
        bytes[header + 22..][..2].copy_from_slice(&(-1_i16).to_le_bytes());
        fs::write(&path, bytes).unwrap();
        let error = Labels::open(&path).unwrap_err().to_string();
        assert!(error.contains(&format!("data: found -1 at voxel {voxel}")), "{error}");
    }
}

#[test]
fn wrong_headers() {
    let folder = Folder::new();
    assert_eq!(folder.open("a.npy", &npy(HEADER)).unwrap().values(), values());
    let spread = "{ 'shape' : (3,4,5),'fortran_order':False , 'descr' :'<i2'}";
    assert_eq!(folder.open("a.npy", &npy(spread)).unwrap().values(), values());
    for (from, to, field, found, allowed) in [
        ("<i2", "<f3", "descr", "'<f3'", "f2, f4, f8"),
        ("<i2", "|f2", "descr", "'|f2'", "'<', '>' or '|'"),
        ("<i2", "|b2", "descr", "'|b2'", "b1, i1"),
        ("<i2", "|i2", "descr", "'|i2'", "'<', '>' or '|'"),
        ("<i2", "<c8", "descr", "'<c8'", "f4, f8"),
        ("<i2", "", "descr", "''", "f4, f8"),
        ("<i2", "é", "descr", "'é'", "f4, f8"),
        ("'<i2'", "[('a', '<i2')]", "descr", "[('a'", "f4, f8"),
        ("'descr'", "'description'", "descr", "none in", "f4, f8"),
        ("False", "0", "fortran_order", "0", "True or False"),
        ("(3, 4, 5)", "(12, 5)", "shape", "(12, 5)", "three dimensions z, y, x"),
        ("(3, 4, 5)", "(3, 4, 5, 2)", "data", "120 bytes", "240 bytes"),
        ("(3, 4, 5)", "(1, 1, 1, 3, 4, 5)", "shape", "(1, 1, 1, 3, 4, 5)", "three dimensions z, y, x"),
        ("(3, 4, 5)", "(3, 0, 5)", "shape", "(3, 0, 5)", "three positive integers"),
        ("(3, 4, 5)", "(65536, 65536, 1)", "shape", "65536", "at most 4294967295 voxels"),
        ("(3, 4, 5)", "(1600, 1600, 1600)", "data", "120 bytes", "8192000000 bytes"),
        ("(3, 4, 5)", "(3, 4, 4)", "data", "120 bytes", "96 bytes"),
        ("}", "", "descr", "none in", "f4, f8"),
    ] {
        assert!(HEADER.contains(from), "{from}");
        assert_refused(folder.open("a.npy", &npy(&HEADER.replace(from, to))), "a.npy", field, found, allowed);
    }
    let brackets = format!("{{'shape': {}", "(".repeat(60_000));
    assert_refused(folder.open("a.npy", &npy(&brackets)), "a.npy", "descr", "none in", "f4, f8");
    for (at, bytes, field, found) in [
        (6, &[4, 0][..], "magic", "\\x04"),
        (6, &[2, 0, 0xff, 0xff, 0xff, 0xff][..], "header", "4294967295 bytes"),
        (6, &[2, 0, 0xff, 0xff, 0, 0][..], "header", "bytes"),
    ] {
        let mut file = npy(HEADER);
        file[at..at + bytes.len()].copy_from_slice(bytes);
        assert_refused(folder.open("a.npy", &file), "a.npy", field, found, "");
    }
}

#[test]
fn damage() {
    for name in ["c.npy", "fortran-big.npy", "version2.npy", "half.npy", "bool.npy"] {
        let whole = fs::read(fixture(name)).unwrap();
        assert_exact(name, &whole);
    }
}
