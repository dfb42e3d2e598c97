//! Classification (SPEC §3): which voxels take part, and what of them the GPU needs to shade them.

use glam::DVec3;
use rayon::prelude::*;

use crate::gpu::layout::Voxel;
use crate::transfer_function::TransferFunction;
use crate::volume::Volume;

/// Below this length (value per world unit) a gradient has no direction (SPEC §3).
pub const MIN_GRADIENT: f64 = 1e-12;

/// The voxels that take part: inside an iso-range and with an opacity above 0. In memory order, x fastest.
pub fn classify(volume: &Volume, transfer: &TransferFunction) -> Vec<Voxel> {
    let row = volume.dims().x;
    let rows: Vec<Vec<Voxel>> = volume
        .values()
        .par_chunks(row as usize)
        .enumerate()
        .map(|(y, values)| {
            let first = y as u32 * row;
            (first..).zip(values).filter_map(|(index, &value)| classify_voxel(volume, transfer, index, value)).collect()
        })
        .collect();
    rows.concat()
}

/// What of a voxel the GPU needs, if it takes part.
pub fn classify_voxel(volume: &Volume, transfer: &TransferFunction, index: u32, value: f32) -> Option<Voxel> {
    let opacity = |magnitude| transfer.alpha(f64::from(value), magnitude);
    // Most voxels are ruled out by their value: spare them the gradient.
    if transfer.opacity.at(f64::from(value)) <= 0.0 || !transfer.in_iso_range(f64::from(value)) {
        return None;
    }
    let gradient = volume.gradient(volume.grid().voxel_at(index));
    let magnitude = gradient.length();
    (opacity(magnitude) > 0.0).then(|| Voxel {
        index,
        value,
        normal: encode_normal(if magnitude < MIN_GRADIENT { DVec3::Z } else { -gradient / magnitude }),
        gradient_magnitude: if magnitude < MIN_GRADIENT { 0.0 } else { magnitude as f32 },
    })
}

/// A unit vector as two 16-bit signed normalised numbers, folded onto an octahedron (decoded in `shade.wgsl`).
fn encode_normal(n: DVec3) -> u32 {
    let on_octahedron = n / n.abs().element_sum();
    let (x, y) = (on_octahedron.x, on_octahedron.y);
    let (x, y) = if n.z >= 0.0 {
        (x, y)
    } else {
        ((1.0 - y.abs()) * 1.0_f64.copysign(x), (1.0 - x.abs()) * 1.0_f64.copysign(y))
    };
    let snorm = |a: f64| u32::from((a * 32767.0).round() as i16 as u16);
    snorm(x) | snorm(y) << 16
}
