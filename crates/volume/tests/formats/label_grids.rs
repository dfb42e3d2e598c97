//! Label files that lie otherwise in the patient than their volume. The right labels are those at the same places by both affines, as nibabel's
//! `as_reoriented` and `resample_from_to` of order 0 have them.

use sheetsplat_volume::ReadOptions;
use sheetsplat_volume::internals::Access;

use crate::*;

/// A NIfTI file of 8-bit numbers, x fastest, with an affine by rows.
fn nifti(dims: UVec3, affine: [[f32; 4]; 3], values: &[u8]) -> Vec<u8> {
    let mut bytes = vec![0; 352];
    bytes[..4].copy_from_slice(&348_u32.to_le_bytes());
    for (at, size) in [3, dims.x, dims.y, dims.z, 1, 1, 1, 1].into_iter().enumerate() {
        bytes[40 + 2 * at..][..2].copy_from_slice(&(size as u16).to_le_bytes());
    }
    bytes[70..72].copy_from_slice(&2_u16.to_le_bytes());
    bytes[72..74].copy_from_slice(&8_u16.to_le_bytes());
    let mut float = |at: usize, value: f32| bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
    for (axis, at) in (0..3).zip([80, 84, 88]) {
        float(at, (0..3).map(|row| affine[row][axis].abs()).sum());
    }
    float(108, 352.0);
    for (at, value) in affine.as_flattened().iter().enumerate() {
        float(280 + 4 * at, *value);
    }
    bytes[254..256].copy_from_slice(&1_u16.to_le_bytes());
    bytes[344..348].copy_from_slice(b"n+1\0");
    bytes.extend(values);
    bytes
}

/// The values of a grid.
fn filled(dims: UVec3, value: impl Fn(UVec3) -> u8) -> Vec<u8> {
    let [nx, ny, nz] = dims.to_array();
    let row = |z, y| (0..nx).map(move |x| UVec3::new(x, y, z));
    (0..nz).flat_map(|z| (0..ny).flat_map(move |y| row(z, y))).map(value).collect()
}

const DIMS: UVec3 = UVec3::new(6, 5, 4);
const RAS: [[f32; 4]; 3] = [[1.0, 0.0, 0.0, -3.0], [0.0, 1.0, 0.0, -2.0], [0.0, 0.0, 1.5, 7.0]];

/// The label at a place of the volume.
fn label(at: UVec3) -> u8 {
    (at.x + 6 * at.y + 30 * at.z) as u8 % 7
}

/// Opens the volume with the labels of a file.
fn labelled(name: &str, bytes: &[u8]) -> (Result<Volume, VolumeError>, Vec<String>) {
    let folder = Folder::new();
    let volume = folder.open("volume.nii", &nifti(DIMS, RAS, &filled(DIMS, |at| at.x as u8))).unwrap();
    let labels = folder.write(name, &[bytes]);
    let access = Access::new(&ReadOptions::default()).unwrap();
    warned(|| volume.with_labels_of(&labels, false, &access))
}

#[track_caller]
fn assert_labels(volume: &Volume, expected: impl Fn(UVec3) -> u8) {
    let expected: Vec<u16> = filled(DIMS, expected).into_iter().map(u16::from).collect();
    assert_eq!(volume.labels().unwrap(), expected);
}

#[test]
fn labels_in_other_orientations() {
    let (volume, warnings) = labelled("ras.nii", &nifti(DIMS, RAS, &filled(DIMS, label)));
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_labels(&volume.unwrap(), label);
    // LAS: x runs the other way. LPS: y does, too. The last one is AIR by axes: its x is the volume's y, its y the volume's -z, its z the volume's x.
    let las = [[-1.0, 0.0, 0.0, 2.0], RAS[1], RAS[2]];
    let lps = [las[0], [0.0, -1.0, 0.0, 2.0], RAS[2]];
    let air = [[0.0, 0.0, 1.0, -3.0], [1.0, 0.0, 0.0, -2.0], [0.0, -1.5, 0.0, 11.5]];
    let turned = UVec3::new(5, 4, 6);
    for (name, dims, affine, at) in [
        ("las.nii", DIMS, las, (|at| UVec3::new(5 - at.x, at.y, at.z)) as fn(UVec3) -> UVec3),
        ("lps.nii", DIMS, lps, |at| UVec3::new(5 - at.x, 4 - at.y, at.z)),
        ("air.nii", turned, air, |at| UVec3::new(at.z, at.x, 3 - at.y)),
    ] {
        let (volume, warnings) = labelled(name, &nifti(dims, affine, &filled(dims, |voxel| label(at(voxel)))));
        assert_labels(&volume.unwrap(), label);
        // Turned, a left-handed file lies where the volume does.
        if name == "las.nii" {
            assert!(warnings.is_empty(), "{warnings:?}");
            continue;
        }
        assert_warned(&warnings, "labels: resampled from ");
        assert_warned(&warnings, "the volume's, each label the nearest one");
    }
}

#[test]
fn labels_elsewhere() {
    // Two voxels to the right: where the file ends there are no labels.
    let shifted = |by: f32| [[1.0, 0.0, 0.0, -3.0 + by], RAS[1], RAS[2]];
    let (volume, warnings) = labelled("shifted.nii", &nifti(DIMS, shifted(2.0), &filled(DIMS, label)));
    assert_labels(&volume.unwrap(), |at| if at.x < 2 { 0 } else { label(at - UVec3::new(2, 0, 0)) });
    assert_warned(&warnings, "resampled");
    // A coarser grid: every label is that of the nearest voxel.
    let coarse = [[2.0, 0.0, 0.0, -2.5], RAS[1], RAS[2]];
    let half = DIMS.with_x(3);
    let (volume, _) = labelled("coarse.nii", &nifti(half, coarse, &filled(half, label)));
    assert_labels(&volume.unwrap(), |at| label(at.with_x(at.x / 2)));
    let (nowhere, _) = labelled("far.nii", &nifti(DIMS, shifted(100.0), &filled(DIMS, label)));
    let found = "the box from [97.0, -2.0, 7.0] to [102.0, 2.0, 11.5]";
    let allowed = "a box that overlaps the volume's, the box from [-3.0, -2.0, 7.0] to [2.0, 2.0, 11.5]";
    assert_refused(nowhere, "far.nii", "labels", found, allowed);
    // A file that does not say where it lies must have the volume's grid.
    let (volume, warnings) = labelled("plain.npy", &fs::read(fixture("c.npy")).unwrap());
    assert!(warnings.is_empty() && volume.unwrap_err().to_string().contains("the volume's"));
}
