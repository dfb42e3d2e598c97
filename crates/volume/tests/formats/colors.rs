//! Volumes of colours (SPEC §10), as other programs write them: red is the value x + 10 y + 100 z, green 255 less that, blue 51, A 250 - 20 x.

use std::path::PathBuf;

use glam::{DVec3, DVec4, UVec3};
use sheetsplat_volume::{Labels, ReadOptions, Volume};

use crate::{assert_near, fixture};

const DIMS: UVec3 = UVec3::new(5, 4, 3);

/// Files, and whether they have A.
const FILES: [(&str, bool); 14] = [
    ("rgb.npy", false),
    ("rgba.npy", true),
    ("rgb.nrrd", false),
    ("rgba.nrrd", true),
    ("rgb.nii", false),
    ("rgba.nii.gz", true),
    ("times.nii", false),
    ("rgb.tif", false),
    ("rgba.tif", true),
    ("planar.tif", false),
    ("imagej.tif", false),
    ("ome.tif", false),
    ("rgb.dcm", false),
    ("planar.dcm", false),
];

fn path(name: &str) -> PathBuf {
    fixture(&format!("colors/{name}"))
}

/// The colour of a voxel in bytes.
fn bytes_at(voxel: UVec3, has_alpha: bool) -> DVec4 {
    let value = f64::from(voxel.x + 10 * voxel.y + 100 * voxel.z);
    DVec4::new(value, 255.0 - value, 51.0, if has_alpha { 250.0 - 20.0 * f64::from(voxel.x) } else { 255.0 })
}

/// Asserts that a volume has the fixtures' colours, with an error of some 255ths.
fn assert_colors(volume: &Volume, color: impl Fn(UVec3) -> DVec4, tolerance: f64, name: &str) {
    assert_eq!((volume.dims(), volume.channels().count()), (DIMS, 1), "{name}");
    for index in 0..DIMS.element_product() {
        let voxel = volume.grid().voxel_at(index);
        let (expected, actual) = (color(voxel), volume.color(index).unwrap() * 255.0);
        assert!((actual - expected).abs().max_element() <= tolerance, "{name}, {voxel}: {actual}, not {expected}");
    }
}

#[test]
fn colours_and_luminance() {
    for (name, has_alpha) in FILES.into_iter().chain([("rle.dcm", false)]) {
        let volume = Volume::open(&path(name)).unwrap_or_else(|error| panic!("{error}"));
        // 16 bits for each number of a float.
        assert_colors(&volume, |voxel| bytes_at(voxel, has_alpha), if name == "rgba.npy" { 0.002 } else { 1e-9 }, name);
        // Of the stored numbers.
        let full = match name {
            "rgba.npy" => 1.0,
            "rgba.nrrd" | "rgba.tif" => 65535.0,
            _ => 255.0,
        };
        for (index, value) in (0..).zip(volume.values()) {
            let color = bytes_at(volume.grid().voxel_at(index), true).truncate() / 255.0;
            let luminance = color.dot(DVec3::new(0.2126, 0.7152, 0.0722)) * full;
            assert!((f64::from(value) - luminance).abs() < 1e-6 * full, "{name}: {value}, not {luminance}");
        }
        assert_eq!(volume.encoding().unwrap().channels, 1, "{name}");
        if name.contains("nrrd") || name.contains("nii") {
            assert_near(volume.spacing(), DVec3::new(0.5, 2.0, 3.0));
        }
    }
}

#[test]
fn lossy_colours_are_near() {
    let volume = Volume::open(&path("jpeg.dcm")).unwrap();
    assert_colors(&volume, |voxel| bytes_at(voxel, false), 5.0, "jpeg.dcm");
}

#[test]
fn times_of_colours() {
    let open = |options: ReadOptions| Volume::open_with(&path("times.nii"), &options);
    let inverted = |voxel| {
        let color = DVec4::splat(255.0) - bytes_at(voxel, false);
        color.truncate().extend(255.0)
    };
    let second = open(ReadOptions::default().with_time(1)).unwrap();
    assert_colors(&second, inverted, 1e-9, "times.nii");
    assert_eq!(second.encoding().unwrap().times, 2);
    let first = open(ReadOptions::default().with_channel(0).with_time(0)).unwrap();
    assert_colors(&first, |voxel| bytes_at(voxel, false), 1e-9, "times.nii");
    let message = open(ReadOptions::default().with_channel(1)).unwrap_err().to_string();
    assert!(message.ends_with("channel: found 1, allowed: 0, the only one"), "{message}");
}

#[test]
fn colours_are_no_labels() {
    for name in ["rgb.tif", "rgb.npy", "rgb.dcm"] {
        let message = Labels::open(&path(name)).unwrap_err().to_string();
        assert!(message.contains("channels: found 3, allowed: one"), "{message}");
    }
}
