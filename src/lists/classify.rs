//! Classification (SPEC §3): which voxels take part. Shading determines their appearance.

use crate::parallel::prelude::*;
use crate::settings::clip::ClippedVoxels;
use crate::settings::transfer_function::TransferFunction;
use crate::volume::Volume;

/// The indices of the voxels that take part, in memory order.
pub fn classify(volume: &Volume, transfer: &TransferFunction, clipped: &ClippedVoxels) -> Vec<u32> {
    in_rows(volume, |y, z, row| {
        let inside = clipped.in_row(y, z, volume.dims().x);
        inside.map(|x| row + x).filter(|&index| takes_part(volume, transfer, index)).collect()
    })
}

/// Concatenates what `pick` selects from every row of voxels along x, given its y, its z and the index of its first voxel, in memory order.
pub fn in_rows(volume: &Volume, pick: impl Fn(u32, u32, u32) -> Vec<u32> + Sync) -> Vec<u32> {
    let dims = volume.dims();
    let row = |row: u32| pick(row % dims.y, row / dims.y, row * dims.x);
    let rows: Vec<Vec<u32>> = (0..dims.y * dims.z).into_par_iter().map(row).collect();
    rows.concat()
}

/// The channels that are drawn (SPEC §10), each with its transfer function.
pub fn channels<'a>(
    volume: &'a Volume,
    transfer: &'a TransferFunction,
) -> impl Iterator<Item = (&'a Volume, &'a TransferFunction)> {
    volume.channels().zip(transfer.channels())
}

/// Whether a voxel that is not clipped takes part: in any channel it is not a hole, visible, inside an iso-range, and has an opacity above 0, with its
/// own A if it has a colour of its own.
pub fn takes_part(volume: &Volume, transfer: &TransferFunction, index: u32) -> bool {
    channels(volume, transfer).any(|(volume, transfer)| takes_part_in(volume, transfer, index))
}

/// Whether a voxel takes part in one channel.
fn takes_part_in(volume: &Volume, transfer: &TransferFunction, index: u32) -> bool {
    let value = f64::from(volume.values().at(index as usize));
    let tables = transfer.tables(volume.label(index));
    // Most voxels are excluded by their value, and without gradient opacity the value decides: the gradient is computed only if needed.
    let may_take_part =
        !value.is_nan() && tables.visible && tables.opacity.at(value) > 0.0 && tables.in_iso_range(value);
    may_take_part
        && volume.alpha_of(index) > 0.0
        && (tables.gradient_opacity.is_none()
            || tables.alpha(value, volume.gradient(volume.grid().voxel_at(index)).length()) > 0.0)
}
