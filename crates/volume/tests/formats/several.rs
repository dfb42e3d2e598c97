//! Files of several channels and times, as other programs write them.

use sheetsplat_volume::{Labels, ReadOptions};

use crate::*;

/// The values of a channel at a time.
fn values_of(channel: u32, time: u32) -> Vec<f32> {
    values().iter().map(|value| value + 1000.0 * channel as f32 + 10000.0 * time as f32).collect()
}

fn path(name: &str) -> PathBuf {
    fixture("channels").join(name)
}

/// Compares every voxel of what is read.
#[track_caller]
fn assert_holds(volume: &Volume, channels: std::ops::Range<u32>, time: u32, name: &str) {
    assert_eq!(volume.channels().count(), channels.len(), "{name}");
    for (volume, channel) in volume.channels().zip(channels) {
        assert_eq!((volume.dims(), volume.values()), (DIMS, (&values_of(channel, time)).into()), "{name} {channel}");
    }
}

/// Files, and how many channels and times they hold.
const FILES: [(&str, u32, u32); 23] = [
    ("channels.npy", 2, 1),
    ("both.npy", 2, 3),
    ("vectors.nrrd", 2, 1),
    ("list.nrrd", 2, 1),
    ("times.nrrd", 1, 3),
    ("itk.nrrd", 2, 1),
    ("itk.nii", 2, 1),
    ("itk.mha", 2, 1),
    ("times.nii", 1, 3),
    ("vectors.nii.gz", 2, 1),
    ("vectors.vti", 2, 1),
    ("vectors-zlib.vti", 2, 1),
    ("imagej.tif", 2, 3),
    ("imagej-large.tif", 2, 3),
    ("ome-tczyx.tif", 2, 3),
    ("ome-tzcyx.tif", 2, 3),
    ("frames.mgz", 1, 3),
    ("times.mha", 1, 3),
    ("times-zlib.mha", 1, 3),
    ("analyze.hdr", 1, 3),
    ("analyze.img", 1, 3),
    ("single-first.nrrd", 1, 3),
    ("single-fourth.nrrd", 2, 1),
];

#[test]
fn all_channels_of_the_first_time() {
    for (name, channels, times) in FILES.into_iter().chain([("ome-ctzyx.tif", 2, 3)]) {
        let volume = Volume::open(&path(name)).unwrap_or_else(|error| panic!("{error}"));
        assert_holds(&volume, 0..channels, 0, name);
        let encoding = volume.encoding().unwrap();
        assert_eq!((encoding.channels, encoding.times), (channels, times), "{name}");
        if ["nrrd", "nii", "mha", "mgz", "analyze"].iter().any(|part| name.contains(part)) {
            volume.channels().for_each(|channel| assert_near(channel.spacing(), SPACING));
        }
        if name.starts_with("ome") {
            let names: Vec<_> = volume.channels().map(|channel| channel.channel_name().unwrap()).collect();
            assert_eq!(names, ["nuclei", "membranes"]);
        }
    }
}

#[test]
fn one_channel_at_one_time() {
    for (name, channels, times) in FILES {
        for (channel, time) in (0..channels).flat_map(|channel| (0..times).map(move |time| (channel, time))) {
            let options = ReadOptions::default().with_channel(channel).with_time(time);
            let volume = Volume::open_with(&path(name), &options).unwrap();
            assert_holds(&volume, channel..channel + 1, time, name);
        }
        let last = ReadOptions::default().with_time(times - 1);
        assert_holds(&Volume::open_with(&path(name), &last).unwrap(), 0..channels, times - 1, name);
    }
}

#[test]
fn what_a_file_does_not_hold_is_refused() {
    for (name, channels, times) in FILES {
        let refused = |options: &ReadOptions| Volume::open_with(&path(name), options).unwrap_err().to_string();
        let message = refused(&ReadOptions::default().with_channel(channels));
        let allowed = if channels == 1 { "0, the only one".to_owned() } else { "0 to 1".to_owned() };
        assert!(message.ends_with(&format!("channel: found {channels}, allowed: {allowed}")), "{message}");
        let message = refused(&ReadOptions::default().with_time(times));
        assert!(message.contains(&format!("time: found {times}, allowed: 0")), "{message}");
        if channels > 1 {
            let message = Labels::open(&path(name)).unwrap_err().to_string();
            assert!(message.contains("channels: found 2, allowed: one"), "{message}");
        }
    }
    let single = ReadOptions::default().with_channel(1);
    let message = Volume::open_with(&fixture("c.npy"), &single).unwrap_err().to_string();
    assert!(message.contains("channel: found 1, allowed: 0, the only one"), "{message}");
}

/// An axis of one sample is left out; without one, five axes are refused.
#[test]
fn five_axes_of_nrrd() {
    let whole = fs::read(path("single-first.nrrd")).unwrap();
    let text = String::from_utf8_lossy(&whole).into_owned();
    let with = |from: &str, to: &str| {
        let at = whole.windows(from.len()).position(|window| window == from.as_bytes()).unwrap();
        let file = [&whole[..at], to.as_bytes(), &whole[at + from.len()..]].concat();
        Folder::new().open("a.nrrd", &file)
    };
    assert!(text.contains("sizes: 1 5 4 3 3"));
    assert_refused(with("1 5 4 3 3", "2 5 4 3 3"), "a.nrrd", "sizes", "[2, 5, 4, 3, 3]", "five of which one is 1");
    assert_refused(with("1 5 4 3 3", "1 5 4 3"), "a.nrrd", "sizes", "1 5 4 3", "5 positive integers");
    assert_refused(
        with("none (0.5", "(1,0,0) (0.5").map(drop).and(with("(0,0,3) none", "(0,0,3) (0,0,1)")),
        "a.nrrd",
        "space directions",
        "(0,0,1)",
        "three vectors",
    );
    // Of several axes of one sample that which is not in space is left out, and of others the last.
    let flat = with("1 5 4 3 3", "1 5 12 1 3").unwrap();
    assert_eq!((flat.dims(), flat.encoding().unwrap().times), (UVec3::new(5, 12, 1), 3));
}

/// Analyze 7.5 has no magic, no orientation, and millimetres.
#[test]
fn analyze_of_nibabel() {
    let (volume, warnings) = warned(|| Volume::open(&path("analyze.hdr")).unwrap());
    assert_eq!((volume.orientation(), volume.unit(), volume.spacing()), (None, Some("mm"), SPACING));
    assert!(warnings.iter().any(|warning| warning.contains("Analyze 7.5")), "{warnings:?}");
    // SPM's factor at 112 is the slope, as nibabel reads it.
    let folder = Folder::new();
    let (mut header, data) = (fs::read(path("analyze.hdr")).unwrap(), fs::read(path("analyze.img")).unwrap());
    header[112..116].copy_from_slice(&0.5_f32.to_le_bytes());
    folder.write("a.img", &[&data]);
    let halves: Vec<f32> = values().iter().map(|value| 0.5 * value).collect();
    assert_eq!(folder.open("a.hdr", &header).unwrap().values(), halves);
    folder.write("a.img", &[&data[1..]]);
    assert_refused(folder.open("a.hdr", &header), "a.img", "data", "719 bytes", "720 bytes (3 volumes of 60 samples)");
    // A single file without the magic is nothing.
    assert_refused(folder.open("a.nii", &header), "a.nii", "magic", "\\xff", "n+1 or ni1");
}

#[test]
fn times_and_memory() {
    let (volume, warnings) = warned(|| Volume::open(&path("times.nii")).unwrap());
    assert_eq!(volume.encoding().unwrap().times, 3);
    assert!(warnings.iter().any(|warning| warning.contains("3 times: the first is read")), "{warnings:?}");
    // Only what is read takes memory: 60 values of 2 bytes for each channel.
    let open = |options: ReadOptions| Volume::open_with(&path("both.npy"), &options);
    assert!(open(ReadOptions::default().with_memory(240)).is_ok());
    assert!(open(ReadOptions::default().with_memory(239)).is_err());
    assert!(open(ReadOptions::default().with_memory(120).with_channel(1)).is_ok());
}

#[test]
fn damaged_headers() {
    let folder = Folder::new();
    let text = |sizes: &str, kinds: &str| {
        format!("NRRD0004\ntype: uint8\ndimension: 4\nsizes: {sizes}\nkinds: {kinds}\nencoding: raw\n\n")
    };
    let open = |text: String, count: usize| folder.open("a.nrrd", &[text.into_bytes(), vec![7; count]].concat());
    assert_eq!(open(text("2 1 2 1", "list domain domain domain"), 4).unwrap().channels().count(), 2);
    for (sizes, kinds, count, expected) in [
        ("2 1 2 1", "domain list domain domain", 4, "kinds: found axis 1 of four"),
        ("65 1 2 1", "vector domain domain domain", 130, "sizes: found 65 channels, allowed: at most 64"),
        ("2 0 2 1", "vector domain domain domain", 0, "sizes: found"),
        ("2 1 2", "vector domain domain", 4, "sizes: found"),
        ("2 1 2 1", "vector domain domain domain", 3, "data: found 3 bytes"),
        ("1 2 1 2", "domain domain domain time", 5, "data: found 5 bytes"),
    ] {
        let message = open(text(sizes, kinds), count).unwrap_err().to_string();
        assert!(message.contains(expected), "{message}\n{expected}");
    }
    for (shape, expected) in
        [("(65, 1, 1, 1)", "shape: found"), ("(0, 1, 1, 1)", "shape: found"), ("(1, 1, 1, 1, 1, 1)", "shape: found")]
    {
        let header = format!("{{'descr': '|u1', 'fortran_order': False, 'shape': {shape}, }}\n");
        let bytes =
            [b"\x93NUMPY\x01\x00", &(header.len() as u16).to_le_bytes()[..], header.as_bytes(), &[7; 65]].concat();
        let message = folder.open("a.npy", &bytes).unwrap_err().to_string();
        assert!(message.contains(expected), "{message}");
    }
}

/// The colours and the window of every channel.
fn displays(name: &str) -> Vec<(Vec<DVec3>, Option<[f64; 2]>)> {
    let volume = Volume::open(&path(name)).unwrap_or_else(|error| panic!("{error}"));
    let of = |channel: &Volume| {
        channel.display().map(|display| (display.colors.clone(), display.window)).unwrap_or_default()
    };
    volume.channels().map(of).collect()
}

#[test]
fn colours_and_windows_of_channels() {
    assert_eq!(displays("ome-colors.tif"), [(vec![DVec3::X], None), (vec![DVec3::Y], None)]);
    for name in ["imagej-luts.tif", "imagej-luts-little.tif"] {
        let [first, second] = displays(name).try_into().unwrap();
        assert_eq!(first, (vec![DVec3::new(0.0, 1.0, 1.0)], Some([10.0, 200.0])), "{name}");
        assert_eq!(second.1, Some([1020.0, 1210.0]), "{name}");
        for (at, color) in second.0.iter().enumerate() {
            let share = (at * 255 / 16) as f64 / 255.0;
            let expected = DVec3::new(share, 1.0 - share, 0.2);
            assert!((*color - expected).abs().max_element() < 1e-9, "{name}, {at}: {color}");
        }
        assert_eq!(second.0.len(), 17, "{name}");
    }
    assert_eq!(displays("imagej-window.tif"), [(vec![], Some([20.0, 180.0]))]);
    // Nothing is stated.
    assert_eq!(displays("ome-tczyx.tif"), [(vec![], None), (vec![], None)]);
    let second = Volume::open_with(&path("imagej-luts.tif"), &ReadOptions::default().with_channel(1)).unwrap();
    assert_eq!(second.display().unwrap().window, Some([1020.0, 1210.0]));
}

#[test]
fn damaged_displays_are_left_out() {
    let folder = Folder::new();
    let mut bytes = std::fs::read(path("imagej-luts.tif")).unwrap();
    let at = bytes.windows(4).position(|bytes| bytes == b"IJIJ").unwrap();
    bytes[at] = b'X';
    let (volume, warnings) = warned(|| folder.open("a.tif", &bytes).unwrap());
    assert!(volume.channels().all(|channel| channel.display().is_none()));
    assert!(warnings.iter().any(|warning| warning.contains("IJMetadata is damaged")), "{warnings:?}");
}

/// An OME-TIFF file whose pages are described by other elements `TiffData`, which take the place of the first channel's description.
fn with_pages(name: &str, tiff_data: &str) -> Vec<u8> {
    let mut bytes = std::fs::read(path(name)).unwrap();
    let find = |text: &str, from: usize| {
        from + bytes[from..].windows(text.len()).position(|window| window == text.as_bytes()).unwrap()
    };
    let start = find("<Channel", 0);
    let end = find("/>", find("<TiffData", start)) + 2;
    let text = format!("{tiff_data}{}", "\n".repeat(end - start - tiff_data.len()));
    bytes[start..end].copy_from_slice(text.as_bytes());
    bytes
}

#[test]
fn pages_come_in_the_order_that_the_description_says() {
    let folder = Folder::new();
    // The second half of the pages shows the first half of the blocks of three slices, of which channels change first.
    let halves = "<TiffData IFD=\"9\" PlaneCount=\"9\"/><TiffData FirstC=\"1\" FirstT=\"1\" PlaneCount=\"9\"/>";
    let file = folder.0.path().join("a.tif");
    std::fs::write(&file, with_pages("ome-tczyx.tif", halves)).unwrap();
    for (channel, time) in (0..2).flat_map(|channel| (0..3).map(move |time| (channel, time))) {
        let options = ReadOptions::default().with_channel(channel).with_time(time);
        let volume = Volume::open_with(&file, &options).unwrap();
        let block = (channel + 2 * time + 3) % 6;
        assert_eq!(volume.values(), values_of(block % 2, block / 2), "{channel} {time}");
    }
    // Slices upside down.
    let turned =
        "<TiffData IFD=\"0\" FirstZ=\"2\"/><TiffData IFD=\"1\" FirstZ=\"1\"/><TiffData IFD=\"2\" FirstZ=\"0\"/>";
    std::fs::write(&file, with_pages("ome-tczyx.tif", turned)).unwrap();
    let volume = Volume::open(&file).unwrap();
    let slices: Vec<f32> = values().chunks(20).rev().flatten().copied().collect();
    assert_eq!(volume.values(), slices);
    assert_eq!(volume.channel(1).unwrap().values(), values_of(1, 0));
    for (tiff_data, field, found) in [
        ("<TiffData IFD=\"0\" FirstZ=\"3\"/>", "FirstZ, FirstC, FirstT", "3, 0, 0"),
        ("<TiffData IFD=\"0\" FirstC=\"2\"/>", "FirstZ, FirstC, FirstT", "0, 2, 0"),
        ("<TiffData IFD=\"x\"/>", "IFD", "x"),
        ("<TiffData IFD=\"0\" FirstZ=\"1\"/>", "TiffData", "a slice that is missing or comes twice"),
    ] {
        let result = folder.open("b.tif", &with_pages("ome-tczyx.tif", tiff_data));
        assert_refused(result, "b.tif", field, found, "");
    }
}
