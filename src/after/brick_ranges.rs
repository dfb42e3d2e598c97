//! The bricks that may be drawn when values are classified after splatting (SPEC §9).
//!
//! The value at a point is a mean of the coefficients within a kernel's radius of it, so a voxel affects only values between the minimum and
//! maximum of all coefficients within two radii of it; and a slab's values lie between those of its two planes. A brick can therefore be left
//! out if no value between the minimum and maximum of all coefficients within two radii and a slab of it has an opacity: every slab that it affects
//! stays transparent without it, whatever values the other bricks then give there. The test needs only the minimum and maximum, which no
//! change of the transfer function changes. Of the bricks that are left, [`shown_voxels`](super::shown_voxels) leaves out voxels.

use glam::UVec3;

use crate::lists::brick::{BrickList, SIDE};
use crate::lists::iso_range::ValueSet;
use crate::parallel::prelude::*;
use crate::settings::splatting::Compositing;
use crate::settings::transfer_function::{Tables, TransferFunction};
use crate::volume::range::{EMPTY, union};
use crate::volume::{Grid, ValueSlice, Volume};

/// The values around a brick that bear on the image, beside those with an opacity, because of how values are composited.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bearing {
    /// No others: every slab counts by its own opacity.
    Own,
    /// Values above any with an opacity, which may be maxima.
    Greater,
    /// Values below any with an opacity, which may be minima.
    Smaller,
    /// All values, which averages are taken of.
    All,
}

impl Bearing {
    /// The values that bear on images composited this way.
    pub fn of(compositing: Compositing) -> Self {
        match compositing {
            Compositing::Maximum => Self::Greater,
            Compositing::Minimum => Self::Smaller,
            Compositing::Average => Self::All,
            _ => Self::Own,
        }
    }

    /// The range in which a value with an opacity makes a brick matter, for the range of the coefficients around the brick.
    pub fn range(self, [min, max]: [f32; 2]) -> [f32; 2] {
        match self {
            Self::Own => [min, max],
            Self::Greater => [f32::MIN, max],
            Self::Smaller => [min, f32::MAX],
            Self::All => [f32::MIN, f32::MAX],
        }
    }
}

/// The minimum and maximum coefficient around every brick of a grid, in memory order of the bricks. Holes are ignored.
#[derive(Clone, Debug, PartialEq)]
pub struct BrickRanges {
    grid: Grid,
    ranges: Vec<[f32; 2]>,
}

impl BrickRanges {
    /// The ranges of all voxels within `reach` of a brick along each axis.
    pub fn new(grid: &Grid, coefficients: ValueSlice<'_>, reach: UVec3) -> Self {
        let [nx, ny, nz] = grid.dims.to_array().map(|n| n as usize);
        let bricks = grid.dims.map(|n| n.div_ceil(SIDE)).to_array().map(|n| n as usize);
        let [rx, ry, rz] = reach.to_array().map(|n| n as usize);
        // One axis after the other: the minimum over a box is the minimum over z of those over y of those over x.
        let of_row = |row: ValueSlice<'_>| -> Vec<[f32; 2]> { row.iter().map(|c| union(EMPTY, [c; 2])).collect() };
        let along_x: Vec<_> =
            coefficients.par_chunks(nx).flat_map_iter(|row| around_bricks(&of_row(row), 1, rx)).collect();
        let along_y = strided(&along_x, bricks[0], ny, ry);
        let along_z = strided(&along_y, bricks[0] * bricks[1], nz, rz);
        Self { grid: *grid, ranges: along_z }
    }

    /// The range around the brick of a voxel.
    #[inline(always)]
    pub fn at(&self, voxel: [u32; 3]) -> [f32; 2] {
        let [nx, ny, _] = self.grid.dims.to_array().map(|n| n.div_ceil(SIDE));
        let [x, y, z] = voxel.map(|n| n / SIDE);
        self.ranges[(x + nx * (y + ny * z)) as usize]
    }

    /// Where they lie in memory.
    #[cfg(test)]
    pub(crate) fn place(&self) -> *const () {
        self.ranges.as_ptr().cast()
    }

    /// Whether each brick may be drawn, where some values have an opacity.
    pub fn shown(&self, values: &ValueSet, bearing: Bearing) -> Vec<bool> {
        let is_shown = |&[min, max]: &[f32; 2]| {
            let [low, high] = bearing.range([min, max]);
            min <= max && values.meets(low, high)
        };
        self.ranges.par_iter().map(is_shown).collect()
    }

    /// The minimum and maximum of all coefficients.
    pub fn all(&self) -> [f32; 2] {
        self.ranges.iter().fold(EMPTY, |all, &range| union(all, range))
    }

    /// The bricks that are wanted, without holes.
    pub fn brick_list(&self, volume: &Volume, is_wanted: impl Fn(usize) -> bool + Sync) -> BrickList {
        let (dims, values) = (self.grid.dims, volume.values());
        let bricks = dims.map(|n| n.div_ceil(SIDE));
        BrickList::by_rows(&self.grid, &|y, z, flags: &mut [bool]| {
            let first = bricks.x * (y / SIDE + bricks.y * (z / SIDE));
            let row = (dims.x * (y + dims.y * z)) as usize;
            for (at, flags) in
                flags.chunks_mut(SIDE as usize).enumerate().filter(|(at, _)| is_wanted(first as usize + at))
            {
                let from = row + at * SIDE as usize;
                values.slice(from..from + flags.len()).flag(flags, |value| !value.is_nan());
            }
        })
    }
}

/// The values that can take part under any of a transfer function's tables.
pub fn values_of(volume: &Volume, transfer: &TransferFunction) -> ValueSet {
    let labels = volume.labels().map(|_| transfer.labels.keys()).into_iter().flatten();
    let tables = labels.map(|&label| transfer.tables(Some(label))).chain([transfer.tables(None)]);
    ValueSet::union_of(tables.map(|tables| values_between(&tables)))
}

/// The values that can take part under some tables, with the `f32`s around the ends of iso-ranges: a field passes through values that no voxel has.
fn values_between(tables: &Tables) -> ValueSet {
    let outwards = |&[low, high]: &[f64; 2]| {
        let ([from, to], nearest) = ([low as f32, high as f32], f64::from);
        let from = if nearest(from) > low { from.next_down() } else { from };
        let to = if nearest(to) < high { to.next_up() } else { to };
        [nearest(from), nearest(to)]
    };
    let iso_ranges = tables.iso_ranges.map(|ranges| ranges.iter().map(outwards).collect::<Vec<_>>());
    ValueSet::of_tables(&Tables { iso_ranges: iso_ranges.as_deref(), ..*tables })
}

/// The range of positions within `reach` of each brick along an axis.
fn around(count: usize, reach: usize) -> impl Iterator<Item = std::ops::Range<usize>> {
    let side = SIDE as usize;
    (0..count).step_by(side).map(move |first| first.saturating_sub(reach)..(first + side + reach).min(count))
}

/// The ranges around bricks along an axis whose steps are `stride` apart, `count` steps in a row.
fn strided(ends: &[[f32; 2]], stride: usize, count: usize, reach: usize) -> Vec<[f32; 2]> {
    ends.par_chunks(stride * count).flat_map_iter(|block| around_bricks(block, stride, reach)).collect()
}

/// The ranges around bricks along the outermost axis of a block, whose steps are `stride` apart. Over groups as long as what is around a brick, the
/// range from the group's start to each step, and from each step to its end, is found once: what is around a brick lies in two groups (van Herk 1992,
/// doi:10.1016/0167-8655(92)90069-C), so that the time does not grow with the reach, which is long where a picture is small.
fn around_bricks(block: &[[f32; 2]], stride: usize, reach: usize) -> Vec<[f32; 2]> {
    let count = block.len() / stride;
    let length = SIDE as usize + 2 * reach.min(count);
    let (mut from_start, mut to_end) = (block.to_vec(), block.to_vec());
    for group in from_start.chunks_mut(length * stride) {
        (stride..group.len()).for_each(|at| group[at] = union(group[at - stride], group[at]));
    }
    for group in to_end.chunks_mut(length * stride) {
        (0..group.len() - stride).rev().for_each(|at| group[at] = union(group[at], group[at + stride]));
    }
    let mut ranges = Vec::with_capacity(count.div_ceil(SIDE as usize) * stride);
    for around in around(count, reach) {
        let (first, last) = (around.start, around.end - 1);
        ranges.extend((0..stride).map(|at| {
            let (to_end, from_start) = (to_end[first * stride + at], from_start[last * stride + at]);
            match (first / length == last / length, first.is_multiple_of(length)) {
                (false, _) => union(to_end, from_start),
                (true, true) => from_start,
                // The axis ends within the group.
                (true, false) => to_end,
            }
        }));
    }
    ranges
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::settings::transfer_function::Ramp;

    #[test]
    fn extremes_are_those_of_all_voxels_around() {
        let grid = Grid::new(UVec3::new(29, 6, 17), DVec3::ONE);
        let value =
            |index: u32| if index % 29 == 3 { f32::NAN } else { (index.wrapping_mul(2_654_435_761) >> 20) as f32 };
        let values: Vec<f32> = (0..grid.dims.element_product()).map(value).collect();
        let bricks = grid.dims.map(|n| n.div_ceil(SIDE));
        for reach in [UVec3::new(2, 5, 1), UVec3::new(0, 1, 2), UVec3::new(3, 0, 4), UVec3::new(40, 2, 9)] {
            let ours = BrickRanges::new(&grid, (&values).into(), reach);
            assert_eq!(ours.ranges.len() as u32, bricks.element_product());
            for (at, &ends) in (0..).zip(&ours.ranges) {
                let first = UVec3::new(at % bricks.x, at / bricks.x % bricks.y, at / (bricks.x * bricks.y)) * SIDE;
                let (low, high) = (first.saturating_sub(reach), (first + SIDE + reach).min(grid.dims));
                let inside = |&index: &u32| {
                    let voxel = grid.voxel_at(index);
                    voxel.cmpge(low).all() && voxel.cmplt(high).all()
                };
                let found = (0..values.len() as u32).filter(inside).map(|index| values[index as usize]);
                assert_eq!(ends, found.fold(EMPTY, |ends, value| union(ends, [value; 2])), "{at}, {reach}");
            }
        }
    }

    /// A peak of opacity between the values of two voxels shows although neither voxel has an opacity.
    #[test]
    fn bricks_meet_opacities_between_values() {
        let grid = Grid::new(UVec3::new(24, 4, 4), DVec3::ONE);
        let values = (0..384).map(|index| if index % 24 < 12 { 0.0 } else { 100.0 }).collect();
        let volume = Volume::new("step", grid.dims, grid.spacing, values).unwrap();
        let opacity = Ramp::new(vec![(49.0, 0.0), (50.0, 1.0), (51.0, 0.0)]).unwrap();
        let transfer = TransferFunction::by_value(Ramp::new(vec![(0.0, DVec3::ONE)]).unwrap(), opacity);
        let ranges = BrickRanges::new(&grid, volume.values(), UVec3::splat(5));
        let values = values_of(&volume, &transfer);
        let shown = ranges.shown(&values, Bearing::Own);
        assert_eq!(shown, [false, true, true, true, true, false]);
        assert_eq!(ranges.brick_list(&volume, |brick| shown[brick]).voxels().len(), 4 * 64);
        // A maximum of 100 hides the peak, a minimum of 0 too, and both are in averages.
        assert_eq!(ranges.shown(&values, Bearing::Greater), [false, true, true, true, true, true]);
        assert_eq!(ranges.shown(&values, Bearing::Smaller), [true, true, true, true, true, false]);
        assert_eq!(ranges.shown(&values, Bearing::All), [true; 6]);
    }
}
