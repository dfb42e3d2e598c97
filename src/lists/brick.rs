//! Bricks: 4×4×4 neighbouring voxels that are tested for visibility together (§6). Each voxel has a fixed slot in its brick, so that voxels
//! enter and leave without moving others.

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, UVec3};

use crate::parallel::prelude::*;
use crate::volume::Grid;

/// The side of a brick in voxels.
pub const SIDE: u32 = 4;

/// The number of slots in a brick.
pub const BRICK_VOXELS: u32 = SIDE * SIDE * SIDE;

/// 4×4×4 places for voxels, x fastest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Brick {
    /// Which of the places hold a voxel that takes part, one bit each.
    pub present: [u32; 2],
    /// Least x of its voxels.
    pub x: u32,
    /// Least y.
    pub y: u32,
    /// Least z.
    pub z: u32,
    /// Greatest minus least x, y and z, two bits each; from bit 16 on, where lists were joined, the lists that have the brick.
    pub extent: u32,
}

/// The bricks of a volume that hold voxels, or held some.
#[derive(Clone, Debug, PartialEq)]
pub struct BrickList {
    grid: Grid,
    /// For every brick of the grid its index in `bricks`, or `NONE`.
    numbers: Vec<u32>,
    bricks: Vec<Brick>,
}

const NONE: u32 = u32::MAX;

/// The extent of a brick whose box must be fitted again.
const UNKNOWN: u32 = u32::MAX;

impl BrickList {
    /// The bricks of some voxels, given as indices into the volume. Bricks are in memory order.
    pub fn new(grid: &Grid, voxels: &[u32]) -> Self {
        let count = bricks_per_axis(grid).element_product() as usize;
        let mut list = Self { grid: *grid, numbers: vec![NONE; count], bricks: Vec::new() };
        list.change(voxels, &[]);
        list.compacted()
    }

    /// The bricks of the voxels whose flags are set by `flag`, which is given y and z of a row of voxels along x and their flags.
    pub fn by_rows(grid: &Grid, flag: &(dyn Fn(u32, u32, &mut [bool]) + Sync)) -> Self {
        let across = bricks_per_axis(grid);
        let row = |row: u32| {
            let origin = SIDE * UVec3::new(0, row % across.y, row / across.y);
            let (mut masks, mut flags) = (vec![0_u64; across.x as usize], vec![false; (SIDE * across.x) as usize]);
            for slot in (0..BRICK_VOXELS).step_by(SIDE as usize) {
                let UVec3 { y, z, .. } = origin + in_brick(slot);
                if y < grid.dims.y && z < grid.dims.z {
                    flags.fill(false);
                    flag(y, z, &mut flags[..grid.dims.x as usize]);
                    for (mask, flags) in masks.iter_mut().zip(flags.chunks_exact(SIDE as usize)) {
                        *mask |= packed(flags) << slot;
                    }
                }
            }
            let bricks = masks.into_iter().zip((0..).step_by(SIDE as usize)).filter(|&(mask, _)| mask != 0);
            let brick = |(mask, x): (u64, u32)| {
                let present = [mask as u32, (mask >> 32) as u32];
                let mut brick = Brick { present, x, y: origin.y, z: origin.z, extent: UNKNOWN };
                fit(&mut brick);
                brick
            };
            bricks.map(brick).collect::<Vec<_>>()
        };
        let rows: Vec<Vec<Brick>> = (0..across.y * across.z).into_par_iter().map(row).collect();
        let bricks = rows.concat();
        let mut numbers = vec![NONE; across.element_product() as usize];
        for (brick, number) in bricks.iter().zip(0..) {
            numbers[brick_of(grid, grid.index_of(origin(brick))) as usize] = number;
        }
        Self { grid: *grid, numbers, bricks }
    }

    /// Some bricks of a grid, each given once, with their boxes fitted.
    #[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
    pub(crate) fn of_bricks(grid: &Grid, mut bricks: Vec<Brick>) -> Self {
        bricks.par_sort_unstable_by_key(position);
        let mut numbers = vec![NONE; bricks_per_axis(grid).element_product() as usize];
        for (brick, number) in bricks.iter().zip(0..) {
            numbers[brick_of(grid, grid.index_of(origin(brick))) as usize] = number;
        }
        Self { grid: *grid, numbers, bricks }
    }

    /// The voxels, as indices into the volume, brick by brick.
    pub fn voxels(&self) -> Vec<u32> {
        self.bricks.iter().flat_map(voxels).map(|(_, voxel)| self.grid.index_of(voxel)).collect()
    }

    /// The bricks.
    pub fn bricks(&self) -> &[Brick] {
        &self.bricks
    }

    /// A voxel's place: the index of its brick times [`BRICK_VOXELS`], plus its slot. `None` if it has no brick.
    pub fn place(&self, voxel: u32) -> Option<u32> {
        let number = self.numbers[brick_of(&self.grid, voxel) as usize];
        (number != NONE).then(|| number * BRICK_VOXELS + slot_of(&self.grid, voxel))
    }

    /// The voxels of another list of the same grid that are not in this one, and those of this one that are not in the other.
    pub fn changes_to(&self, new: &Self) -> (Vec<u32>, Vec<u32>) {
        (new.without(self), self.without(new))
    }

    /// The voxels that are not in another list.
    fn without(&self, other: &Self) -> Vec<u32> {
        let mut found = Vec::new();
        for brick in &self.bricks {
            let number = other.numbers[brick_of(&self.grid, self.grid.index_of(origin(brick))) as usize];
            let others = if number == NONE { 0 } else { present(&other.bricks[number as usize]) };
            for (slot, voxel) in voxels(brick) {
                if others >> slot & 1 == 0 {
                    found.push(self.grid.index_of(voxel));
                }
            }
        }
        found
    }

    /// Whether a voxel is in the list.
    pub fn contains(&self, voxel: u32) -> bool {
        self.place(voxel)
            .is_some_and(|place| present(&self.bricks[(place / BRICK_VOXELS) as usize]) >> (place % 64) & 1 == 1)
    }

    /// Adds voxels, in new bricks if necessary, and removes others. Bricks stay, even if they become empty.
    pub fn change(&mut self, entering: &[u32], leaving: &[u32]) {
        for &voxel in entering {
            let brick = brick_of(&self.grid, voxel);
            if self.numbers[brick as usize] == NONE {
                self.add(brick);
            }
            let (brick, word, bit) = self.bit(voxel);
            brick.present[word] |= bit;
            brick.extent = UNKNOWN;
        }
        for &voxel in leaving {
            let (brick, word, bit) = self.bit(voxel);
            brick.present[word] &= !bit;
            brick.extent = UNKNOWN;
        }
        // Each brick is fitted once, although many of its voxels may have changed.
        self.bricks.iter_mut().filter(|brick| brick.extent == UNKNOWN).for_each(fit);
    }

    /// The list without empty bricks, in memory order, as [`Self::new`] makes it from the voxels.
    pub fn compacted(&self) -> Self {
        let mut list = Self { grid: self.grid, numbers: vec![NONE; self.numbers.len()], bricks: Vec::new() };
        for (new, &old) in list.numbers.iter_mut().zip(&self.numbers) {
            if old != NONE && present(&self.bricks[old as usize]) != 0 {
                *new = list.bricks.len() as u32;
                list.bricks.push(self.bricks[old as usize]);
            }
        }
        list
    }

    /// A voxel's brick, which must exist, and the voxel's bit in it.
    fn bit(&mut self, voxel: u32) -> (&mut Brick, usize, u32) {
        let (number, slot) = (self.numbers[brick_of(&self.grid, voxel) as usize], slot_of(&self.grid, voxel));
        (&mut self.bricks[number as usize], slot as usize / 32, 1 << (slot % 32))
    }

    /// Adds an empty brick of the grid.
    fn add(&mut self, brick: u32) {
        let across = bricks_per_axis(&self.grid);
        let at = SIDE * UVec3::new(brick % across.x, brick / across.x % across.y, brick / (across.x * across.y));
        self.numbers[brick as usize] = self.bricks.len() as u32;
        self.bricks.push(Brick { present: [0; 2], x: at.x, y: at.y, z: at.z, extent: 0 });
    }
}

/// A mask of up to 64 flags, the first in its lowest bit.
pub(crate) fn packed(flags: &[bool]) -> u64 {
    flags.iter().rev().fold(0, |bits, &flag| bits << 1 | u64::from(flag))
}

/// A mask of a brick's occupied slots.
pub fn present(brick: &Brick) -> u64 {
    u64::from(brick.present[0]) | u64::from(brick.present[1]) << 32
}

/// The voxels of a brick: the slot and the position in the volume.
pub fn voxels(brick: &Brick) -> impl Iterator<Item = (u32, UVec3)> {
    let (bits, origin) = (present(brick), origin(brick));
    (0..BRICK_VOXELS).filter(move |slot| bits >> slot & 1 == 1).map(move |slot| (slot, origin + in_brick(slot)))
}

/// The position of a brick's first slot in the volume.
pub fn origin(brick: &Brick) -> UVec3 {
    UVec3::new(brick.x, brick.y, brick.z) / SIDE * SIDE
}

/// The box of a brick's voxels: its middle and half its size in voxels.
#[inline(always)]
pub fn bounds(brick: &Brick) -> (DVec3, DVec3) {
    let half = UVec3::new(brick.extent & 3, brick.extent >> 2 & 3, brick.extent >> 4 & 3).as_dvec3() / 2.0;
    (UVec3::new(brick.x, brick.y, brick.z).as_dvec3() + half, half)
}

/// A key that sorts bricks in memory order, whatever the order in which they were added.
pub fn position(brick: &Brick) -> [u32; 3] {
    [brick.z / SIDE, brick.y / SIDE, brick.x / SIDE]
}

/// The position of a slot within its brick.
pub fn in_brick(slot: u32) -> UVec3 {
    UVec3::new(slot % SIDE, slot / SIDE % SIDE, slot / (SIDE * SIDE))
}

/// The number of a grid's bricks along each axis.
pub fn bricks_per_axis(grid: &Grid) -> UVec3 {
    grid.dims.map(|n| n.div_ceil(SIDE))
}

/// The index of a voxel's brick in the grid of bricks.
fn brick_of(grid: &Grid, voxel: u32) -> u32 {
    let (at, across) = (grid.voxel_at(voxel) / SIDE, bricks_per_axis(grid));
    at.x + across.x * (at.y + across.y * at.z)
}

/// A voxel's slot in its brick.
fn slot_of(grid: &Grid, voxel: u32) -> u32 {
    let at = grid.voxel_at(voxel) % SIDE;
    at.x + SIDE * (at.y + SIDE * at.z)
}

/// Fits a brick's box tightly around its voxels.
pub(super) fn fit(brick: &mut Brick) {
    // Masks of the first layer across x, y and z; shifts by a bit, a row or a slice give the others.
    const LAYERS: [(u64, u32); 3] = [(0x1111_1111_1111_1111, 1), (0x000f_000f_000f_000f, SIDE), (0xffff, SIDE * SIDE)];
    let bits = present(brick);
    if bits == 0 {
        brick.extent = 0;
        return;
    }
    let bounds = LAYERS.map(|(layer, step)| {
        let holds = |at: &u32| bits & layer << (at * step) != 0;
        let (low, high) = ((0..SIDE).find(holds), (0..SIDE).rev().find(holds));
        (low.unwrap_or(0), high.unwrap_or(0))
    });
    let origin = |at: u32, low: u32| at / SIDE * SIDE + low;
    let [(x, to_x), (y, to_y), (z, to_z)] = bounds;
    (brick.x, brick.y, brick.z) = (origin(brick.x, x), origin(brick.y, y), origin(brick.z, z));
    brick.extent = (to_x - x) | (to_y - y) << 2 | (to_z - z) << 4;
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Between lists whose bricks are others, too.
    #[test]
    fn changes_turn_a_list_into_another() {
        let grid = Grid::new(UVec3::new(13, 9, 6), DVec3::ONE);
        let list = |of: &dyn Fn(u32) -> bool| {
            let voxels = (0..grid.dims.element_product()).filter(|&index| of(index));
            BrickList::new(&grid, &voxels.collect::<Vec<_>>())
        };
        let (old, new) = (list(&|index| index % 5 < 2 && index < 600), list(&|index| index % 3 < 1 && index > 100));
        let (entering, leaving) = old.changes_to(&new);
        assert!(entering.iter().all(|&voxel| new.contains(voxel) && !old.contains(voxel)));
        assert!(leaving.iter().all(|&voxel| old.contains(voxel) && !new.contains(voxel)));
        let mut changed = old.clone();
        changed.change(&entering, &leaving);
        assert_eq!(changed.compacted(), new);
        assert_eq!(changed.changes_to(&new), (Vec::new(), Vec::new()));
    }
}
