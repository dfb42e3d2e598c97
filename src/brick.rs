//! Bricks: neighbouring voxels that are tested for visibility together (§6).

use glam::UVec3;

use crate::gpu::layout::{Brick, Voxel};
use crate::volume::Grid;

/// Side of a brick, voxels.
const SIDE: u32 = 4;

/// Sorts voxels by brick and describes the bricks. Voxels come in memory order and keep it within a brick.
pub fn group(grid: &Grid, voxels: &[Voxel]) -> (Vec<Voxel>, Vec<Brick>) {
    let bricks_per_axis = grid.dims.map(|n| n.div_ceil(SIDE));
    let brick_of = |voxel: &Voxel| {
        let at = grid.voxel_at(voxel.index) / SIDE;
        (at.x + bricks_per_axis.x * (at.y + bricks_per_axis.y * at.z)) as usize
    };
    // Counting sort: ends[b] is first the number of voxels of brick b - 1, then where brick b starts, at last where it ends.
    let mut ends = vec![0_u32; bricks_per_axis.element_product() as usize + 1];
    for voxel in voxels {
        ends[brick_of(voxel) + 1] += 1;
    }
    for b in 1..ends.len() {
        ends[b] += ends[b - 1];
    }
    let mut sorted = vec![bytemuck::Zeroable::zeroed(); voxels.len()];
    for voxel in voxels {
        let slot = &mut ends[brick_of(voxel)];
        sorted[*slot as usize] = *voxel;
        *slot += 1;
    }
    let mut first = 0;
    let mut bricks = Vec::new();
    for &end in &ends[..ends.len() - 1] {
        if end > first {
            bricks.push(describe(grid, first, &sorted[first as usize..end as usize]));
        }
        first = end;
    }
    (sorted, bricks)
}

/// The brick of some voxels, with the tight box around them.
fn describe(grid: &Grid, first: u32, voxels: &[Voxel]) -> Brick {
    let (low, high) = voxels
        .iter()
        .map(|voxel| grid.voxel_at(voxel.index))
        .fold((UVec3::MAX, UVec3::ZERO), |(low, high), at| (low.min(at), high.max(at)));
    let extent = high - low;
    Brick {
        first,
        count: voxels.len() as u32,
        x: low.x,
        y: low.y,
        z: low.z,
        extent: extent.x | extent.y << 8 | extent.z << 16,
    }
}
