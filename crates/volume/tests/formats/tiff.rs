//! TIFF, as tifffile and ITK write it.

use sheetsplat_volume::{Encoding, Labels, SampleType};

use crate::*;

/// The position of a tag's entry, in a little-endian file with a single directory after the header.
fn entry(bytes: &[u8], tag: u16) -> usize {
    let u16_at = |at: usize| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
    let first = u32::from_le_bytes(bytes[4..8].try_into().unwrap()) as usize;
    let mut entries = (0..usize::from(u16_at(first))).map(|i| first + 2 + 12 * i);
    entries.find(|&at| u16_at(at) == tag).unwrap_or_else(|| panic!("no tag {tag}"))
}

/// A file with the values of some tags of the first page replaced.
fn with_tags(name: &str, tags: &[(u16, u32)]) -> Vec<u8> {
    let mut bytes = fs::read(fixture(name)).unwrap();
    for &(tag, value) in tags {
        let at = entry(&bytes, tag) + 8;
        bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
    }
    bytes
}

/// A file with some text replaced by text that is not longer.
fn with_text(name: &str, text: &str, instead: &str) -> Vec<u8> {
    replaced(name, text, &format!("{instead}{}", "\n".repeat(text.len() - instead.len())))
}

#[test]
fn of_tifffile() {
    use SampleType::{F32, F64, I32, U8, U16};
    for (name, sample_type) in [
        ("plain.tif", I32),
        ("zlib-big.tif", U16),
        ("lzw-bigtiff.tif", F64),
        ("tiled.tif", F32),
        ("packbits.tif", U8),
        ("white-is-zero.tif", U16),
        ("imagej.tif", U16),
        ("imagej-large.tif", F32),
        ("ome.tif", U16),
    ] {
        assert_eq!(
            open(name).encoding(),
            Some(Encoding { format: "TIFF", sample_type, channels: 1, times: 1 }),
            "{name}"
        );
    }
}

#[test]
fn of_itk() {
    assert_eq!(open("itk.tif").orientation(), None);
}

#[test]
fn spacing_and_unit() {
    for (name, spacing, unit) in [
        ("imagej.tif", SPACING, Some("µm")),
        ("imagej-large.tif", SPACING, Some("µm")),
        ("ome.tif", SPACING, Some("µm")),
        // 20 and 5 pixels per centimetre, with nothing about z.
        ("plain.tif", DVec3::new(0.5, 2.0, 0.5), Some("mm")),
        ("tiled.tif", DVec3::ONE, None),
    ] {
        let volume = open(name);
        assert_near(volume.spacing(), spacing);
        assert_eq!(volume.unit(), unit, "{name}");
    }
    let folder = Folder::new();
    let resolution = |unit: u32| folder.open("a.tif", &with_tags("plain.tif", &[(296, unit)])).unwrap();
    let inch = resolution(2);
    assert_eq!((inch.spacing(), inch.unit()), (DVec3::new(25.4 / 20.0, 25.4 / 5.0, 25.4 / 20.0), Some("mm")));
    let none = resolution(1);
    assert_eq!((none.spacing(), none.unit()), (DVec3::new(1.0, 4.0, 1.0), None));
}

#[test]
fn descriptions_by_image_j() {
    let folder = Folder::new();
    let open =
        |instead: &str| folder.open("a.tif", &with_text("imagej.tif", "mode=grayscale\nspacing=3\nunit=um", instead));
    let stepped_back = open("spacing=-3\nunit=m").unwrap();
    assert_eq!((stepped_back.spacing(), stepped_back.unit()), (SPACING, Some("m")));
    let one_apart = open("unit=cm").unwrap();
    assert_eq!((one_apart.spacing(), one_apart.unit()), (SPACING.with_z(1.0), Some("cm")));
    let no_unit = open("spacing=3\nunit=pixel").unwrap();
    assert_eq!((no_unit.spacing(), no_unit.unit()), (DVec3::new(0.5, 2.0, 3.0), None));
    // The values that ImageJ shows.
    let calibrated = open("cf=0\nc0=-32768\nc1=2\nunit=um").unwrap();
    assert!(calibrated.values().iter().zip(values()).all(|(found, value)| found == 2.0 * value - 32768.0));

    let refused = |instead: &str, field: &str, found: &str, allowed: &str| {
        assert_refused(open(instead), "a.tif", field, found, allowed);
    };
    refused("channels=2\nspacing=3\nunit=um", "slices, channels, frames", "3, 2, 1", "product is images");
    refused("frames=3\nspacing=3\nunit=um", "slices, channels, frames", "3, 1, 3", "product is images");
    let frames = folder.open("a.tif", &with_text("imagej.tif", "slices=3", "frames=3")).unwrap();
    assert_eq!((frames.values(), frames.spacing()), ((&values()).into(), SPACING));
    // Lengths are in the finest axis' unit. ImageJ reads a distance of 0 as 1.
    let (mixed, warnings) = warned(|| open("zunit=mm\nspacing=3\nunit=um").unwrap());
    assert_near(mixed.spacing(), SPACING.with_z(3000.0));
    assert_eq!(mixed.unit(), Some("µm"));
    assert_warned(&warnings, "unit, yunit, zunit: \"um\", \"um\", \"mm\": lengths are converted to µm");
    assert_eq!(open("spacing=0\nunit=um").unwrap().spacing(), SPACING.with_z(1.0));
    refused("spacing=x\nunit=um", "spacing", "x", "a finite number");
    refused("cf=0\nc0=-32768\nc1=x\nunit=um", "c1", "x", "a finite number");
    let fewer = folder.open("a.tif", &with_text("imagej.tif", "images=3", "images=4"));
    assert_refused(fewer, "a.tif", "pages", "3", "4, as the description says");
}

/// One directory followed by all slices, as ImageJ writes data too large for TIFF.
#[test]
fn slices_without_directories() {
    let folder = Folder::new();
    let whole = fs::read(fixture("imagej-large.tif")).unwrap();
    let short = folder.open("a.tif", &whole[..whole.len() - 1]);
    assert_refused(short, "a.tif", "data", "239 bytes", "240 bytes");
    let more = folder.open("a.tif", &with_text("imagej-large.tif", "images=3", "images=4"));
    assert_refused(more, "a.tif", "data", "240 bytes", "320 bytes");
    let none = folder.open("a.tif", &with_text("imagej-large.tif", "images=3", "images=0"));
    assert_refused(none, "a.tif", "images", "0", "a positive integer");
}

#[test]
fn descriptions_by_ome() {
    let folder = Folder::new();
    let open = |text: &str, instead: &str| folder.open("a.tif", &with_text("ome.tif", text, instead));
    let refused = |text: &str, instead: &str, field: &str, found: &str, allowed: &str| {
        assert_refused(open(text, instead), "a.tif", field, found, allowed);
    };
    refused("SizeC=\"1\"", "SizeC=\"2\"", "pages", "3", "6, as the description says");
    refused("SizeT=\"1\"", "SizeT=\"7\"", "pages", "3", "21, as the description says");
    refused("SizeC=\"1\"", "SizeC=\"9\"", "pages", "3", "27, as the description says");
    refused("SizeZ=\"3\"", "SizeZ=\"4\"", "pages", "3", "4, as the description says");
    refused("SizeX=\"0.5\"", "SizeX=\"-.5\"", "PhysicalSizeX", "-.5", "a positive finite number, or 0");
    // An axis without a size has the finest of the others. Lengths are in the finest axis' unit.
    let (open_x, warnings) = warned(|| open("SizeX=\"0.5\"", "SizeX=\"0.0\"").unwrap());
    assert_eq!((open_x.spacing(), open_x.unit()), (SPACING.with_x(2.0), Some("µm")));
    assert_warned(&warnings, "an axis without a spacing is taken to have 2");
    let (mixed, warnings) = warned(|| open("SizeZUnit=\"µm\"", "SizeZUnit=\"nm\"").unwrap());
    assert_near(mixed.spacing(), 1000.0 * SPACING.with_z(0.003));
    assert_eq!(mixed.unit(), Some("nm"));
    assert_warned(&warnings, "\"µm\", \"µm\", \"nm\": lengths are converted to nm");
    refused("IFD=\"0\"", "IFD=\"1\"", "TiffData", "a slice that is missing or comes twice", "every slice");
    refused("<Pixels ", "<Pixel_ ", "header", "", "well-formed XML");
    assert_eq!(open("PhysicalSizeX", "PhysicalSizeW").unwrap().spacing(), DVec3::ONE);
}

#[test]
fn slices_in_a_folder() {
    let volume = open("slices");
    assert_eq!((volume.spacing(), volume.unit()), (DVec3::ONE, None));
    let labels = Labels::open(&fixture("slices")).unwrap();
    assert!(labels.values.iter().map(|&label| f32::from(label)).eq(values()));

    let folder = Folder::new();
    let path = folder.0.path();
    let copy = |from: &str, to: &str| _ = fs::copy(fixture(from), path.join(to)).unwrap();
    let refused = |found: &str, allowed: &str| {
        let file = path.file_name().unwrap().to_str().unwrap().to_owned();
        assert_refused(Volume::open(path), &file, "slices", found, allowed);
    };
    let empty = Volume::open(path);
    assert_refused(empty, path.to_str().unwrap(), "folder", "0 files, no slices among them", "TIFF");
    for z in 8..11 {
        copy(&format!("slices/z{z}.tif"), &format!("{z:03}.tif"));
    }
    fs::write(path.join("notes.txt"), "no slice").unwrap();
    fs::create_dir(path.join("more")).unwrap();
    assert_eq!(Volume::open(path).unwrap().values(), values());

    copy("slices/z8.tif", "overview.tif");
    refused("3 of #.tif, 1 of overview.tif", "names that differ in one number");
    fs::remove_file(path.join("overview.tif")).unwrap();
    for c in 1..3 {
        copy("slices/z8.tif", &format!("c{c}z1.tif"));
        copy("slices/z8.tif", &format!("c{c}z2.tif"));
    }
    (8..11).for_each(|z| fs::remove_file(path.join(format!("{z:03}.tif"))).unwrap());
    refused("more than one number that changes in c#z#.tif", "names that differ in one number");
}

#[test]
fn slices_that_do_not_fit() {
    let folder = Folder::new();
    let path = folder.0.path();
    fs::write(path.join("1.tif"), fs::read(fixture("slices/z8.tif")).unwrap()).unwrap();
    fs::write(path.join("2.tif"), with_tags("slices/z8.tif", &[(257, 3)])).unwrap();
    let folder_name = path.to_str().unwrap();
    let found = "1 of 5 × 4 int16 (1.tif, …), 1 of 5 × 3 int16 (2.tif, …)";
    assert_refused(Volume::open(path), folder_name, "slices", found, "one size and type");
    fs::write(path.join("2.tif"), fs::read(fixture("plain.tif")).unwrap()).unwrap();
    assert_refused(Volume::open(path), "2.tif", "pages", "more than one", "one page per file in a folder of slices");
}

#[test]
fn wrong_pages() {
    let folder = Folder::new();
    let refused = |name: &str, tags: &[(u16, u32)], field: &str, found: &str, allowed: &str| {
        assert_refused(folder.open("a.tif", &with_tags(name, tags)), "a.tif", field, found, allowed);
    };
    let grey = "grey or RGB pixels";
    refused("plain.tif", &[(256, 0)], "page 1", "invalid dimensions", grey);
    refused("plain.tif", &[(257, 3)], "page 2", "5 × 4 int32", "5 × 3 int32, as the first page");
    refused("plain.tif", &[(258, 1)], "page 1", "Gray(1)", "an integer of 1 or 8 to 64 bits");
    refused("plain.tif", &[(259, 50000)], "page 1", "ZSTD", grey);
    refused("plain.tif", &[(262, 3)], "ColorMap", "0 numbers", "768 numbers, of 8-bit indices");
    refused("plain.tif", &[(277, 2)], "page 1", "Multiband", "one sample a pixel");
    refused("tiled.tif", &[(258, 16)], "page 2", "5 × 4 float32", "5 × 4 float16, as the first page");
    refused("plain.tif", &[(273, 1 << 20)], "page 1", "failed to fill whole buffer", grey);
    refused("plain.tif", &[(279, 79)], "page 1", "79 bytes for 80", "that holds its pixels");
    refused("plain.tif", &[(279, 1 << 20)], "page 1", "1048576 bytes of samples", "bytes that are left of the file");
    refused("plain.tif", &[(256, 1 << 31), (257, 1 << 31)], "page 1", "", "");
    refused("packbits.tif", &[(257, 1 << 20), (278, 1 << 20)], "page 1", "bytes for 5242880", "holds its pixels");
    refused("tiled.tif", &[(262, 0)], "PhotometricInterpretation", "WhiteIsZero", "BlackIsZero, for floats");
}

#[test]
fn thumbnails_are_no_slices() {
    open("thumbnail.tif");
}

#[test]
fn damage() {
    for name in ["plain.tif", "zlib-big.tif", "lzw-bigtiff.tif", "tiled.tif", "packbits.tif", "imagej.tif", "ome.tif"] {
        let whole = fs::read(fixture(name)).unwrap();
        let folder = Folder::new();
        for length in 0..whole.len() {
            // The missing end may contain nothing that counts.
            if let Ok(volume) = folder.open(name, &whole[..length]) {
                assert_eq!((volume.dims(), volume.values()), (DIMS, (&values()).into()), "{name}: {length} bytes");
            }
        }
        assert_eq!(folder.open(name, &[&whole[..], b"padding"].concat()).unwrap().values(), values(), "{name}");
    }
}

/// Value v is red v / 255, green 1 - v / 255 and blue 0.2.
#[test]
fn indices_of_a_palette_are_the_values() {
    for name in ["palette.tif", "palette-big.tif"] {
        let volume = open(name);
        assert_eq!(
            volume.encoding(),
            Some(Encoding { format: "TIFF", sample_type: SampleType::U8, channels: 1, times: 1 }),
            "{name}"
        );
        let palette = volume.palette().unwrap();
        assert_eq!(palette.len(), 256, "{name}");
        for (index, &(value, color)) in palette.iter().enumerate() {
            assert_eq!(value, index as f64, "{name}");
            let red = index as f64 / 255.0;
            assert!((color - DVec3::new(red, 1.0 - red, 0.2)).abs().max_element() < 1e-9, "{name}: {index} is {color}");
        }
    }
    assert_eq!(open("packbits.tif").palette(), None);
}

#[test]
fn other_palettes() {
    let folder = Folder::new();
    // A palette with another number of colours.
    let mut bytes = fs::read(fixture("palette.tif")).unwrap();
    let at = entry(&bytes, 320) + 4;
    bytes[at..at + 4].copy_from_slice(&48_u32.to_le_bytes());
    let allowed = "768 numbers, of 8-bit indices";
    assert_refused(folder.open("a.tif", &bytes), "a.tif", "ColorMap", "48 numbers", allowed);
    // 8-bit numbers where 16-bit ones are expected: blue is 51.
    let mut bytes = fs::read(fixture("palette.tif")).unwrap();
    let at = entry(&bytes, 320) + 8;
    let first = u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    for number in bytes[first..first + 2 * 768].chunks_mut(2) {
        number[1] = 0;
    }
    let volume = folder.open("a.tif", &bytes).unwrap();
    assert_eq!(volume.palette(), open("palette.tif").palette());
}

/// A name may contain the character that errors use for numbers.
#[test]
fn names_with_number_signs() {
    let folder = Folder::new();
    for name in ["a5#.tif", "a#1.tif"] {
        fs::copy(fixture("slices/z8.tif"), folder.0.path().join(name)).unwrap();
    }
    let name = folder.0.path().file_name().unwrap().to_str().unwrap();
    assert_refused(Volume::open(folder.0.path()), name, "slices", "1 of a##.tif, 1 of a##.tif", "differ in one number");
}
