//! Opacities and amounts of voxels (SPEC §§3, 5).

use glam::DVec3;

use super::membership;
use crate::settings::splatting::Compositing;
use crate::settings::transfer_function::TransferFunction;
use crate::volume::{Members, Volume};

/// α of a voxel, times A where it has a colour of its own (SPEC §10); 0 for a hole.
pub(super) fn alpha(volume: &Volume, transfer: &TransferFunction, index: u32) -> f64 {
    let value = f64::from(volume.values().at(index as usize));
    let tables = transfer.tables(volume.label(index));
    // Most voxels are excluded by their value, so the gradient is computed only if needed.
    if value.is_nan() || tables.opacity.at(value) <= 0.0 {
        return 0.0;
    }
    let own = volume.color(index).map_or(1.0, |color| color.w);
    let voxel = volume.grid().voxel_at(index);
    let gradient = match tables.members {
        _ if tables.gradient_opacity.is_none() => DVec3::ZERO,
        Some(of @ Members::OfValues) => membership::gradient(volume, of, voxel),
        Some(Members::OfLabels) | None => volume.gradient(voxel),
    };
    tables.alpha(value, gradient.length()) * own
}

/// `m`: the amount per unit length (SPEC §5).
pub fn amount(compositing: Compositing, alpha: f64) -> f64 {
    if compositing.is_optical_depth() { -(-alpha.min(0.9999)).ln_1p() } else { alpha }
}
