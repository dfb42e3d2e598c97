//! Volumes whose axes are not at right angles.

use sheetsplat_volume::Labels;

use crate::*;

/// `make.py` shears by half a column and one row per slice.
const ANGLE: &str = "sheared by 33.90°";

/// The fixtures' values where the shear moves them, x fastest; NaN elsewhere.
fn expected() -> Vec<f32> {
    let mut expected = Vec::new();
    for z in 0..3 {
        for y in 0..6 {
            for x in 0..6 {
                let (column, row) = (f64::from(x) - 0.5 * f64::from(z), y - z);
                let is_inside = (-0.5..=4.5).contains(&column) && (0..4).contains(&row);
                let value = column.clamp(0.0, 4.0) + f64::from(10 * row + 100 * z);
                expected.push(if is_inside { value as f32 } else { f32::NAN });
            }
        }
    }
    expected
}

#[test]
fn nifti_and_nrrd_are_resampled() {
    for name in ["sheared.nii", "sheared.nrrd"] {
        let (volume, warnings) = warned(|| Volume::open(&fixture(name)));
        let volume = volume.unwrap();
        assert_warned(&warnings, ANGLE);
        assert_eq!(volume.dims(), UVec3::new(6, 6, 3), "{name}");
        for (at, (found, expected)) in volume.values().iter().zip(expected()).enumerate() {
            let is_near = found.is_nan() && expected.is_nan() || (found - expected).abs() < 1e-4;
            assert!(is_near, "{name}: {found}, not {expected}, at {at}");
        }
        assert_lies(&volume, rotation(), ORIGIN);
    }
}

/// Labels are not interpolated.
#[test]
fn labels_are_the_nearest_ones() {
    let (labels, warnings) = warned(|| Labels::open(&fixture("sheared.nrrd")).unwrap());
    assert_warned(&warnings, ANGLE);
    assert_eq!(labels.dims, UVec3::new(6, 6, 3));
    // Row 1 of the second slice, which is half a column off.
    assert_eq!(labels.values[36 + 6..36 + 12], [100, 101, 102, 103, 104, 104]);
    assert_eq!(labels.values[36..42], [0; 6]);
}

#[test]
fn flat_and_wide_ones_are_refused() {
    let text = String::from_utf8_lossy(&fs::read(fixture("sheared.nrrd")).unwrap()).into_owned();
    let line = text.lines().find(|line| line.starts_with("space directions")).unwrap().to_owned();
    let folder = Folder::new();
    let refused = |directions: &str, found: &str, allowed: &str| {
        let bytes = replaced("sheared.nrrd", &line, &format!("space directions: {directions}"));
        assert_refused(folder.open("a.nrrd", &bytes), "a.nrrd", "space directions", found, allowed);
    };
    let angle = "each less than 80° from a right angle";
    refused("(1,0,0) (0,1,0) (1,1,0)", "axes at 90.00° from a right angle", angle);
    refused("(1,0,0) (2,0,0) (0,0,1)", "from a right angle", angle);
    let grid = "axes sheared by 45.00°, an orthogonal grid of [20005.0, 4.0, 3.0] voxels";
    refused("(1e-3,0,0) (0,1,0) (10,0,10)", grid, "at most 16 times the file's 60 voxels");
}
