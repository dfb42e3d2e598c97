//! Classification (SPEC §3): which voxels take part. What they look like is decided when they are shaded.

use rayon::prelude::*;

use crate::transfer_function::TransferFunction;
use crate::volume::Volume;

/// Indices of the voxels that take part, in memory order, x fastest.
pub fn classify(volume: &Volume, transfer: &TransferFunction) -> Vec<u32> {
    let row = volume.dims().x as usize;
    let rows: Vec<Vec<u32>> = (0..volume.values().len() / row)
        .into_par_iter()
        .map(|y| {
            let indices = (y * row) as u32..=((y + 1) * row - 1) as u32;
            indices.filter(|&index| takes_part(volume, transfer, index)).collect()
        })
        .collect();
    rows.concat()
}

/// Whether a voxel takes part: visible, inside an iso-range and with an opacity above 0.
pub fn takes_part(volume: &Volume, transfer: &TransferFunction, index: u32) -> bool {
    let value = f64::from(volume.values()[index as usize]);
    let tables = transfer.tables(volume.label(index));
    // Most voxels are ruled out by their value, and without a gradient opacity nothing else counts: spare them the gradient.
    let may_take_part = tables.visible && tables.opacity.at(value) > 0.0 && tables.in_iso_range(value);
    may_take_part
        && (tables.gradient_opacity.is_none()
            || tables.alpha(value, volume.gradient(volume.grid().voxel_at(index)).length()) > 0.0)
}
