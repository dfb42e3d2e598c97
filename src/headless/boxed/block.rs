//! The blocks of a volume that are read for pages: what is known of each, and the rim of voxels around it by which that is known.

use glam::UVec3;

use super::channel::VoxelBox;
use crate::lists::brick::Brick;

/// What is known of a block: what is drawn of its pages. Nothing is drawn of one without any.
#[derive(Debug, Default)]
pub(super) struct Block {
    pub(super) pages: Vec<DrawnPage>,
    /// The parts of its rim by which that is known.
    pub(super) parts: Parts,
    /// The channels that may show something of it, by their numbers among those that are drawn.
    pub(super) channels: Vec<usize>,
    /// The bytes of all bricks.
    pub(super) bytes: u64,
    pub(super) has_holes: bool,
    /// The window for which it was used last.
    pub(super) used: u64,
}

/// What is drawn of a page.
#[derive(Debug)]
pub(super) struct DrawnPage {
    pub(super) page: UVec3,
    /// The bricks of its voxels in each list, where they lie in the volume.
    pub(super) lists: Vec<Vec<Brick>>,
}

/// How a volume is divided into pages and blocks.
#[derive(Clone, Copy, Debug)]
pub(super) struct Division {
    /// The volume's voxels along each axis.
    pub(super) dims: UVec3,
    /// The bits of a voxel's place in its page along each axis.
    pub(super) bits: u32,
    /// The voxels along each axis of a block, whole pages.
    pub(super) side: UVec3,
    /// The voxels around a block, in whole bricks, by which it is known which of its voxels are drawn.
    pub(super) rim: UVec3,
}

impl Division {
    /// The voxels of a page.
    pub(super) fn voxels_of_page(&self, page: UVec3) -> VoxelBox {
        let low = page << self.bits;
        VoxelBox { low, end: (low + (1 << self.bits)).min(self.dims) }
    }

    /// The voxels of a block.
    pub(super) fn voxels_of(&self, block: UVec3) -> VoxelBox {
        let low = block * self.side;
        VoxelBox { low, end: (low + self.side).min(self.dims) }
    }

    /// A block and its rim.
    pub(super) fn rim_of(&self, block: UVec3) -> Rim {
        let own = self.voxels_of(block);
        let within = VoxelBox { low: own.low.saturating_sub(self.rim), end: (own.end + self.rim).min(self.dims) };
        Rim { own, within }
    }
}

/// Parts of a rim, a bit for each. The one in the middle stands for the block itself.
pub(super) type Parts = u32;

/// The block and its whole rim.
pub(super) const ALL: Parts = (1 << 27) - 1;

/// The block without its rim.
pub(super) const OWN: Parts = 1 << 13;

/// A block's voxels, and those with its rim.
#[derive(Clone, Copy)]
pub(super) struct Rim {
    pub(super) own: VoxelBox,
    pub(super) within: VoxelBox,
}

impl Rim {
    /// The block and the parts of its rim, at most 26, at its faces, edges and corners.
    pub(super) fn parts(self) -> impl Iterator<Item = (Parts, VoxelBox)> {
        let Self { own, within } = self;
        let ends = [within.low, own.low, own.end, within.end];
        let corner = move |at: UVec3| {
            let [x, y, z] = at.to_array().map(|at| ends[at as usize]);
            UVec3::new(x.x, y.y, z.z)
        };
        let parts = (0..27).map(move |number: u32| {
            let at = UVec3::new(number % 3, number / 3 % 3, number / 9);
            (1 << number, VoxelBox { low: corner(at), end: corner(at + 1) })
        });
        parts.filter(|(_, part)| part.low.cmplt(part.end).all())
    }

    /// Few boxes that together are some of the parts.
    pub(super) fn boxes(self, wanted: Parts) -> Vec<VoxelBox> {
        let mut boxes: Vec<VoxelBox> =
            self.parts().filter(|(bit, _)| wanted & bit != 0).map(|(_, part)| part).collect();
        for axis in 0..3 {
            let mut joined: Vec<VoxelBox> = Vec::new();
            for next in boxes {
                let follows = |before: &&mut VoxelBox| {
                    let mut behind = **before;
                    (behind.low[axis], behind.end[axis]) = (before.end[axis], next.end[axis]);
                    (behind.low, behind.end) == (next.low, next.end)
                };
                match joined.iter_mut().find(follows) {
                    Some(before) => before.end = next.end,
                    None => joined.push(next),
                }
            }
            boxes = joined;
        }
        boxes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whatever parts are wanted, each voxel of theirs lies in one box, and no other voxel does.
    #[test]
    fn boxes_are_the_parts_that_are_wanted() {
        let rims = [
            ([4, 4, 4], [8, 8, 8], [2, 3, 1], [9, 10, 11]),
            ([0, 4, 4], [8, 8, 8], [0, 3, 4], [9, 8, 11]),
            ([4; 3], [8; 3], [4; 3], [8; 3]),
        ];
        for (low, end, outer, outer_end) in rims {
            let own = VoxelBox { low: low.into(), end: end.into() };
            let rim = Rim { own, within: VoxelBox { low: outer.into(), end: outer_end.into() } };
            let mut random = 1_u64;
            for _ in 0..200 {
                random = random * 48271 % 0x7fff_ffff;
                let wanted = random as Parts;
                let boxes = rim.boxes(wanted);
                let voxels = (0..12).flat_map(|z| (0..12).flat_map(move |y| (0..12).map(move |x| UVec3::new(x, y, z))));
                for voxel in voxels {
                    let is_in = |within: &VoxelBox| within.low.cmple(voxel).all() && voxel.cmplt(within.end).all();
                    let expected = rim.parts().filter(|(bit, part)| wanted & bit != 0 && is_in(part)).count();
                    assert_eq!(boxes.iter().filter(|within| is_in(within)).count(), expected, "{voxel} {wanted:b}");
                }
            }
            let all = rim.boxes(ALL);
            assert!(all.len() == 1 && (all[0].low, all[0].end) == (rim.within.low, rim.within.end));
            assert!(
                rim.boxes(OWN).iter().all(|it| (it.low, it.end) == (own.low, own.end)) && !rim.boxes(OWN).is_empty()
            );
        }
    }
}
