//! Where values can meet an opacity: two bits for every cell of 1×1×1 voxels between neighbouring voxels.
//!
//! The value at a point is a mean of the coefficients within the kernel's radius, which all points of a cell take from one box of voxels. A slab shows
//! nothing where no voxel in the boxes of its two points reaches the least value with an opacity, or none is as low as the greatest one. Nor does it where
//! no mean does, as voxels beyond a cell's corners have little weight.

use glam::DVec3;

use super::bounds::Bounds;
use crate::after::normalization::Normalization;
use crate::parallel::prelude::*;
use crate::volume::{Grid, Sample, ValueSlice, for_type};

/// A voxel of a cell's box is at least the least number with an opacity.
const REACHES: u8 = 1;
/// A voxel of a cell's box is at most the greatest one.
const STAYS: u8 = 2;

/// Rounding errors of means, relative to the numbers' range, which is about 1.
const SLACK: f32 = 4e-6;

/// The bits of all cells, by the voxel at their least corner.
#[derive(Clone, Debug)]
pub(super) struct Cells {
    bits: Vec<u8>,
}

/// Who computes bits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Work {
    /// All threads.
    Shared,
    /// The current thread, which must not begin other work meanwhile.
    Alone,
}

/// The bits of eight points.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Bits {
    pub(super) reaches: u32,
    pub(super) stays: u32,
}

impl Cells {
    /// `half_box` is half the box of the widest kernel; `shown` the least and the greatest number with an opacity.
    pub(super) fn new(
        grid: &Grid,
        coefficients: ValueSlice<'_>,
        numbers: &Normalization,
        half_box: DVec3,
        shown: [f32; 2],
        work: Work,
    ) -> Self {
        let bits_of = bits_of(numbers, shown);
        let least = if work == Work::Alone { usize::MAX } else { 1 << 16 };
        let mut bits: Vec<u8> = for_type!(ValueSlice, coefficients, all => {
            all.par_iter().with_min_len(least).map(|c| bits_of(c.to_f32())).numbers()
        });
        // From -⌈h⌉ + 1 to ⌈h⌉ around a cell, where a kernel reaches less than h.
        let half = half_box.ceil().min(grid.dims.as_dvec3()).max(DVec3::ONE).as_uvec3();
        let [nx, ny, nz] = grid.dims.to_array().map(|n| n as usize);
        for (axis, stride, count) in [(0, 1, nx), (1, nx, ny), (2, nx * ny, nz)] {
            join(&mut bits, (stride, count), half[axis] as usize, work);
        }
        Self { bits }
    }

    /// Without the bits of cells whose means do not reach the least number with an opacity, or do not stay below the greatest one.
    pub(super) fn within(
        mut self,
        bounds: &Bounds,
        of: (&Grid, ValueSlice<'_>, &Normalization),
        [low, high]: [f32; 2],
    ) -> Self {
        let [least, greatest] = of.2.range;
        if low > least {
            bounds.clear((&mut self.bits, REACHES), of, (1.0, low - SLACK));
        }
        if high < greatest {
            bounds.clear((&mut self.bits, STAYS), of, (-1.0, -high - SLACK));
        }
        self
    }

    /// The bits of a cell, as they are kept.
    pub(super) fn read(&self, index: usize) -> u8 {
        self.bits[index]
    }

    /// Of eight points, given their cells, which those beyond the volume have in common with the nearest point inside.
    #[inline(always)]
    pub(super) fn of(&self, indices: [u32; 8]) -> Bits {
        let cells = u64::from_le_bytes(indices.map(|index| self.bits[index as usize]));
        Bits { reaches: lowest_bits(cells / u64::from(REACHES)), stays: lowest_bits(cells / u64::from(STAYS)) }
    }
}

/// The lowest bits of eight bytes, that of the first one lowest.
#[inline(always)]
fn lowest_bits(bytes: u64) -> u32 {
    // The factor's bits move each of them to its place in the highest byte, where no two meet.
    ((bytes & 0x0101_0101_0101_0101).wrapping_mul(0x0102_0408_1020_4080) >> 56) as u32
}

/// The bits of a coefficient, given the least and the greatest number with an opacity. Neither is set of a hole.
fn bits_of(numbers: &Normalization, [low, high]: [f32; 2]) -> impl Fn(f32) -> u8 + Sync {
    let (base, scale) = (numbers.base as f32, numbers.scale as f32);
    let (low, high) = (low - SLACK, high + SLACK);
    move |c| {
        let number = (c - base) * scale;
        (u8::from(number >= low) * REACHES) | (u8::from(number <= high) * STAYS)
    }
}

/// Whether means of some coefficients may have an opacity.
pub(super) fn may_show(coefficients: ValueSlice<'_>, numbers: &Normalization, shown: [f32; 2]) -> bool {
    let bits_of = bits_of(numbers, shown);
    coefficients.iter().fold(0, |bits, c| bits | bits_of(c)) == REACHES | STAYS
}

/// Replaces each entry along an axis by the union of those from `half - 1` before it to `half` after it.
fn join(bits: &mut [u8], (stride, count): (usize, usize), half: usize, work: Work) {
    let least = if work == Work::Alone { usize::MAX } else { 1 };
    bits.par_chunks_mut(stride * count).with_min_len(least).for_each_init(Vec::new, |joined, block| {
        // With empty entries around. Entry i becomes the union from i on of ever more entries.
        joined.clear();
        joined.resize(stride * (half - 1), 0);
        joined.extend_from_slice(block);
        joined.resize(stride * (count + 2 * half - 1), 0);
        let mut width = 1;
        while width < 2 * half {
            let step = width.min(2 * half - width);
            let shift = stride * step;
            for at in 0..joined.len() - shift {
                joined[at] |= joined[at + shift];
            }
            width += step;
        }
        block.copy_from_slice(&joined[..block.len()]);
    });
}

#[cfg(test)]
mod tests {
    use glam::UVec3;

    use super::*;

    #[test]
    fn the_lowest_bits_of_bytes_are_in_their_order() {
        for lane in 0..8 {
            assert_eq!(lowest_bits(0xff << (8 * lane)), 1 << lane);
        }
        assert_eq!((lowest_bits(u64::MAX), lowest_bits(0xfefe_fefe_fefe_fefe)), (0xff, 0));
    }

    #[test]
    fn a_cell_joins_the_voxels_that_its_points_take_values_from() {
        let grid = Grid::new(UVec3::new(11, 7, 9), DVec3::ONE);
        let value = |index: u32| match index.wrapping_mul(2_654_435_761) >> 24 {
            0..3 => 0.9,
            3..6 => -0.9,
            6..12 => f32::NAN,
            _ => 0.0,
        };
        let values: Vec<f32> = (0..grid.dims.element_product()).map(value).collect();
        let numbers = Normalization { base: 0.0, scale: 1.0, range: [-1.0, 1.0] };
        let half_box = DVec3::new(2.0, 1.4, 2.5);
        for [low, high] in [[0.5, f32::MAX], [f32::MIN, -0.5], [-0.1, 0.1]] {
            let cells = Cells::new(&grid, (&values).into(), &numbers, half_box, [low, high], Work::Shared);
            let alone = Cells::new(&grid, (&values).into(), &numbers, half_box, [low, high], Work::Alone);
            assert_eq!(cells.bits, alone.bits);
            for index in 0..grid.dims.element_product() {
                let at = grid.voxel_at(index).as_dvec3();
                // Points of a cell are within half a cell of its middle.
                let is_near =
                    |&other: &u32| ((grid.voxel_at(other).as_dvec3() - at - 0.5).abs() - 0.5).cmplt(half_box).all();
                let near: Vec<f32> =
                    (0..grid.dims.element_product()).filter(is_near).map(|other| values[other as usize]).collect();
                let bits = cells.of([index; 8]);
                assert_eq!(bits.reaches == 0xff, near.iter().any(|&value| value >= low), "{index}");
                assert_eq!(bits.stays == 0xff, near.iter().any(|&value| value <= high), "{index}");
            }
        }
    }
}
