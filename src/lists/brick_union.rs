//! The bricks of several lists, as the tile rasterizer walks through them where every channel has its own (SPEC §10).

use crate::lists::brick::{Brick, fit, position};
use crate::parallel::prelude::*;

/// The bricks of several lists, at most 16, as one list, each with the voxels of all, in memory order.
pub fn of(lists: &[&[Brick]]) -> Vec<Brick> {
    let with_list = |(number, bricks): (usize, &&[Brick])| {
        let list = 1_u32 << (16 + number);
        bricks
            .iter()
            .filter(|brick| brick.present != [0; 2])
            .map(move |brick| Brick { extent: list, ..*brick })
            .collect()
    };
    let mut all: Vec<Brick> = lists.iter().enumerate().flat_map::<Vec<Brick>, _>(with_list).collect();
    all.par_sort_unstable_by_key(position);
    all.dedup_by(|other, brick| {
        let is_same = position(other) == position(brick);
        if is_same {
            brick.present = [brick.present[0] | other.present[0], brick.present[1] | other.present[1]];
            brick.extent |= other.extent;
        }
        is_same
    });
    all.par_iter_mut().for_each(|brick| {
        let lists = brick.extent;
        fit(brick);
        brick.extent |= lists;
    });
    all
}
