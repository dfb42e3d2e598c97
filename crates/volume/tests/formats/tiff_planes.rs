//! The pages of a TIFF file, by the descriptions of tifffile, Micro-Manager, MetaMorph and OME. The right values are those that tifffile reads.

use sheetsplat_volume::{Encoding, ReadOptions, SampleType};

use crate::*;

/// Opens a file of channels with value + 1000 channel + 10000 time, and returns the warnings.
#[track_caller]
fn read(name: &str, channels: u32, times: u32) -> Vec<String> {
    let path = fixture(&format!("channels/{name}"));
    let (volume, warnings) = warned(|| Volume::open(&path).unwrap_or_else(|error| panic!("{error}")));
    let encoding = volume.encoding().unwrap();
    assert_eq!((volume.dims(), encoding.channels, encoding.times), (DIMS, channels, times), "{name}");
    assert_eq!(volume.channels().count(), channels as usize, "{name}");
    for time in 0..times {
        let volume = Volume::open_with(&path, &ReadOptions::default().with_time(time)).unwrap();
        for (number, channel) in volume.channels().enumerate() {
            let more = 1000.0 * number as f32 + 10000.0 * time as f32;
            assert_eq!(channel.values(), values().iter().map(|value| value + more).collect::<Vec<_>>(), "{name}");
        }
    }
    warnings
}

#[test]
fn shapes_by_tifffile() {
    for name in ["shaped-czyx.tif", "shaped-truncated.tif"] {
        read(name, 2, 1);
    }
    let warnings = read("shaped-tzyx.tif", 1, 3);
    assert!(warnings.iter().any(|warning| warning.contains("3 times: the first is read")), "{warnings:?}");
    read("shaped-ztcyx.tif", 2, 2);
    let alone = open("channels/shaped-qyx.tif");
    assert_eq!((alone.channels().count(), alone.encoding().unwrap().times), (1, 1));
    // Two axes without names: the file does not say what they are.
    let (volume, warnings) = warned(|| Volume::open(&fixture("channels/shaped-unnamed.tif")).unwrap());
    assert_eq!(volume.dims(), DIMS.with_z(6));
    let words = "the shape [2, 3, 4, 5]: its planes are taken to be 6 slices";
    assert!(warnings.iter().any(|warning| warning.contains(words)), "{warnings:?}");
}

#[test]
fn shapes_that_do_not_fit() {
    let folder = Folder::new();
    let open = |text: &str, instead: &str| folder.open("a.tif", &replaced("channels/shaped-czyx.tif", text, instead));
    let fewer = open("[2, 3, 4, 5]", "[2, 2, 4, 5]");
    assert_refused(fewer, "a.tif", "pages", "6", "4, as the description says");
    let more = open("[2, 3, 4, 5]", "[9, 3, 4, 5]");
    assert_refused(more, "a.tif", "pages", "6", "27, as the description says");
    assert_refused(open("[2, 3, 4, 5]", "[2, 0, 4, 5]"), "a.tif", "shape", "[2, 0, 4, 5] CZYX", "none of them empty");
    // The shape of other pages, or none, says nothing.
    for instead in ["[2, 3, 5, 4]", "[2, 3, 4, x]", "[2, 3,-4, 5]", "[2, 3, 45  ]"] {
        assert_eq!(open("[2, 3, 4, 5]", instead).unwrap().dims().z, 6, "{instead}");
    }
    // Bytes behind the only page are its planes only where the description says so.
    let whole = replaced("channels/shaped-truncated.tif", "\"truncated\": true", "\"truncates\": true");
    assert_refused(folder.open("a.tif", &whole), "a.tif", "pages", "1", "6, as the description says");
    let short = fs::read(fixture("channels/shaped-truncated.tif")).unwrap();
    let short = folder.open("a.tif", &short[..short.len() - 1]);
    assert_refused(short, "a.tif", "data", "239 bytes", "240 bytes");
    let ome = replaced("channels/set-0.ome.tif", "UUID FileName=\"set-1.ome.tif\"", "UUID FileName=\"set-0.ome.tif\"");
    assert!(folder.open("a.tif", &ome).is_err());
}

#[test]
fn descriptions_by_micro_manager() {
    for (name, channels) in [("manager.tif", 1), ("manager-channels.tif", 2), ("manager-plain.tif", 1)] {
        read(name, channels, 1);
        assert_eq!(Volume::open(&fixture(&format!("channels/{name}"))).unwrap().spacing().z, 3.0, "{name}");
    }
    let flat = Volume::open(&fixture("channels/manager-flat.tif")).unwrap();
    assert_eq!((flat.dims(), flat.channels().count()), (DIMS.with_z(1), 2));
    // The first description decides.
    let volume = open("channels/two-descriptions.ome.tif");
    assert_eq!((volume.spacing(), volume.unit()), (SPACING, Some("µm")));
    let more = replaced("channels/manager.tif", "slices=3", "slices=4");
    assert_refused(Folder::new().open("a.tif", &more), "a.tif", "pages", "3", "4, as the description says");
}

#[test]
fn slices_of_one_page() {
    // MetaMorph: the tag UIC2 has a value for each plane, and the planes follow one another.
    let volume = open("channels/metamorph.tif");
    let expected = Encoding { format: "TIFF", sample_type: SampleType::U16, channels: 1, times: 1 };
    assert_eq!(volume.encoding(), Some(expected));
    // Slices in one page by the tag ImageDepth.
    let depth = Volume::open(&fixture("channels/depth.tif"));
    assert_refused(depth, "channels/depth.tif", "page 1", "inconsistent sizes", "grey or RGB pixels");
}

#[test]
fn sets_of_files() {
    read("set-0.ome.tif", 2, 1);
    let second = fixture("channels/set-1.ome.tif");
    // Either file describes the whole set.
    read("set-1.ome.tif", 2, 1);
    let folder = Folder::new();
    let first = fs::read(fixture("channels/set-0.ome.tif")).unwrap();
    let allowed = "all files of the set in one folder";
    let alone = folder.open("set-0.ome.tif", &first);
    assert_refused(alone, "set-0.ome.tif", "TiffData", "planes in 1 files that are missing: set-1.ome.tif", allowed);
    folder.write("set-1.ome.tif", &[&fs::read(second).unwrap()]);
    assert_eq!(folder.open("set-0.ome.tif", &first).unwrap().channels().count(), 2);
    // Another file in its place has no such pages.
    folder.write("set-1.ome.tif", &[&fs::read(fixture("channels/half.tif")).unwrap()]);
    assert!(folder.open("set-0.ome.tif", &first).is_err());
    let few = fs::read(fixture("slices/z8.tif")).unwrap();
    folder.write("set-1.ome.tif", &[&few]);
    assert!(folder.open("set-0.ome.tif", &first).is_err());
}

#[test]
fn numbers_of_16_bits_and_of_one() {
    for name in ["half.tif", "half-zlib.tif"] {
        let volume = open(&format!("channels/{name}"));
        assert_eq!(volume.encoding().unwrap().sample_type, SampleType::F16, "{name}");
    }
    for name in ["bits.tif", "bits-zlib.tif"] {
        let volume = Volume::open(&fixture(&format!("channels/{name}"))).unwrap();
        let expected: Vec<f32> = values().iter().map(|value| f32::from(value % 3.0 == 0.0)).collect();
        assert_eq!((volume.dims(), volume.values()), (DIMS, (&expected).into()), "{name}");
    }
}

/// Bits in the other order are refused: no decoder here turns them.
#[test]
fn the_lowest_bit_first() {
    // The tag SamplesPerPixel, 277, which may be missing, becomes FillOrder, 266; its neighbours stay in order for all that read it.
    let mut bytes = fs::read(fixture("channels/bits.tif")).unwrap();
    let first = u32::from_le_bytes(bytes[4..8].try_into().unwrap()) as usize;
    let entries = usize::from(bytes[first]);
    let at = (0..entries).map(|entry| first + 2 + 12 * entry).find(|&at| bytes[at..at + 2] == 277_u16.to_le_bytes());
    let at = at.unwrap();
    bytes[at..at + 2].copy_from_slice(&266_u16.to_le_bytes());
    assert_eq!(Folder::new().open("a.tif", &bytes).unwrap().dims(), DIMS);
    bytes[at + 8] = 2;
    assert_refused(Folder::new().open("a.tif", &bytes), "a.tif", "FillOrder", "2", "1: the highest bit comes first");
}

#[test]
fn planes_in_tiles() {
    let chunky = Volume::open(&fixture("channels/tiles-chunky.tif")).unwrap();
    assert_eq!(chunky.dims(), UVec3::new(37, 20, 6));
    for name in ["tiles-planar.tif", "tiles-planar-deflate.tif"] {
        let planar = Volume::open(&fixture(&format!("channels/{name}"))).unwrap();
        assert_eq!((planar.values(), planar.colors()), (chunky.values(), chunky.colors()), "{name}");
    }
}
