//! Parts in files, and parts that do not belong together.

use std::path::Path;

use sheetsplat::headless::Backend;
use sheetsplat::image::ImageError;
use sheetsplat::part::{Extreme, MergeError};
use sheetsplat::settings::{Classification, Compositing, Order, Region};
use sheetsplat::volume::ReadOptions;
use sheetsplat::{Image, Part};

use crate::merging::{head, headless, parts};

/// A part's file under a name that is not used otherwise.
fn round_trip(part: &Part, extension: &str) -> Part {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("part").with_extension(extension);
    part.save(&path).unwrap();
    let opened = Part::open(&path).unwrap();
    assert_eq!(opened.name, path.display().to_string());
    Part { name: part.name.clone(), ..opened }
}

fn parts_of(compositing: Compositing, classification: Classification) -> Vec<Part> {
    let (volume, mut scene) = head(24, [37, 35]);
    scene.splatting.compositing = compositing;
    scene.splatting.classification = classification;
    parts(headless(Backend::Cpu), &volume, &scene, 2)
}

#[test]
fn files_hold_all_of_a_part() {
    for (compositing, classification) in [
        (Compositing::Linear, Classification::Before),
        (Compositing::Minimum, Classification::Before),
        (Compositing::Maximum, Classification::After),
        (Compositing::Average, Classification::After),
    ] {
        let parts = parts_of(compositing, classification);
        assert_eq!(parts.len(), 8);
        let has_extremes =
            |part: &Part| part.contents[0].extremes.iter().any(|extreme| extreme.counted >= Extreme::POINT);
        assert_eq!(parts.iter().all(has_extremes), classification == Classification::After);
        for part in &parts {
            for extension in ["exr", "npz"] {
                assert_eq!(round_trip(part, extension), *part);
            }
        }
        let opened: Vec<Part> = parts
            .iter()
            .zip(["exr", "npz"].iter().cycle())
            .map(|(part, extension)| round_trip(part, extension))
            .collect();
        assert_eq!(Image::merge(opened).unwrap(), Image::merge(parts).unwrap());
    }
}

/// A part can be looked at like any image: it lies at its place.
#[test]
fn a_part_is_also_an_image() {
    let part = parts_of(Compositing::Linear, Classification::Before).remove(0);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("part.exr");
    part.save(&path).unwrap();
    let image = Image::open(&path).unwrap();
    let shown = image.pixels.iter().filter(|pixel| pixel[3] > 0.0).count();
    assert_eq!(shown, part.contents[0].colors.iter().filter(|pixel| pixel[3] > 0.0).count());
}

fn refused(parts: impl IntoIterator<Item = Part>) -> String {
    Image::merge(parts).unwrap_err().to_string()
}

#[test]
fn gaps_and_overlaps_are_named() {
    let parts = parts_of(Compositing::Linear, Classification::Before);
    let without =
        |at: usize| parts.iter().enumerate().filter(move |(other, _)| *other != at).map(|(_, part)| part.clone());
    let all = &parts[0].identity.slabs;
    let (middle, region) = (parts[0].window.slabs.end, parts[0].window.region);
    let missing = |start: i32, end: i32| {
        format!(
            "parts: found none with slabs {start}..{end} of region {region}, allowed: parts that show the whole image"
        )
    };
    // At either end, and between.
    assert_eq!(refused(without(0)), missing(all.start, middle));
    assert_eq!(refused(without(1)), missing(middle, all.end));
    let mut gap = parts.clone();
    gap[1].window.slabs.start += 2;
    assert_eq!(refused(gap), missing(middle, middle + 2));
    // A whole region.
    let last = parts[6].window.region;
    let rest = parts[..6].to_vec();
    assert_eq!(
        refused(rest),
        format!("parts: found none with pixels of region {last}, allowed: parts that show the whole image")
    );
    assert!(matches!(Image::merge([]), Err(MergeError::Empty)));

    let (first, second) = (&parts[0].name, &parts[1].name);
    let mut overlap = parts.clone();
    overlap[1].window.slabs.start -= 3;
    let what = format!("slabs {}..{middle} of region {region}", middle - 3);
    let message = format!("{second}: found {what}, which {first} also shows, allowed: parts that do not overlap");
    assert_eq!(refused(overlap), message);
    let twice = parts.iter().chain([&parts[5]]).cloned();
    assert!(refused(twice).contains("also shows"));
    // Regions of which one reaches into the other.
    let mut wide = parts.clone();
    wide[0].window.region.width += 1;
    wide[0].contents[0].colors.extend(vec![[0.0; 4]; region.height as usize]);
    // It shares pixels with other slabs of its own region: nothing is shown twice, but the parts cannot be joined.
    let message = refused(wide.clone());
    assert!(
        message.contains(": region: found ") && message.contains("or a region that shares no pixels with it"),
        "{message}"
    );
    let shared = Region { x: region.x + region.width, y: region.y, width: 1, height: region.height };
    wide.retain(|part| part.window.region.x > region.x || part.window.region.width > region.width);
    let message = refused(wide);
    assert!(message.contains("also shows") && message.contains(&format!(" of region {shared}, ")), "{message}");
}

#[test]
fn parts_of_other_images_are_refused() {
    let parts = parts_of(Compositing::Linear, Classification::Before);
    let with = |change: &dyn Fn(&mut Part)| {
        let mut parts = parts.clone();
        change(&mut parts[3]);
        let message = refused(parts);
        assert!(message.contains("slabs") && message.contains(", as in "), "{message}");
        message
    };
    assert!(with(&|part| part.identity.order = Order::BackToFront).contains("order: found back-to-front"));
    assert!(with(&|part| part.identity.compositing = Compositing::Xray).contains("compositing: found xray"));
    assert!(with(&|part| part.identity.classification = Classification::After).contains("classification: found after"));
    assert!(with(&|part| part.identity.size[0] += 1).contains("size: found 38×35"));
    assert!(with(&|part| part.identity.background[0] = 0.5).contains("background: found [0.5"));
    assert!(with(&|part| part.identity.slabs.end += 1).contains("scene's slabs: found"));
    assert!(with(&|part| part.identity.fingerprint = "0".to_owned()).contains("scene: found 0, allowed: "));
    let mut short = parts.clone();
    short[2].contents[0].colors.pop();
    assert!(refused(short).contains("pixels: found"));
}

/// The fingerprint is that of what bears on the image.
#[test]
fn fingerprints_tell_images_apart() {
    let headless = headless(Backend::Cpu);
    let (volume, scene) = head(24, [37, 35]);
    let fingerprint = |volume, scene: &_| parts(headless, volume, scene, 2)[0].identity.fingerprint.clone();
    let first = fingerprint(&volume, &scene);
    assert_eq!(first, fingerprint(&volume, &scene));
    assert_eq!(first.len(), 64);
    // What names the volume, or draws it, does not matter.
    let mut named = scene.clone();
    named.channels[0].volume = sheetsplat::scene::VolumeSource::File("elsewhere/head.nrrd".into());
    named.splatting.rasterizer = sheetsplat::settings::Rasterizer::Quads;
    assert_eq!(first, fingerprint(&volume, &named));
    let reference = crate::merging::headless(Backend::Reference);
    assert_eq!(first, parts(reference, &volume, &scene, 2)[0].identity.fingerprint);
    let mut turned = scene.clone();
    turned.camera.direction.x += 1e-9;
    assert_ne!(first, fingerprint(&volume, &turned));
    let mut values = volume.values().to_vec();
    values[777] += 1.0;
    let other = sheetsplat::Volume::new("head", volume.dims(), volume.grid().spacing, values).unwrap();
    assert_ne!(first, fingerprint(&std::sync::Arc::new(other), &scene));
}

/// A damaged file is a part or an error, in bounded memory, and never a panic.
#[test]
fn damaged_files_are_errors() {
    let part = parts_of(Compositing::Maximum, Classification::After).remove(0);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("part.exr");
    let bytes = part.encode(&path).unwrap();
    let options = ReadOptions::default().with_memory(1 << 20);
    let open = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        Part::open_with(&path, &options)
    };
    assert!(open(&bytes).is_ok());
    let mut failures = 0;
    for length in (0..bytes.len()).step_by(1 + bytes.len() / 150) {
        failures += u32::from(open(&bytes[..length]).is_err());
    }
    for at in (0..bytes.len().min(1500)).step_by(3) {
        for value in [0, 0xff, bytes[at] ^ 0x10] {
            let mut damaged = bytes.clone();
            damaged[at] = value;
            failures += u32::from(open(&damaged).is_err());
        }
    }
    assert!(failures > 300, "{failures}");
    let other = folder.path().join("part.npz");
    let archive = part.encode(&other).unwrap();
    let open_archive = |bytes: &[u8]| {
        std::fs::write(&other, bytes).unwrap();
        Part::open_with(&other, &options)
    };
    assert!(open_archive(&archive).is_ok());
    let mut failures = 0;
    for at in (0..archive.len()).step_by(1 + archive.len() / 400) {
        let mut damaged = archive.clone();
        damaged[at] ^= 0x51;
        failures += u32::from(open_archive(&damaged).is_err()) + u32::from(open_archive(&archive[..at]).is_err());
    }
    // The archive's checksums find all damage but that of dates.
    assert!(failures > 700, "{failures}");

    // A description that lies.
    let json = |from: &str, to: &str| {
        assert_eq!(from.len(), to.len());
        let at = bytes.windows(from.len()).position(|window| window == from.as_bytes()).unwrap();
        let mut changed = bytes.clone();
        changed[at..at + to.len()].copy_from_slice(to.as_bytes());
        open(&changed).unwrap_err().to_string()
    };
    let file = path.display();
    assert_eq!(json("\"version\":2", "\"version\":9"), format!("{file}: part.version: found 9, allowed: 2"));
    assert!(json("\"size\":[37,35]", "\"size\":[99999]").contains("part: found"));
    assert!(json("\"size\":[37,35]", "\"size\":[0,353]").contains("part.size: found 0×353"));
    assert!(json("front-to-back", "front-to-bach").contains("part.order: found \"front-to-bach\""));
    assert!(json("\"maximum\"", "\"linear\" ").contains("channels: found"));
    let memory = Part::open_with(&path, &options.clone().with_memory(1 << 10)).unwrap_err().to_string();
    assert!(memory.contains("found"), "{memory}");
}

#[test]
fn other_files_are_no_parts() {
    let part = parts_of(Compositing::Linear, Classification::Before).remove(0);
    let format = part.save(Path::new("part.png")).unwrap_err().to_string();
    assert!(format.starts_with("part.png: extension: found \".png\", allowed: .exr or .npz"), "{format}");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("image.exr");
    let image = Image { width: 2, height: 1, pixels: vec![[0.5; 4]; 2] };
    image.save(&path, sheetsplat::image::PngDepth::Eight).unwrap();
    let error = Part::open(&path).unwrap_err();
    assert!(matches!(&error, ImageError::Content { what, .. } if what == "part"), "{error}");
}
