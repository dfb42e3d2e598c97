//! The gradient of a label's membership (SPEC §15): the f64 evaluation of what [`Volume::membership_gradient`] keeps.

use glam::{DVec3, UVec3};

use crate::volume::{Members, Volume};

/// How far the window reaches along each axis.
const REACH: u32 = 4;

/// The regression's slopes over the window around a voxel, cut at the border, of 1 where voxels have its label and 0 elsewhere, per world unit.
pub fn gradient(volume: &Volume, of: Members, voxel: UVec3) -> DVec3 {
    let grid = volume.grid();
    // Holes have no label.
    let label = |voxel: UVec3| match (of, volume.value(voxel)) {
        (_, value) if value.is_nan() => None,
        (Members::OfValues, value) => Some(value),
        (Members::OfLabels, _) => volume.label(grid.index_of(voxel)).map(f32::from),
    };
    let Some(own) = label(voxel) else { return DVec3::ZERO };
    let (low, high) = (voxel.saturating_sub(UVec3::splat(REACH)), (voxel + REACH).min(grid.dims - 1));
    let plane = |z: u32| (low.y..=high.y).map(move |y| UVec3::new(low.x, y, z));
    let row = |first: UVec3| (low.x..=high.x).map(move |x| first.with_x(x));
    let window: Vec<UVec3> = (low.z..=high.z).flat_map(plane).flat_map(row).collect();
    if window.iter().all(|&other| label(other) == Some(own)) {
        return DVec3::ZERO;
    }
    let offset = |other: UVec3| other.as_dvec3() - voxel.as_dvec3();
    let weight = |other: UVec3| libm::exp(-offset(other).length_squared() / 8.0);
    let total: f64 = window.iter().map(|&other| weight(other)).sum();
    let middle = window.iter().map(|&other| offset(other) * weight(other)).sum::<DVec3>() / total;
    let (mut slopes, mut variances) = (DVec3::ZERO, DVec3::ZERO);
    for &other in &window {
        let from_middle = offset(other) - middle;
        variances += weight(other) * from_middle * from_middle;
        if label(other) == Some(own) {
            slopes += weight(other) * from_middle;
        }
    }
    let has_neighbours = grid.dims.cmpgt(UVec3::ONE);
    DVec3::select(has_neighbours, slopes / (grid.spacing * variances), DVec3::ZERO)
}
