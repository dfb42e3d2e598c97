//! Segmentations as highdicom writes and reads them: `highdicom.seg.segread(FILE).get_volume()`. The first, the fourth and the last of the scan's seven
//! slices lie in no segment, so that no frame names them.

use std::collections::BTreeMap;

use sheetsplat_volume::internals::Access;

use super::*;

/// The names of segments; a file of numbers names those outside all, too.
const NAMES: [&str; 4] = ["Background", "liver", "left kidney", "spleen"];
/// The colours of the segments as `CIELabColor.to_rgb` gives them, of 255.
const COLORS: [[f64; 3]; 4] = [[0.0; 3], [216.0, 101.0, 79.0], [128.0, 174.0, 128.0], [20.0, 30.0, 200.0]];
const SLICES: UVec3 = UVec3::new(5, 4, 5);

fn read(name: &str) -> Volume {
    Volume::open(&fixture(&format!("dicom/{name}.dcm"))).unwrap()
}

/// The values of the five slices from the second on, by places in the scan; the third of the five is empty.
fn expected(value: impl Fn(u32, u32, u32) -> f32) -> Vec<f32> {
    let at = |index: u32| (index % 5, index / 5 % 4, index / 20 + 1);
    (0..100).map(at).map(|(x, y, z)| if z == 3 { 0.0 } else { value(x, y, z) }).collect()
}

#[track_caller]
fn assert_lies_in_scan(volume: &Volume) {
    let axes = DMat3::from_diagonal(RAS_FROM_LPS) * rotation();
    let first = ORIGIN + rotation().z_axis * SPACING.z;
    assert_lies(volume, axes, RAS_FROM_LPS * first);
    assert_eq!((volume.dims(), volume.unit()), (SLICES, Some("mm")));
}

/// Asserts that a channel has the names and colours of some segments.
#[track_caller]
fn assert_legend(channel: &Volume, numbers: &[u16]) {
    let names: BTreeMap<u16, String> =
        numbers.iter().map(|&number| (number, NAMES[usize::from(number)].to_owned())).collect();
    assert_eq!(channel.label_names(), &names);
    let palette = channel.palette().unwrap();
    assert!(palette.iter().map(|(number, _)| *number).eq(numbers.iter().map(|&number| f64::from(number))));
    for &(number, color) in palette {
        let right = DVec3::from_array(COLORS[number as usize]);
        assert!((255.0 * color - right).abs().max_element() < 0.51, "{number}: {}", 255.0 * color);
    }
    assert!(channel.is_known_label_map());
}

/// Frames of 20 bits begin within bytes. Numbers are compressed by RLE.
#[test]
fn segments_are_labels() {
    for name in ["seg-binary", "seg-deflated", "seg-numbers"] {
        let (volume, warnings) = warned(|| read(name));
        assert_eq!(warnings, Vec::<String>::new(), "{name}");
        assert_lies_in_scan(&volume);
        assert_eq!(volume.values(), expected(|x, y, z| ((x + 2 * y + z) % 4) as f32), "{name}");
        assert_legend(&volume, if name == "seg-numbers" { &[0, 1, 2, 3] } else { &[1, 2, 3] });
        let labels = Labels::open(&fixture(&format!("dicom/{name}.dcm"))).unwrap();
        assert!(labels.values.iter().map(|&label| f32::from(label)).eq(volume.values().iter()), "{name}");
        assert_eq!(&labels.names, volume.label_names());
    }
}

/// The third segment overlaps the first one, as layers of `.seg.nrrd`.
#[test]
fn overlapping_segments_are_channels() {
    let volume = read("seg-overlapping");
    assert_lies_in_scan(&volume);
    let channels: Vec<&Volume> = volume.channels().collect();
    let [first, second] = channels.as_slice() else { panic!("{}", channels.len()) };
    assert_eq!(first.values(), expected(|x, _, _| [1.0, 1.0, 0.0, 2.0, 2.0][x as usize]));
    assert_eq!(second.values(), expected(|x, y, _| if x < 3 && y > 1 { 3.0 } else { 0.0 }));
    assert_legend(first, &[1, 2]);
    assert_legend(second, &[3]);
    let path = fixture("dicom/seg-overlapping.dcm");
    assert_refused(Labels::open(&path), "seg-overlapping.dcm", "channels", "2", "a label for every voxel");
    let labels = Labels::open_with(&path, &ReadOptions::default().with_channel(1)).unwrap();
    assert!(labels.values.iter().map(|&label| f32::from(label)).eq(second.values().iter()));
    assert_eq!(&labels.names, second.label_names());
    let third = Volume::open_with(&path, &ReadOptions::default().with_channel(2));
    assert_refused(third, "seg-overlapping.dcm", "channel", "2", "0 to 1");
}

#[test]
fn fractions_are_amounts() {
    let volume = read("seg-fractional");
    assert_lies_in_scan(&volume);
    let channels: Vec<&Volume> = volume.channels().collect();
    let [first, second] = channels.as_slice() else { panic!("{}", channels.len()) };
    let fraction = |number: u32| (f64::from(number) * (1.0 / 100.0)) as f32;
    assert_eq!(first.values(), expected(|x, y, z| fraction((x + 10 * y + 20 * z) % 101)));
    assert_eq!(second.values(), expected(|x, y, _| fraction(7 * x * y % 101)));
    assert_eq!([first, second].map(|channel| channel.channel_name()), [Some("liver"), Some("left kidney")]);
    assert!(!first.is_known_label_map() && first.label_names().is_empty());
    let labels = Labels::open_with(&fixture("dicom/seg-fractional.dcm"), &ReadOptions::default().with_channel(0));
    assert_refused(labels, "seg-fractional.dcm", "data", "0.2 at voxel", "whole numbers");
}

/// A segmentation beside its scan is a series of its own, whatever its number of frames.
#[test]
fn scans_come_before_their_segmentations() {
    let folder = Folder::new();
    for name in ["series/IM1", "series/IM2", "series/IM3.dcm", "dicom/seg-binary.dcm", "dicom/seg-overlapping.dcm"] {
        folder.write(name.split_once('/').unwrap().1, &[&fs::read(fixture(name)).unwrap()]);
    }
    let path = folder.write("x", &[]).parent().unwrap().to_owned();
    let (volume, warnings) = warned(|| Volume::open(&path).unwrap());
    assert_eq!(volume.dims(), DIMS);
    assert!(warnings.iter().any(|warning| warning.contains("3 series: ")), "{warnings:?}");
    let other = Volume::open_with(&path, &ReadOptions::default().with_series("1")).unwrap();
    assert_eq!((other.dims(), other.channels().count()), (SLICES, 2));
}

/// A segmentation of fewer slices takes its place in the scan.
#[test]
fn labels_of_segments_lie_in_the_scan() {
    let access = Access::new(&ReadOptions::default()).unwrap();
    let labels = fixture("dicom/seg-binary.dcm");
    let volume = open("series").with_labels_of(&labels, false, &access).unwrap();
    let at = |index: u32| (index % 5, index / 5 % 4, index / 20);
    let label = |(x, y, z)| if z == 0 { 0 } else { ((x + 2 * y + z) % 4) as u16 };
    assert!(volume.labels().unwrap().iter().copied().eq((0..60).map(at).map(label)));
    assert_eq!(volume.label_names()[&2], "left kidney");
    let [_, (2.0, color), _] = *volume.label_colors() else { panic!("{:?}", volume.label_colors()) };
    assert!((255.0 * color - DVec3::from_array(COLORS[2])).abs().max_element() < 0.51);
}

#[test]
fn what_is_refused() {
    let changed = |name: &str, text: &str, instead: &str| {
        let folder = Folder::new();
        folder.open("a.dcm", &replaced(&format!("dicom/{name}.dcm"), text, instead))
    };
    let allowed = "BINARY, FRACTIONAL or LABELMAP";
    assert_refused(changed("seg-binary", "BINARY", "BINERY"), "a.dcm", "SegmentationType", "BINERY", allowed);
    let place = "18.0\\-24.5\\38.0";
    let off = changed("seg-binary", place, "18.0\\-24.5\\39.0");
    assert_refused(off, "a.dcm", "ImagePositionPatient", "distances from", "slices at multiples of one distance");
    let far = changed("seg-binary", place, "18.0\\-24.5\\3e50");
    assert_refused(far, "a.dcm", "ImagePositionPatient", "mm in slices 3.0000 mm apart", "at most 65536 of them");
    // Segment 1 becomes another 2 in every frame.
    let number = |number: u8| -> Vec<u8> { [&b"\x62\0\x0b\0US\x02\0"[..], &[number, 0]].concat() };
    let mut twice = fs::read(fixture("dicom/seg-binary.dcm")).unwrap();
    for at in 0..twice.len() - 10 {
        if twice[at..].starts_with(&number(1)) {
            twice[at..at + 10].copy_from_slice(&number(2));
        }
    }
    let twice = Folder::new().open("a.dcm", &twice);
    assert_refused(
        twice,
        "a.dcm",
        "ImagePositionPatient",
        "the same for frames",
        "one frame of a segment in each slice",
    );
    let mut none = fs::read(fixture("dicom/seg-binary.dcm")).unwrap();
    let at = (0..none.len()).find(|&at| none[at..].starts_with(&number(1))).unwrap();
    none[at..at + 10].copy_from_slice(&number(0));
    let none = Folder::new().open("a.dcm", &none);
    assert_refused(none, "a.dcm", "ReferencedSegmentNumber", "0", "1 or more");
    let mut large = fs::read(fixture("dicom/seg-fractional.dcm")).unwrap();
    let at = (0..large.len()).find(|&at| large[at..].starts_with(b"\x62\0\x0e\0US\x02\0")).unwrap();
    large[at + 8] = 0;
    let large = Folder::new().open("a.dcm", &large);
    assert_refused(large, "a.dcm", "MaximumFractionalValue", "0", "1 or more");
}
