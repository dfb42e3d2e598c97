//! The voxels that may be drawn when values are classified after splatting (SPEC §9), among those of the bricks that may be
//! ([`BrickRanges`]).
//!
//! The reason is the bricks', for one voxel: it bears only on slabs whose values lie between the minimum and the maximum of all coefficients that are
//! nearer to it than two kernel radii and a slab. That sphere holds a third of the voxels of the box around a brick, and what most frames draw is
//! a surface, as thick as these are wide.

use std::ops::Range;

use super::brick_ranges::{Bearing, BrickRanges};
use super::spheres::{Sphere, VoxelSet};
use crate::geometry::plane_geometry::Reach;
use crate::lists::brick::{BrickList, SIDE};
use crate::lists::iso_range::{END, ValueSet, ordinal};
use crate::volume::{ValueSlice, Volume};

/// The voxels that may be drawn, without holes, where some values have an opacity. The ranges must be those of the coefficients.
pub fn shown_voxels(
    (ranges, reach): (&BrickRanges, &Reach),
    (volume, coefficients): (&Volume, ValueSlice<'_>),
    values: &ValueSet,
    bearing: Bearing,
) -> BrickList {
    let are_shown = ranges.shown(values, bearing);
    // A page is to load little code, and draws whole bricks.
    let is_told_apart = bearing != Bearing::All && !cfg!(target_arch = "wasm32");
    let Some(squared) = reach.squared.filter(|_| is_told_apart) else {
        return ranges.brick_list(volume, |brick| are_shown[brick]);
    };
    let (dims, sphere) = (volume.dims(), Sphere::new(squared));
    let [least, greatest] = ranges.all().map(ordinal);
    let set =
        |ordinals: Range<u32>, holds_all: bool| (!holds_all).then(|| VoxelSet::new(dims, coefficients, &ordinals));
    // A range of values is met where a coefficient is at least its start, and one is below its end.
    let sets: Vec<[Option<VoxelSet>; 2]> = (values.ranges().iter())
        .map(|&Range { start, end }| {
            let above = set(start..END, start <= least || bearing == Bearing::Smaller);
            [above, set(0..end, greatest < end || bearing == Bearing::Greater)]
        })
        .collect();
    let (bricks, all) = (dims.map(|n| n.div_ceil(SIDE)), volume.values());
    BrickList::by_rows(volume.grid(), &|y, z, flags: &mut [bool]| {
        let first = (bricks.x * (y / SIDE + bricks.y * (z / SIDE))) as usize;
        let are_shown = &are_shown[first..][..bricks.x as usize];
        if !are_shown.contains(&true) {
            return;
        }
        let row = (dims.x * (y + dims.y * z)) as usize;
        all.slice(row..row + flags.len()).flag(flags, |value| !value.is_nan());
        let mut shown = vec![0; flags.len().div_ceil(64)];
        for sets in &sets {
            let mut both = vec![u64::MAX; shown.len()];
            for set in sets.iter().flatten() {
                both.iter_mut().zip(set.around([y, z], &sphere)).for_each(|(both, near)| *both &= near);
            }
            shown.iter_mut().zip(both).for_each(|(shown, both)| *shown |= both);
        }
        for (at, flag) in flags.iter_mut().enumerate() {
            *flag &= are_shown[at / SIDE as usize] && shown[at / 64] >> (at % 64) & 1 == 1;
        }
    })
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use glam::{DVec3, UVec3};

    use super::*;
    use crate::after::brick_ranges::values_of;
    use crate::settings::transfer_function::{Ramp, TransferFunction};
    use crate::volume::Grid;
    use crate::volume::range::{EMPTY, union};

    /// The voxels that a plain search finds, for opacities above, below, within and between values, in all that values bear on.
    #[test]
    fn voxels_are_those_with_an_opacity_around_them() {
        let grid = Grid::new(UVec3::new(71, 9, 11), DVec3::ONE);
        let value = |index: u32| match index.wrapping_mul(2_654_435_761) >> 22 {
            0 => 0.0,
            1 => 200.0,
            2..60 => f32::NAN,
            _ => 100.0 + (index % 7) as f32,
        };
        let values: Vec<f32> = (0..grid.dims.element_product()).map(value).collect();
        let volume = Volume::new("noise", grid.dims, grid.spacing, values.clone()).unwrap();
        let (squared, along) = (24, UVec3::splat(4));
        let ranges = BrickRanges::new(&grid, volume.values(), along);
        let above = vec![(150.0, 0.0), (160.0, 1.0)];
        let below = vec![(40.0, 1.0), (50.0, 0.0)];
        let between = vec![(149.0, 0.0), (150.0, 1.0), (151.0, 0.0)];
        let ends = vec![(20.0, 1.0), (30.0, 0.0), (180.0, 0.0), (190.0, 1.0)];
        let nothing = vec![(300.0, 0.0), (301.0, 1.0)];
        for opacity in [above, below, between, ends, nothing] {
            let color = Ramp::new(vec![(0.0, DVec3::ONE)]).unwrap();
            let transfer = TransferFunction::by_value(color, Ramp::new(opacity.clone()).unwrap());
            let set = values_of(&volume, &transfer);
            for bearing in [Bearing::Own, Bearing::Greater, Bearing::Smaller, Bearing::All] {
                let are_shown = ranges.shown(&set, bearing);
                let bricks = grid.dims.map(|n| n.div_ceil(SIDE));
                let is_drawn = |&index: &u32| {
                    let at = grid.voxel_at(index);
                    let near = (0..values.len() as u32)
                        .filter(|&other| (grid.voxel_at(other).as_ivec3() - at.as_ivec3()).length_squared() <= 24)
                        .map(|other| values[other as usize]);
                    let [min, max] = near.fold(EMPTY, |ends, value| union(ends, [value; 2]));
                    let [low, high] = bearing.range([min, max]);
                    let brick = at / SIDE;
                    let number = brick.x + bricks.x * (brick.y + bricks.y * brick.z);
                    !values[index as usize].is_nan() && are_shown[number as usize] && set.meets(low, high)
                };
                let expected: Vec<u32> = (0..values.len() as u32).filter(is_drawn).collect();
                let reach = Reach { along, squared: Some(squared) };
                let found = shown_voxels((&ranges, &reach), (&volume, volume.values()), &set, bearing);
                let mut found = found.voxels();
                found.sort_unstable();
                assert!(found == expected, "{opacity:?}, {bearing:?}");
                let all = shown_voxels(
                    (&ranges, &Reach { squared: None, ..reach }),
                    (&volume, volume.values()),
                    &set,
                    bearing,
                );
                assert_eq!(all, ranges.brick_list(&volume, |brick| are_shown[brick]));
            }
        }
    }
}
