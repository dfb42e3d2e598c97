//! Folders of several series, images at one place, and files of frames without groups of elements.

use super::*;

const DESCRIPTION: (u16, u16) = (0x08, 0x103e);
const INSTANCE: (u16, u16) = (0x08, 0x18);
const NUMBER: (u16, u16) = (0x20, 0x13);
const SERIES_NUMBER: (u16, u16) = (0x20, 0x11);
const TEMPORAL_POSITION: (u16, u16) = (0x20, 0x100);
const ECHO: (u16, u16) = (0x18, 0x86);
const IMAGE_TYPE: (u16, u16) = (0x08, 0x08);
const RESCALE_TYPE: (u16, u16) = (0x28, 0x1054);

/// Slices at heights with further values of elements.
fn stack(places: &[f64], more: f64, elements: &[((u16, u16), &str)]) -> Vec<Slice> {
    let slice = |&z: &f64| {
        let mut slice = elements.iter().fold(Slice::at(z), |slice, &(element, text)| slice.with(element, text));
        slice.samples.iter_mut().for_each(|sample| *sample += more as u16);
        slice
    };
    places.iter().map(slice).collect()
}

/// The values of slices 2 mm apart.
fn expected(count: usize, more: f32) -> Vec<f32> {
    (0..6 * count).map(|i| (20 * (i / 6) + i % 6) as f32 + more).collect()
}

/// Series are those that GDCM's `GetSeriesIDs` lists; a page without a place, a scout in the same series, and another series.
#[test]
fn the_largest_series_is_read() {
    let mut slices = at(&[0.0, 2.0, 4.0]);
    slices.extend(stack(&[0.0, 1.0], 500.0, &[(SERIES, "1.2.4"), (DESCRIPTION, "legs"), (SERIES_NUMBER, "7")]));
    slices.push(Slice::at(9.0).with(SERIES, "1.2.5").with(POSITION, "").with(DESCRIPTION, "page"));
    slices.push(Slice::at(2.0).with(ORIENTATION, "0\\1\\0\\0\\0\\1").with(PIXEL_SPACING, "1\\2"));
    slices.push(Slice::at(2.0).number(0x28, 0x10, 3).number(0x28, 0x11, 2).with(POSITION, ""));
    let (volume, warnings) = warned(|| series(&slices).unwrap());
    let listed = [
        "0: 2 of 3 × 2, CT legs (1.2.4)",
        "1: 3 of 3 × 2, 0.5 × 0.5 mm, along [1, 0, 0] and [0, 1, 0], CT a chest (1.2.3)",
        "2: 1 of 3 × 2, 2 × 1 mm, along [0, 1, 0] and [0, 0, 1], CT a chest (1.2.3)",
        "3: 1 unreadable, CT page (1.2.5)",
    ];
    assert_eq!((volume.values(), volume.series_names()), ((&expected(3, 0.0)).into(), &listed.map(str::to_owned)[..]));
    let [first, second] = warnings.as_slice() else { panic!("{warnings:?}") };
    assert!(
        first.contains(&format!("4 series: {}: 1, the largest, is read, and another by --series", listed.join(", ")))
    );
    assert!(second.contains("1 images without ImagePositionPatient are left out: 7"), "{second}");

    let chosen = |name: &str| series_with(&slices, &ReadOptions::default().with_series(name));
    for name in ["0", "1.2.4"] {
        let (volume, warnings) = warned(|| chosen(name).unwrap());
        assert_eq!((volume.spacing().z, volume.values().at(0)), (1.0, 500.0));
        assert_eq!(warnings, Vec::<String>::new());
    }
    assert_eq!(chosen("1.2.3").unwrap().dims().z, 3);
    assert_near(chosen("2").unwrap().spacing(), DVec3::new(2.0, 1.0, 2.0));
    assert_refused(chosen("3"), "5", "ImagePositionPatient", "no such element", "position in the patient");
    assert_refused(chosen("4"), "series", "series", "4", "a number or a SeriesInstanceUID of 0: 2 of 3 × 2, CT legs");
    assert_refused(chosen("1.2"), "series", "series", "1.2", "SeriesInstanceUID");
}

/// A slice that the volume would lack is no odd file.
#[test]
fn damaged_slices_are_errors() {
    let mut slices = at(&[0.0, 2.0, 4.0]);
    slices[1] = Slice::at(2.0).number(0x28, 0x10, 9);
    assert_refused(series(&slices), "1", "PixelData", "12 bytes", "54 bytes");
}

#[test]
fn images_at_one_place_are_times() {
    let mut slices = stack(&[0.0, 2.0, 4.0], 1000.0, &[(TEMPORAL_POSITION, "10")]);
    slices.extend(stack(&[0.0, 2.0, 4.0], 0.0, &[(TEMPORAL_POSITION, "9")]));
    let (volume, warnings) = warned(|| series(&slices).unwrap());
    assert_warned(&warnings, "2 times: the first is read");
    assert_eq!(volume.time_names(), ["TemporalPositionIdentifier 9", "TemporalPositionIdentifier 10"]);
    assert_eq!((volume.encoding().unwrap().times, volume.values()), (2, (&expected(3, 0.0)).into()));
    let second = series_with(&slices, &ReadOptions::default().with_time(1)).unwrap();
    assert_eq!((second.dims().z, second.values()), (3, (&expected(3, 1000.0)).into()));
    let third = series_with(&slices, &ReadOptions::default().with_time(2));
    assert_refused(third, "series", "time", "2", "0 to 1");
    // Without any element that tells them apart: in the order of their numbers, which differ from place to place.
    let mut slices = Vec::new();
    for (at, z) in [0.0, 2.0, 4.0].into_iter().enumerate() {
        for (time, more) in [(0, 0.0), (1, 1000.0)] {
            slices.extend(stack(&[z], more, &[(NUMBER, &(10 + 2 * at + time).to_string())]));
        }
    }
    slices.reverse();
    let second = series_with(&slices, &ReadOptions::default().with_time(1)).unwrap();
    assert_eq!(second.values(), expected(3, 1000.0));
    // A time that lacks a slice is left out; without one that is whole there is no volume.
    slices.extend(stack(&[0.0], 5.0, &[(NUMBER, "90")]));
    assert_refused(series(&slices), "series", "ImagePositionPatient", "3 images at one place", "equally many");
    let mut slices = stack(&[0.0, 2.0, 4.0], 0.0, &[(TEMPORAL_POSITION, "1")]);
    slices.extend(stack(&[0.0, 2.0], 9.0, &[(TEMPORAL_POSITION, "2")]));
    let (volume, warnings) = warned(|| series(&slices).unwrap());
    assert_warned(&warnings, "1 of 2 volumes, told apart by TemporalPositionIdentifier, lack slices and are left out");
    assert_eq!((volume.encoding().unwrap().times, volume.values()), (1, (&expected(3, 0.0)).into()));
}

#[test]
fn echoes_and_types_are_channels() {
    let mut slices = Vec::new();
    for (time, echo, kind) in (0..8).map(|at| (at & 1, at >> 1 & 1, at >> 2)) {
        let kinds = ["ORIGINAL\\PRIMARY\\M", "ORIGINAL\\PRIMARY\\P"];
        let (echo_name, time_name) = ((echo + 1).to_string(), (time + 1).to_string());
        let elements = [(ECHO, &*echo_name), (IMAGE_TYPE, kinds[kind]), (TEMPORAL_POSITION, &*time_name)];
        let more = 1000 * time + 2000 * (2 * echo + kind);
        slices.extend(stack(&[0.0, 2.0], more as f64, &elements));
    }
    for time in 0..2 {
        let volume = series_with(&slices, &ReadOptions::default().with_time(time)).unwrap();
        assert_eq!(volume.channels().count(), 4);
        for (channel, at) in volume.channels().zip(0_u8..) {
            let more = 1000.0 * time as f32 + 2000.0 * f32::from(at);
            assert_eq!(channel.values(), expected(2, more));
        }
        let names: Vec<_> = volume.channels().map(|channel| channel.channel_name().unwrap().to_owned()).collect();
        assert_eq!(names[1], "EchoNumbers 1, ImageType ORIGINAL\\PRIMARY\\P");
        let one = ReadOptions::default().with_time(time).with_channel(2);
        let one = series_with(&slices, &one).unwrap();
        assert_eq!(one.values(), volume.channels().nth(2).unwrap().values());
        assert_eq!(one.channel_name(), Some(names[2].as_str()));
    }
}

#[test]
fn images_that_are_there_twice_are_left_out() {
    // The same identity, or no identity and the same samples.
    for instance in ["1.2.3.4", ""] {
        let mut slices = stack(&[0.0, 2.0, 4.0], 0.0, &[(NUMBER, "1")]);
        for (at, slice) in slices.iter_mut().enumerate() {
            let own = if instance.is_empty() { String::new() } else { format!("{instance}.{at}") };
            *slice = slice.clone().with(INSTANCE, &own);
        }
        slices.extend(slices.clone());
        let (volume, warnings) = warned(|| series(&slices).unwrap());
        assert_warned(&warnings, "3 images are there twice and are left out: 3, 4, 5");
        assert_eq!((volume.encoding().unwrap().times, volume.values()), (1, (&expected(3, 0.0)).into()));
    }
    // An identity that every image of a careless program has.
    let times = [0.0, 1000.0].map(|more| {
        let time = if more > 0.0 { "2" } else { "1" };
        stack(&[0.0, 2.0], more, &[(INSTANCE, "1.2"), (TEMPORAL_POSITION, time)])
    });
    assert_eq!(series(&times.concat()).unwrap().encoding().unwrap().times, 2);
}

/// Temporal and diffusion-weighted enhanced files of pydicom.
#[test]
fn frames_of_several_times() {
    for (name, times) in [
        ("dicom/times.dcm", ["TemporalPositionIndex 1", "TemporalPositionIndex 2"]),
        ("dicom/b-values.dcm", ["DiffusionBValue 0", "DiffusionBValue 1000"]),
    ] {
        let volume = open(name);
        assert_lies_as_written(&volume);
        assert_eq!(volume.time_names(), times);
        let second = Volume::open_with(&fixture(name), &ReadOptions::default().with_time(1)).unwrap();
        assert!(second.values().iter().eq(values().iter().map(|value| value + 10000.0)), "{name}");
    }
}

/// Classic files of several frames, as GDCM (by SimpleITK, see `make.py`) and PS3.3 place them.
#[test]
fn classic_frames() {
    assert_lies_as_written(&open("dicom/dose.dcm"));
    let (volume, warnings) = warned(|| open("dicom/nuclear.dcm"));
    assert_warned(&warnings, "2 times: the first is read");
    assert_lies_as_written(&volume);
    assert_eq!(volume.time_names(), ["TimeSlotVector 1", "TimeSlotVector 2"]);
    let (volume, warnings) = warned(|| open("dicom/run.dcm"));
    assert_warned(&warnings, "no ImagePositionPatient: frames are taken to be stacked 1 apart");
    assert_eq!((volume.spacing(), volume.orientation()), (SPACING.with_z(1.0), None));

    let folder = Folder::new();
    let whole = fs::read(fixture("dicom/nuclear.dcm")).unwrap();
    let at = whole.windows(12).position(|bytes| bytes == [1, 0, 2, 0, 3, 0, 1, 0, 2, 0, 3, 0]).unwrap();
    let mut wrong = whole.clone();
    wrong[at] = 0;
    assert_refused(folder.open("a.dcm", &wrong), "a.dcm", "SliceVector", "6 numbers", "from 1 on, one per frame");
    // The distance of an image that states its place, but not the distance of its frames.
    let frames = Slice { samples: (0..12).collect(), ..Slice::at(3.0).with(FRAME_COUNT, "2") };
    let frames = frames.with((0x18, 0x50), "4");
    let (volume, warnings) = warned(|| folder.open("a.dcm", &frames.bytes()).unwrap());
    assert_warned(
        &warnings,
        "no SpacingBetweenSlices and GridFrameOffsetVector: frames are taken to be stacked 4 apart",
    );
    assert_eq!((volume.spacing().z, volume.orientation().unwrap().origin.z), (4.0, 3.0));
    // Coordinates in the patient, of which the first is the image's own.
    let frames = Slice { samples: (0..12).collect(), ..Slice::at(3.0).with(FRAME_COUNT, "2") };
    let volume = folder.open("a.dcm", &frames.with((0x3004, 0x0c), "3\\0.5").bytes()).unwrap();
    assert_eq!((volume.spacing().z, volume.orientation().unwrap().origin.z), (2.5, 0.5));
    assert_eq!(volume.values().at(0), 6.0);
}

/// Values are those that `pydicom.pixels.apply_modality_lut` gives; and values in different units.
#[test]
fn values_are_in_the_files_unit() {
    let volume = Volume::open(&fixture("dicom/table.dcm")).unwrap();
    let expected = [[7.0, 7.0, 70.0, 700.0, 7000.0], [65535.0; 5], [65535.0; 5], [65535.0; 5]].concat();
    assert_eq!(volume.values(), expected);
    let mut slices = at(&[0.0, 2.0]);
    slices[0] = Slice::at(0.0).with(RESCALE_TYPE, "HU").with(SLOPE, "2");
    slices[1] = Slice::at(2.0).with(RESCALE_TYPE, "US");
    let (volume, warnings) = warned(|| series(&slices).unwrap());
    assert_warned(&warnings, "RescaleType: HU, US: values are not all in one unit");
    assert_eq!(volume.values(), [0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 20.0, 21.0, 22.0, 23.0, 24.0, 25.0]);
}

/// Gaps between slices of several times, and sheared ones.
#[test]
fn gaps_in_further_volumes() {
    let mut slices = stack(&[0.0, 2.0, 6.0], 0.0, &[(TEMPORAL_POSITION, "1")]);
    slices.extend(stack(&[0.0, 2.0, 6.0], 1000.0, &[(TEMPORAL_POSITION, "2")]));
    let second = series_with(&slices, &ReadOptions::default().with_time(1)).unwrap();
    assert_eq!((second.dims().z, second.values()), (4, (&expected(4, 1000.0)).into()));
    // Slices of a tilted gantry, a row of 0.5 mm for each 2 mm, of which the third is missing.
    let tilted = |places: &[f64]| -> Vec<Slice> {
        places.iter().map(|z| Slice::at(*z).with(POSITION, &format!("1\\{}\\{z}", 2.0 + z / 4.0))).collect()
    };
    let (volume, whole) = (series(&tilted(&[0.0, 2.0, 6.0])).unwrap(), series(&tilted(&[0.0, 2.0, 4.0, 6.0])).unwrap());
    assert_eq!(
        (volume.dims(), volume.spacing(), volume.orientation()),
        (whole.dims(), whole.spacing(), whole.orientation())
    );
    let is_same = |(a, b): (f32, f32)| a == b || a.is_nan() && b.is_nan();
    assert!(volume.values().iter().zip(whole.values().iter()).all(is_same));
}
