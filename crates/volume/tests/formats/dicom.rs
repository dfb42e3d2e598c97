//! DICOM as pydicom writes it, and invalid series.

mod segments;
mod several;

use sheetsplat_volume::{Encoding, Labels, ReadOptions, SampleType};

use crate::*;

const RAS_FROM_LPS: DVec3 = DVec3::new(-1.0, -1.0, 1.0);
const FRAMES: [(&str, SampleType); 14] = [
    ("frames.dcm", SampleType::U16),
    ("implicit.dcm", SampleType::I16),
    ("undefined.dcm", SampleType::U32),
    ("big.dcm", SampleType::U16),
    ("float.dcm", SampleType::F32),
    ("rle.dcm", SampleType::U16),
    ("jpeg-lossless.dcm", SampleType::U16),
    ("jpeg2000.dcm", SampleType::U16),
    ("deflated.dcm", SampleType::U16),
    // Inverted.
    ("white-is-zero.dcm", SampleType::U16),
    ("white-is-zero-signed.dcm", SampleType::I16),
    // Without the 128 bytes and "DICM".
    ("bare-explicit.dcm", SampleType::U16),
    ("bare-implicit.dcm", SampleType::I16),
    ("bare-meta.dcm", SampleType::U16),
];

#[track_caller]
fn assert_lies_as_written(volume: &Volume) {
    assert_lies(volume, DMat3::from_diagonal(RAS_FROM_LPS) * rotation(), RAS_FROM_LPS * ORIGIN);
    assert_eq!(volume.unit(), Some("mm"));
}

/// Slices in files without extensions, in an order that neither names nor numbers show, each with its own slope, and with a report among them.
#[test]
fn series_of_pydicom() {
    let volume = open("series");
    assert_lies_as_written(&volume);
    assert_eq!(
        volume.encoding(),
        Some(Encoding { format: "DICOM", sample_type: SampleType::I16, channels: 1, times: 1 })
    );
    let labels = Labels::open(&fixture("series")).unwrap();
    assert!(labels.values.iter().map(|&label| f32::from(label)).eq(values()));
}

#[test]
fn frames_of_pydicom() {
    for (name, kind) in FRAMES {
        let volume = open(name);
        assert_lies_as_written(&volume);
        assert_eq!(volume.encoding().unwrap().sample_type, kind, "{name}");
    }
}

/// Slices that are TIFF files, too, and slices with icons whose pixels are compressed, also in private sequences (`pydicom.dcmread(…).pixel_array`).
#[test]
fn slices_with_something_else_in_them() {
    for name in ["dicom/preambles", "dicom/icons"] {
        let volume = open(name);
        assert_lies_as_written(&volume);
        assert_eq!(volume.encoding().unwrap().format, "DICOM", "{name}");
    }
}

#[test]
fn one_slice_is_as_thick_as_it_says() {
    let volume = Volume::open(&fixture("series/IM2")).unwrap();
    assert_eq!((volume.dims(), volume.values()), (DIMS.with_z(1), values()[..20].into()));
    assert_near(volume.spacing(), SPACING.with_z(9.0));
    let report = Volume::open(&fixture("series/report"));
    assert_refused(report, "report", "PixelData", "no such element", "an image");
}

/// A slice of 3 × 2 pixels, whose elements are texts or 16-bit numbers.
#[derive(Clone)]
struct Slice {
    text: Vec<(u16, u16, &'static [u8; 2], String)>,
    numbers: Vec<(u16, u16, u16)>,
    /// Elements of several numbers in the group of pixels.
    words: Vec<(u16, Vec<u16>)>,
    samples: Vec<u16>,
}

/// The elements that the tests change.
const SERIES: (u16, u16) = (0x20, 0x0e);
const POSITION: (u16, u16) = (0x20, 0x32);
const ORIENTATION: (u16, u16) = (0x20, 0x37);
const FRAME_COUNT: (u16, u16) = (0x28, 0x08);
const PIXEL_SPACING: (u16, u16) = (0x28, 0x30);
const SLOPE: (u16, u16) = (0x28, 0x1053);

impl Slice {
    fn at(z: f64) -> Self {
        let text = [
            (0x08, 0x60, b"CS", "CT"),
            (0x08, 0x103e, b"LO", "a chest"),
            (0x20, 0x0e, b"UI", "1.2.3"),
            (0x20, 0x37, b"DS", "1\\0\\0\\0\\1\\0"),
            (0x28, 0x04, b"CS", "MONOCHROME2"),
            (0x28, 0x30, b"DS", "0.5\\0.5"),
        ];
        let slice = Self {
            text: text.map(|(group, element, kind, text)| (group, element, kind, text.to_owned())).to_vec(),
            numbers: vec![
                (0x28, 0x02, 1),
                (0x28, 0x10, 2),
                (0x28, 0x11, 3),
                (0x28, 0x100, 16),
                (0x28, 0x101, 16),
                (0x28, 0x102, 15),
                (0x28, 0x103, 0),
            ],
            words: Vec::new(),
            samples: (0..6).map(|i| 10 * z as u16 + i).collect(),
        };
        slice.with(POSITION, &format!("1\\2\\{z}"))
    }

    fn with(mut self, (group, element): (u16, u16), text: &str) -> Self {
        self.text.retain(|&(g, e, ..)| (g, e) != (group, element));
        if !text.is_empty() {
            self.text.push((group, element, b"DS", text.to_owned()));
        }
        self
    }

    fn number(mut self, group: u16, element: u16, number: u16) -> Self {
        self.numbers.retain(|&(g, e, _)| (g, e) != (group, element));
        self.numbers.push((group, element, number));
        self
    }

    fn words(mut self, element: u16, words: &[u16]) -> Self {
        self.words.push((element, words.to_vec()));
        self
    }

    fn bytes(&self) -> Vec<u8> {
        let element = |group: u16, element: u16, kind: &[u8], value: &[u8]| {
            let length = (value.len() as u16).to_le_bytes();
            [&group.to_le_bytes(), &element.to_le_bytes(), kind, &length, value].concat()
        };
        let mut bytes = [&[0; 128], &b"DICM"[..], &element(2, 0x10, b"UI", b"1.2.840.10008.1.2.1\0")].concat();
        let even = |text: &str| [text, if text.len() % 2 == 1 { " " } else { "" }].concat();
        for (group, number, kind, text) in &self.text {
            bytes.extend(element(*group, *number, &kind[..], even(text).as_bytes()));
        }
        for &(group, number, value) in &self.numbers {
            bytes.extend(element(group, number, b"US", &value.to_le_bytes()));
        }
        for (number, words) in &self.words {
            let value: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
            bytes.extend(element(0x28, *number, b"US", &value));
        }
        bytes.extend([0xe0, 0x7f, 0x10, 0x00, b'O', b'W', 0, 0]);
        bytes.extend((2 * self.samples.len() as u32).to_le_bytes());
        bytes.extend(self.samples.iter().flat_map(|sample| sample.to_le_bytes()));
        bytes
    }
}

/// Opens a folder with some slices, which are named `0`, `1`, …
fn series(slices: &[Slice]) -> Result<Volume, VolumeError> {
    series_with(slices, &ReadOptions::default())
}

fn series_with(slices: &[Slice], options: &ReadOptions) -> Result<Volume, VolumeError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("series");
    fs::create_dir(&path).unwrap();
    for (number, slice) in slices.iter().enumerate() {
        fs::write(path.join(number.to_string()), slice.bytes()).unwrap();
    }
    Volume::open_with(&path, options)
}

fn at(places: &[f64]) -> Vec<Slice> {
    places.iter().map(|&z| Slice::at(z)).collect()
}

#[test]
fn places_order_and_space_slices() {
    let volume = series(&at(&[4.0, 0.0, 6.0, 2.0])).unwrap();
    assert_eq!((volume.dims(), volume.spacing()), (UVec3::new(3, 2, 4), DVec3::new(0.5, 0.5, 2.0)));
    let expected: Vec<f32> = (0..24).map(|i| (20 * (i / 6) + i % 6) as f32).collect();
    assert_eq!(volume.values(), expected);
    // The slices run from the head downwards, but the normal still points up.
    assert_near(volume.orientation().unwrap().origin, DVec3::new(-1.0, -2.0, 0.0));
    let names: Vec<Slice> = at(&[0.0, 3.0]).into_iter().map(|slice| slice.with(SLOPE, "2")).collect();
    assert!(series(&names).unwrap().values().iter().zip([0, 1, 2, 3, 4, 5, 30]).all(|(v, e)| v == 2.0 * e as f32));
}

/// Missing slices lie linearly between their neighbours, as in `numpy.interp(range(0, 12, 2), [0, 2, 4, 8, 10], slices)`.
#[test]
fn uneven_slices_are_resampled() {
    let (volume, warnings) = warned(|| series(&at(&[0.0, 2.0, 4.0, 8.0, 10.0])).unwrap());
    assert_warned(
        &warnings,
        "4.0000 mm between 2 and 3, 2.0000 mm between others: resampled to 6 slices, 2.0000 mm apart",
    );
    assert_eq!((volume.dims(), volume.spacing().z), (UVec3::new(3, 2, 6), 2.0));
    let expected: Vec<f32> = (0..36).map(|i| (20 * (i / 6) + i % 6) as f32).collect();
    assert_eq!(volume.values(), expected);
    // The finest distance is that of the last two.
    let (volume, warnings) = warned(|| series(&at(&[0.0, 2.0, 4.0, 5.0])).unwrap());
    assert_warned(&warnings, "1.0000 mm between 2 and 3, 2.0000 mm between others: resampled to 6 slices, 1.0000 mm");
    let expected: Vec<f32> = (0..36).map(|i| (10 * (i / 6) + i % 6) as f32).collect();
    assert_eq!((volume.spacing().z, volume.values()), (1.0, (&expected).into()));
    assert_near(volume.orientation().unwrap().origin, DVec3::new(-1.0, -2.0, 0.0));
    let allowed = "slices of which at most three times as many are missing";
    let found = "distances from 2.0000 to 96.0000, which need 50 samples";
    assert_refused(series(&at(&[0.0, 2.0, 4.0, 100.0, 98.0])), "series", "ImagePositionPatient", "94.0000 mm", allowed);
    assert_refused(series(&at(&[0.0, 2.0, 98.0])), "series", "ImagePositionPatient", found, allowed);
    // Off by a tenth of a step, with a warning.
    let volume = series(&at(&[0.0, 2.2, 4.0, 6.0])).unwrap();
    assert_eq!(volume.spacing().z, 2.0);
}

/// Slices whose rows are displaced by these distances, in mm, from a straight stack.
fn off(rows: &[f64]) -> Vec<Slice> {
    let slice = |(i, off): (usize, &f64)| {
        let z = 2.0 * i as f64;
        Slice::at(z).with(POSITION, &format!("1\\{}\\{z}", 2.0 + off))
    };
    rows.iter().enumerate().map(slice).collect()
}

/// Pixels measure 0.5 mm.
#[test]
fn slices_up_to_half_a_pixel_off_are_read_as_they_are() {
    let (volume, warnings) = warned(|| series(&off(&[0.0, 0.0049, 0.0])).unwrap());
    assert_eq!((volume.dims(), warnings), (UVec3::new(3, 2, 3), Vec::<String>::new()));
    let expected: Vec<f32> = (0..18).map(|i| (20 * (i / 6) + i % 6) as f32).collect();
    assert_eq!(volume.values(), expected);
    for (rows, words) in [
        (&[0.0, 0.006, 0.0][..], "slices are not quite on one line: 1 is 0.0060 mm off, the largest error"),
        (&[0.0, 0.1, -0.24], "2 is 0.2400 mm off, the largest error"),
        (&[0.0, 0.1, 0.249], "2 is 0.2490 mm off, the largest error"),
    ] {
        let (volume, warnings) = warned(|| series(&off(rows)).unwrap());
        assert_warned(&warnings, words);
        assert_eq!((volume.dims(), volume.values()), (UVec3::new(3, 2, 3), (&expected).into()));
        assert_near(volume.orientation().unwrap().origin, DVec3::new(-1.0, -2.0, 0.0));
    }
}

#[test]
fn tilted_gantries_are_sheared() {
    // A row of 0.5 mm per slice distance of 2 mm: 14.04°.
    let (volume, warnings) = warned(|| series(&off(&[0.0, 0.5, 1.0])).unwrap());
    assert_warned(&warnings, "series: sheared by 14.04°");
    assert_eq!((volume.dims(), volume.spacing()), (UVec3::new(3, 4, 3), DVec3::new(0.5, 0.5, 2.0)));
    let hole = f32::NAN;
    let rows = |z: f32| [[z, z + 1.0, z + 2.0], [z + 3.0, z + 4.0, z + 5.0]];
    let ([a, b], [c, d], [e, f], none) = (rows(0.0), rows(20.0), rows(40.0), [hole; 3]);
    let expected = [a, b, none, none, none, c, d, none, none, none, e, f].concat();
    let is_same = volume.values().iter().zip(expected).all(|(a, b)| a == b || a.is_nan() && b.is_nan());
    assert!(is_same && volume.values().len() == 36, "{:?}", volume.values());
    assert_near(volume.orientation().unwrap().origin, DVec3::new(-1.0, -2.0, 0.0));
    // Displaced towards smaller rows, voxel 0 lies outside slice 0.
    let back = series(&off(&[0.0, -0.5, -1.0])).unwrap();
    assert_near(back.orientation().unwrap().origin, DVec3::new(-1.0, -1.0, 0.0));
    assert_eq!(back.values().slice(6..12), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);

    // In addition off the line by less than half a pixel.
    let (volume, warnings) = warned(|| series(&off(&[0.0, 0.7, 1.0])).unwrap());
    assert_eq!((volume.dims(), warnings.len()), (UVec3::new(3, 4, 3), 2));
    assert!(warnings[0].contains("1 is 0.2000 mm off, the largest error"), "{warnings:?}");
    assert!(warnings[1].contains("sheared by 14.04°"), "{warnings:?}");
    // Off by more, the slices are on no line.
    let field = "ImagePositionPatient";
    let found = "1, 0.3000 mm off the line through the first and the last slice";
    assert_refused(series(&off(&[0.0, 0.3, 0.0])), "series", field, found, "half a pixel of 0.5 mm");
    let found = "1, 0.4000 mm off the line";
    assert_refused(series(&off(&[0.0, 0.9, 1.0])), "series", field, found, "half a pixel of 0.5 mm");

    // Slices tilted about x and stacked along z.
    let tilted: Vec<Slice> =
        at(&[0.0, 2.0, 4.0]).into_iter().map(|slice| slice.with(ORIENTATION, "1\\0\\0\\0\\0.8\\0.6")).collect();
    let (volume, warnings) = warned(|| series(&tilted).unwrap());
    assert_warned(&warnings, "sheared by 36.87°");
    assert_near(volume.spacing(), DVec3::new(0.5, 0.5, 1.6));
    let flat: Vec<Slice> =
        at(&[0.0, 2.0, 4.0]).into_iter().map(|slice| slice.with(ORIENTATION, "1\\0\\0\\0\\0.1\\0.99499")).collect();
    assert_refused(series(&flat), "series", field, "axes at 84.26° from a right angle", "less than 80°");
    let skew: Vec<Slice> =
        at(&[0.0, 2.0]).into_iter().map(|slice| slice.with(ORIENTATION, "1\\0\\0\\0.1\\0.995\\0")).collect();
    assert_refused(series(&skew), "series", "ImageOrientationPatient", "not orthogonal", "orthogonal axes");
}

/// 16 bits of noise in several code blocks, so that every bit counts.
#[test]
fn jpeg_2000_is_exact() {
    let volume = Volume::open(&fixture("jpeg2000-large.dcm")).unwrap();
    assert_eq!(volume.dims(), UVec3::new(70, 50, 1));
    let noise = (0..3500_u32).map(|i| (i % 70, i / 70));
    let expected = noise.map(|(x, y)| ((x * 40503 + y * 30011 + x * x * y * 977) % 65536) as f32);
    assert!(volume.values().iter().eq(expected));
    let signed = Volume::open(&fixture("jpeg2000-signed.dcm")).unwrap();
    assert!(signed.values().iter().eq(values().iter().map(|value| value - 100.0)));
}

#[test]
fn folders_hold_files_without_preamble_too() {
    let folder = tempfile::tempdir().unwrap();
    for (number, slice) in at(&[0.0, 2.0, 4.0]).iter().enumerate() {
        let bytes = slice.bytes();
        // The whole file, the file from the group with its encoding on, and the file after that group.
        let from = [0, 132, 132 + 8 + 20][number];
        fs::write(folder.path().join(number.to_string()), &bytes[from..]).unwrap();
    }
    let volume = Volume::open(folder.path()).unwrap();
    assert_eq!((volume.dims(), volume.spacing().z), (UVec3::new(3, 2, 3), 2.0));
    // A file with a slice's name that is not a slice is left out with a warning; other files are left out silently.
    for name in ["IM9", "1.2.840", ".DS_Store"] {
        fs::write(folder.path().join(name), b"\x03\x00\x16\x07").unwrap();
    }
    fs::write(folder.path().join("3.dcm"), b"\x00\x05\x16\x07").unwrap();
    fs::write(folder.path().join("notes.txt"), b"notes").unwrap();
    let (again, warnings) = warned(|| Volume::open(folder.path()).unwrap());
    assert_warned(&warnings, "3 files are not slices and are left out: 1.2.840, 3.dcm, IM9");
    assert_eq!(again.values(), volume.values());
}

#[test]
fn indices_have_the_colours_of_their_palette() {
    // Indices from 10 on, as slices at z = 1 have.
    let slice = |z: f64, red: &[u16]| {
        let tables = [(0x1101, 0x1201, red), (0x1102, 0x1202, &[0; 6]), (0x1103, 0x1203, &[65535; 6])];
        let slice = Slice::at(z).with((0x28, 0x04), "PALETTE COLOR");
        tables
            .into_iter()
            .fold(slice, |slice, (descriptor, table, words)| slice.words(descriptor, &[6, 10, 16]).words(table, words))
    };
    let red = [0, 13107, 26214, 39321, 52428, 65535];
    let volume = series(&[slice(1.0, &red)]).unwrap();
    assert_eq!(volume.values(), [10.0, 11.0, 12.0, 13.0, 14.0, 15.0]);
    let expected: Vec<(f64, DVec3)> =
        (0..6).map(|at| (f64::from(at) + 10.0, DVec3::new(f64::from(at) / 5.0, 0.0, 1.0))).collect();
    assert_eq!(volume.palette().unwrap(), expected);
    // Numbers of 8 bits, two in a word or one, and in 16 bits too.
    let packed = Slice::at(1.0)
        .with((0x28, 0x04), "PALETTE COLOR")
        .words(0x1101, &[3, 10, 8])
        .words(0x1201, &[0x3300, 0x00ff])
        .words(0x1102, &[3, 10, 8])
        .words(0x1202, &[0, 0x33, 0xff])
        .words(0x1103, &[3, 10, 16])
        .words(0x1203, &[0xff, 0, 0x33]);
    let volume = series(&[packed]).unwrap();
    let expected = [(10.0, DVec3::Z), (11.0, DVec3::new(0.2, 0.2, 0.0)), (12.0, DVec3::new(1.0, 1.0, 0.2))];
    assert_eq!(volume.palette().unwrap(), expected);
    // Slices of several palettes have none, and neither have indices that are rescaled.
    let others = [slice(1.0, &red), slice(2.0, &[7; 6])];
    assert_eq!(series(&others).unwrap().palette(), None);
    assert_eq!(series(&[slice(1.0, &red).with(SLOPE, "2")]).unwrap().palette(), None);
}

#[test]
fn luminance_and_differences_become_colours() {
    for name in ["colors/rgb.dcm", "colors/planar.dcm", "colors/rle.dcm"] {
        let stored = Volume::open(&fixture(name)).unwrap();
        let volume = Folder::new().open("a.dcm", &replaced(name, "CS\x04\0RGB ", "CS\x08\0YBR_FULL")).unwrap();
        let mut clamped = 0;
        for index in 0..60 {
            let [y, blue, red, _] = (stored.color(index).unwrap() * 255.0).to_array();
            let (blue, red) = (blue - 128.0, red - 128.0);
            // ITU-R BT.601.
            let exact = DVec3::new(y + 1.402 * red, y - 0.344136 * blue - 0.714136 * red, y + 1.772 * blue);
            let found = volume.color(index).unwrap().truncate() * 255.0;
            let expected = exact.clamp(DVec3::ZERO, DVec3::splat(255.0));
            assert!(found.abs_diff_eq(expected, 0.5 + 1e-9), "{name} {index}: {found}, not {exact}");
            clamped += usize::from(exact != expected);
        }
        assert!((1..60).contains(&clamped), "{name}: {clamped}");
    }
    let half = Folder::new().open("a.dcm", &replaced("colors/rgb.dcm", "CS\x04\0RGB ", "CS\x0c\0YBR_FULL_422"));
    assert_refused(half, "a.dcm", "PhotometricInterpretation", "YBR_FULL_422", "RGB or YBR_FULL for colours");
    let jpeg = Folder::new().open("a.dcm", &replaced("colors/jpeg.dcm", "CS\x08\0YBR_FULL", "CS\x04\0RGB "));
    assert_refused(jpeg, "a.dcm", "PhotometricInterpretation", "RGB", "YBR_FULL or YBR_FULL_422 for colours");
}

#[test]
fn wrong_elements() {
    let refused = |slice: Slice, field: &str, found: &str, allowed: &str| {
        assert_refused(Folder::new().open("a.dcm", &slice.bytes()), "a.dcm", field, found, allowed);
    };
    let slice = || Slice::at(1.0);
    refused(
        slice().with(POSITION, ""),
        "ImagePositionPatient",
        "no such element",
        "the image's position in the patient",
    );
    refused(slice().with(POSITION, "1\\2"), "ImagePositionPatient", "1\\\\2", "finite numbers, 3 of them");
    refused(slice().with(ORIENTATION, "1\\0\\0\\0\\1\\x"), "ImageOrientationPatient", "x", "6 of them");
    refused(slice().with(ORIENTATION, "0\\0\\0\\0\\1\\0"), "ImageOrientationPatient", "lengths [0.0", "orthogonal");
    refused(slice().with(PIXEL_SPACING, ""), "PixelSpacing", "no such element", "distances between pixels");
    refused(slice().with(PIXEL_SPACING, "0\\1"), "PixelSpacing", "[0, 1]", "two positive numbers");
    refused(slice().with(SLOPE, "inf"), "RescaleSlope", "inf", "finite numbers");
    refused(slice().with(FRAME_COUNT, "0"), "NumberOfFrames", "0", "a positive integer");
    refused(slice().with(FRAME_COUNT, "3"), "PixelData", "12 bytes", "36 bytes (3 frames of 3 × 2 uint16)");
    refused(slice().number(0x28, 0x02, 2), "SamplesPerPixel", "2", "1 or 3");
    refused(slice().number(0x28, 0x02, 3), "PhotometricInterpretation", "MONOCHROME2", "RGB or YBR_FULL for colours");
    let indices = slice().with((0x28, 0x04), "PALETTE COLOR");
    refused(indices.clone(), "RedPaletteColorLookupTableDescriptor", "no such element", "8 or 16 bits");
    let table = "RedPaletteColorLookupTableDescriptor";
    refused(indices.clone().words(0x1101, &[0, 0, 16]), table, "[0, 0, 16]", "at most 2048 colours");
    refused(indices.clone().words(0x1101, &[6, 0, 12]), table, "[6, 0, 12]", "8 or 16 bits");
    let stated = indices.words(0x1101, &[6, 0, 16]);
    refused(stated.clone(), "RedPaletteColorLookupTableData", "no such element", "6 numbers of 16 bits");
    refused(stated.clone().words(0x1201, &[1; 5]), "RedPaletteColorLookupTableData", "10 bytes", "6 numbers");
    let other = stated.words(0x1201, &[1; 6]).words(0x1102, &[5, 0, 16]);
    refused(other, "GreenPaletteColorLookupTableDescriptor", "[5, 0, 16]", "as for red");
    refused(slice().number(0x28, 0x10, 0), "Rows", "0", "at least 1");
    refused(slice().number(0x28, 0x10, 3), "PixelData", "12 bytes", "18 bytes");
    refused(slice().number(0x28, 0x10, 1), "PixelData", "12 bytes", "6 bytes");
    refused(slice().number(0x28, 0x100, 12), "BitsAllocated", "12", "8, 16 or 32");
    refused(slice().number(0x28, 0x101, 17), "BitsStored", "17", "1 to 16");
    refused(slice().number(0x28, 0x102, 11), "HighBit", "11", "15, the highest of 16");
    let frames = Slice { samples: vec![0; 12], ..slice().with(FRAME_COUNT, "2") };
    refused(
        frames.with((0x3004, 0x0c), "0\\1\\2"),
        "GridFrameOffsetVector",
        "0\\\\1\\\\2",
        "finite numbers, 2 of them",
    );

    let folder = Folder::new();
    let open = |name: &str, text: &str, instead: &str| folder.open("a.dcm", &replaced(name, text, instead));
    let syntax =
        |result, found: &str, allowed: &str| assert_refused(result, "a.dcm", "TransferSyntaxUID", found, allowed);
    syntax(open("rle.dcm", "1.2.840.10008.1.2.5\0", "1.2.840.10008.1.2.9\0"), "1.2.9", ".5 (RLE)");
    syntax(open("jpeg-lossless.dcm", "1.2.4.70", "1.2.4.80"), "1.2.840.10008.1.2.4.80 (JPEG-LS)", ".4.70 (JPEG)");
    syntax(open("jpeg-lossless.dcm", "1.2.4.70", "1.2.4.81"), "1.2.840.10008.1.2.4.81 (JPEG-LS)", ".4.91 (JPEG 2000)");
    let deflated = open("jpeg-lossless.dcm", "1.2.4.70", "1.2.1.99");
    assert_refused(deflated, "a.dcm", "elements", "deflate", "an undamaged deflated stream");
    let floats = open("float.dcm", "MONOCHROME2", "MONOCHROME1");
    assert_refused(
        floats,
        "a.dcm",
        "PhotometricInterpretation",
        "MONOCHROME1",
        "MONOCHROME1 or PALETTE COLOR for whole numbers",
    );
    assert_refused(open("rle.dcm", "1.2.5\0", "1.2.1\0"), "a.dcm", "PixelData", "fragments", "bare samples");
    assert_refused(open("frames.dcm", "DICM", "DICN"), "a.dcm", "magic", "DICN", "DICM after 128 bytes");
    assert_refused(open("frames.dcm", "1.2.1\0", "1.2.5\0"), "a.dcm", "PixelData", "bare samples", "frames as the");
}

/// Damaged frames, and frames that contradict the file's elements.
#[test]
fn wrong_frames() {
    let folder = Folder::new();
    let open = |name: &str, text: &str, instead: &str| folder.open("a.dcm", &replaced(name, text, instead));
    let columns = |count: u8| ["\x28\0\x11\0US\x02\0", &char::from(count).to_string(), "\0"].concat();
    let allowed = "a frame of 6 × 4 uint16";
    let rle = open("rle.dcm", &columns(5), &columns(6));
    assert_refused(rle, "a.dcm", "PixelData", "20 samples in a segment, not 24", allowed);
    let jpeg = open("jpeg-lossless.dcm", &columns(5), &columns(6));
    assert_refused(jpeg, "a.dcm", "PixelData", "5 × 4 samples of 2 bytes", allowed);
    let jpeg_2000 = open("jpeg2000.dcm", &columns(5), &columns(6));
    assert_refused(jpeg_2000, "a.dcm", "PixelData", "5 × 4 samples", allowed);
    let siz = "\0\x01\x0f\x01\x01";
    let colours = open("jpeg2000.dcm", siz, "\0\x03\x0f\x01\x01");
    assert_refused(colours, "a.dcm", "PixelData", "several components", "a frame of 5 × 4 uint16");
    let deep = open("jpeg2000.dcm", siz, "\0\x01\x10\x01\x01");
    assert_refused(deep, "a.dcm", "PixelData", "samples of 17 bits", "a frame of 5 × 4 uint16");
}

#[test]
fn damage() {
    for name in FRAMES.map(|(name, _)| name).into_iter().chain(["series/IM2"]) {
        let name_of_copy = name.rsplit('/').next().unwrap();
        let whole = fs::read(fixture(name)).unwrap();
        let folder = Folder::new();
        let values = Volume::open(&fixture(name)).unwrap().values().to_vec();
        for length in 0..whole.len() {
            if let Ok(volume) = folder.open(name_of_copy, &whole[..length]) {
                assert_eq!(volume.values(), values, "{name}: {length} bytes");
            }
        }
        assert_eq!(folder.open(name_of_copy, &[&whole[..], b"padding"].concat()).unwrap().values(), values, "{name}");
    }
}

/// Lengths of 4 GiB, and endlessly nested sequences.
#[test]
fn lies_cost_nothing() {
    let folder = Folder::new();
    let head = [&[0; 128], &b"DICM\x02\0\x10\0UI\x14\x001.2.840.10008.1.2.1\0"[..]].concat();
    let long = [&head[..], b"\x08\0\0\0UT\0\0\xfe\xff\xff\xff"].concat();
    assert_refused(folder.open("a.dcm", &long), "a.dcm", "element (0008,0000)", "4294967294 bytes", "at most the 0");
    let nested = b"\x08\0\x11\x11SQ\0\0\xff\xff\xff\xff\xfe\xff\0\xe0\xff\xff\xff\xff".repeat(100_000);
    let nested = [&head[..], &nested].concat();
    assert_refused(folder.open("a.dcm", &nested), "a.dcm", "elements", "sequences nested deeper", "at most 32 levels");
}
