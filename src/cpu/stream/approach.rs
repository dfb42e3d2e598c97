//! The chunks that a tile comes to: boxes of their voxels, halved until open pixels see one brick's, or see them no more. A chunk's box on the screen is first
//! reached at one of its corners, long before most of its voxels' kernels begin; a brick's is about as small as what is drawn.

use std::collections::BTreeMap;

use glam::UVec3;

use super::Stream;
use crate::cpu::bin::Placed;
use crate::lists::brick::SIDE;

/// A box of a chunk's voxels: the first voxel, and the voxels along each axis.
type VoxelBox = (UVec3, UVec3);

/// Boxes of voxels of chunks that a tile has not come to, by first sheet.
#[derive(Debug, Default)]
pub(in crate::cpu) struct Approach {
    boxes: BTreeMap<i32, Vec<(Placed, VoxelBox)>>,
}

impl Approach {
    pub(in crate::cpu) fn clear(&mut self) {
        self.boxes.clear();
    }

    /// Adds all voxels of a chunk.
    pub(in crate::cpu) fn add(&mut self, stream: &Stream, chunk: &Placed) {
        self.boxes.entry(chunk.first).or_default().push((chunk.clone(), stream.bounds(chunk.brick)));
    }

    /// The next sheet at which a box may be seen.
    pub(in crate::cpu) fn first(&self) -> Option<i32> {
        self.boxes.first_key_value().map(|(&first, _)| first)
    }

    /// Takes out the chunks of which a brick may be seen at a sheet. A box that is not seen when its sheet comes never will be, because pixels never open.
    pub(in crate::cpu) fn reached(
        &mut self,
        stream: &Stream,
        sheet: i32,
        is_seen: impl Fn(&Placed) -> bool,
    ) -> Vec<u32> {
        let mut reached: Vec<u32> = Vec::new();
        while let Some(entry) = self.boxes.first_entry().filter(|entry| *entry.key() <= sheet) {
            for (placed, within) in entry.remove() {
                let number = placed.brick;
                if reached.contains(&number) || !is_seen(&placed) || stream.shows_nothing(number) {
                    continue;
                }
                let halves = halves(within);
                if halves.len() == 1 {
                    reached.push(number);
                    continue;
                }
                for half in halves {
                    if let Some(placed) = stream.place(number, half) {
                        self.boxes.entry(placed.first).or_default().push((placed, half));
                    }
                }
            }
        }
        if !reached.is_empty() {
            self.boxes.values_mut().for_each(|boxes| boxes.retain(|(placed, _)| !reached.contains(&placed.brick)));
            self.boxes.retain(|_, boxes| !boxes.is_empty());
        }
        reached
    }
}

/// The up to eight halves of a box of bricks; the box itself, if it is no larger than a brick.
fn halves((low, dims): VoxelBox) -> Vec<VoxelBox> {
    let mut boxes = vec![(low, dims)];
    for axis in 0..3 {
        let first = (dims[axis] / 2).next_multiple_of(SIDE);
        if dims[axis] <= SIDE {
            continue;
        }
        for at in 0..boxes.len() {
            let (mut low, mut dims) = boxes[at];
            boxes[at].1[axis] = first;
            low[axis] += first;
            dims[axis] -= first;
            boxes.push((low, dims));
        }
    }
    boxes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_are_of_whole_bricks_and_fill_the_box() {
        for dims in [UVec3::new(32, 5, 4), UVec3::new(13, 1, 8), UVec3::new(9, 12, 31), UVec3::splat(64)] {
            let mut open = vec![(UVec3::new(8, 0, 4), dims)];
            let mut voxels = 0;
            while let Some(whole) = open.pop() {
                let halves = halves(whole);
                if halves.len() == 1 {
                    assert_eq!(halves[0], whole);
                    assert!(whole.1.cmple(UVec3::splat(SIDE)).all() && whole.0 % SIDE == UVec3::ZERO, "{whole:?}");
                    voxels += whole.1.element_product();
                } else {
                    open.extend(halves);
                }
            }
            assert_eq!(voxels, dims.element_product());
        }
    }
}
