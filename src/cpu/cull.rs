//! Early splat elimination (§6, SPEC §6): which pixels of a tile are opaque, and whether any pixel of a footprint's box is not. The same
//! decision as `shaders/cull_voxels.wgsl`; pixels outside of the tile are other tiles' to draw.

use std::ops::Range;

use fearless_simd::prelude::*;
use fearless_simd::{f32x8, i32x8};

use super::sheets::{COLUMNS, ROWS};
use super::vector::LANES;
use crate::settings::window::Region;

/// The number of levels of joined rows: 1, 2, 4, … rows.
const LEVELS: usize = ROWS.ilog2() as usize + 1;

/// The pixels of a tile that are not opaque yet.
#[derive(Clone, Debug)]
pub(super) struct OpenMask {
    /// `joined[l][y]`: for every column whether any of 2^l rows from y on has an open pixel.
    joined: [[u32; ROWS]; LEVELS],
    /// The bits of the rows that lie in the image.
    rows: u64,
    /// The pixels found to be opaque that are still open: the bits of their rows, and of their columns.
    found_rows: u64,
    found: [u32; ROWS],
}

/// The pixels of a tile whose centres lie within a box: first and last column and row. Never empty.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Pixels {
    pub(super) columns: [usize; 2],
    pub(super) rows: [usize; 2],
}

impl Pixels {
    /// The pixels within a box, given by its centre in pixel coordinates whose whole numbers are pixel centres, and half its size.
    pub(super) fn within(center: [f32; 2], half: [f32; 2]) -> Option<Self> {
        let of_axis = |axis: usize, count: usize| {
            let last_pixel = count as f32 - 1.0;
            let first = -floor(-(center[axis] - half[axis]).clamp(0.0, count as f32));
            let last = floor((center[axis] + half[axis]).clamp(-1.0, last_pixel));
            (first <= last).then_some([first as usize, last as usize])
        };
        Some(Self { columns: of_axis(0, COLUMNS)?, rows: of_axis(1, ROWS)? })
    }
}

/// For each of eight boxes, the first and last column and row of a tile's pixels inside it. Where a box contains no pixel, a first number is larger than
/// its last one.
pub(super) struct Boxes {
    columns: [[i32; LANES]; 2],
    rows: [[i32; LANES]; 2],
}

impl Boxes {
    /// As [`Pixels::within`].
    #[inline(always)]
    pub(super) fn within<S: Simd>(simd: S, centers: &[[f32; LANES]; 2], half: &[[f32; LANES]; 2]) -> Self {
        let [columns, rows] = [COLUMNS as f32, ROWS as f32];
        Self {
            columns: Self::of_axis(simd, &centers[0], &half[0], columns),
            rows: Self::of_axis(simd, &centers[1], &half[1], rows),
        }
    }

    #[inline(always)]
    fn of_axis<S: Simd>(simd: S, centers: &[f32; LANES], half: &[f32; LANES], count: f32) -> [[i32; LANES]; 2] {
        let splat = |number: f32| f32x8::splat(simd, number);
        let (centers, half) = (f32x8::load_array_ref(simd, centers), f32x8::load_array_ref(simd, half));
        let first = (centers - half).max(splat(0.0)).min(splat(count)).ceil();
        let last = (centers + half).max(splat(-1.0)).min(splat(count - 1.0)).floor();
        [first.to_int::<i32x8<S>>().to_array(), last.to_int::<i32x8<S>>().to_array()]
    }

    /// Those of one box.
    #[inline(always)]
    pub(super) fn pixels(&self, lane: usize) -> Option<Pixels> {
        let of = |axis: &[[i32; LANES]; 2]| [axis[0][lane] as usize, axis[1][lane] as usize];
        let is_any = self.columns[0][lane] <= self.columns[1][lane] && self.rows[0][lane] <= self.rows[1][lane];
        is_any.then(|| Pixels { columns: of(&self.columns), rows: of(&self.rows) })
    }
}

/// The largest integer that is not above a small number, without the system's `floor` or a branch.
#[inline(always)]
fn floor(x: f32) -> i32 {
    // Adding 1.5·2²³ rounds to a whole number, which is then in the low bits.
    const MAGIC: f32 = 12_582_912.0;
    let sum = x + MAGIC;
    let whole = sum.to_bits() as i32 - MAGIC.to_bits() as i32;
    whole - i32::from(sum - MAGIC > x)
}

impl OpenMask {
    /// The first columns and rows of a tile.
    pub(super) fn new(columns: usize, rows: usize) -> Self {
        let bits = u32::MAX >> (COLUMNS - columns);
        let rows_in_image = u64::MAX >> (u64::BITS as usize - rows);
        let mut mask = Self { joined: [[0; ROWS]; LEVELS], rows: rows_in_image, found_rows: 0, found: [0; ROWS] };
        mask.joined[0][..rows].fill(bits);
        mask.join();
        mask
    }

    /// Marks the pixels as opaque that lie outside a region of the image; `origin` is the tile's first pixel.
    pub(super) fn close_outside(&mut self, region: &Region, origin: [usize; 2]) {
        let within = |pixels: Range<usize>, axis: usize, count: usize| {
            pixels.start.saturating_sub(origin[axis]).min(count)..pixels.end.saturating_sub(origin[axis]).min(count)
        };
        let (columns, rows) = (within(region.columns(), 0, COLUMNS), within(region.rows(), 1, ROWS));
        for row in 0..ROWS {
            let is_open = rows.contains(&row) && !columns.is_empty();
            let kept = if is_open { columns_between(columns.start, columns.end - 1) } else { 0 };
            self.close(row, !kept);
        }
        self.join();
    }

    /// The bits of the rows that lie in the image.
    pub(super) fn rows(&self) -> u64 {
        self.rows
    }

    /// The bits of the open columns of a row.
    pub(super) fn row(&self, row: usize) -> u32 {
        self.joined[0][row]
    }

    /// The bits of some open columns of a row, from one on; none behind the last row.
    #[inline(always)]
    pub(super) fn bits(&self, row: usize, column: usize, count: usize) -> u64 {
        let bits = if row < ROWS { self.joined[0][row] } else { 0 };
        u64::from(bits >> column & !(u32::MAX << count))
    }

    /// Marks pixels of a row as opaque. [`Self::sees`] takes them into account after [`Self::join`].
    pub(super) fn close(&mut self, row: usize, opaque: u32) {
        self.joined[0][row] &= !opaque;
    }

    /// Notes open pixels of a row as opaque, which stay open until [`Self::close_found`].
    #[inline(always)]
    pub(super) fn find(&mut self, row: usize, opaque: u32) {
        let found = opaque & self.row(row);
        if found != 0 {
            self.found[row] |= found;
            self.found_rows |= 1 << row;
        }
    }

    /// Closes the pixels that were found to be opaque.
    #[inline(always)]
    pub(super) fn close_found(&mut self) {
        if self.found_rows == 0 {
            return;
        }
        while self.found_rows != 0 {
            let row = self.found_rows.trailing_zeros() as usize;
            self.found_rows &= self.found_rows - 1;
            let found = std::mem::take(&mut self.found[row]);
            self.close(row, found);
        }
        self.join();
    }

    /// Computes the joined rows again.
    #[inline(always)]
    pub(super) fn join(&mut self) {
        for level in 1..LEVELS {
            let step = 1 << (level - 1);
            for row in 0..ROWS {
                let below = if row + step < ROWS { self.joined[level - 1][row + step] } else { 0 };
                self.joined[level][row] = self.joined[level - 1][row] | below;
            }
        }
    }

    /// Marks the pixels as opaque whose rays show nothing.
    pub(super) fn close_empty(&mut self, shown: &[[[f32; COLUMNS]; 2]]) {
        for (row, [start, end]) in shown.iter().enumerate() {
            let empty = (0..COLUMNS).filter(|&x| end[x] <= start[x]).fold(0, |bits, x| bits | 1 << x);
            self.close(row, empty);
        }
        self.join();
    }

    /// Whether all pixels are opaque.
    pub(super) fn is_closed(&self) -> bool {
        self.joined[LEVELS - 1][0] == 0
    }

    /// Whether any pixel of a box is open.
    #[inline(always)]
    pub(super) fn sees(&self, pixels: &Pixels) -> bool {
        let Pixels { columns: [left, right], rows: [first, last] } = *pixels;
        let level = (last + 1 - first).ilog2() as usize;
        let open = self.joined[level][first] | self.joined[level][last + 1 - (1 << level)];
        open & columns_between(left, right) != 0
    }
}

/// The bits of columns from one to another, both included.
#[inline(always)]
pub(super) fn columns_between(first: usize, last: usize) -> u32 {
    u32::MAX << first & u32::MAX >> (COLUMNS - 1 - last)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_is_seen_while_any_of_its_pixels_is_open() {
        let mut mask = OpenMask::new(30, 25);
        let mut bits = 12_345_u32;
        for round in 0..40 {
            for row in 0..ROWS {
                bits = bits.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
                // The generator's low bits repeat after a few rows.
                let mixed = (bits ^ bits >> 16).wrapping_mul(0x9e37_79b9);
                let mixed = mixed ^ mixed >> 15;
                mask.close(row, if round < 4 { mixed & mixed >> 7 } else { mixed | mixed << 3 });
            }
            mask.join();
            for (left, right, first, last) in (0..200_usize).map(|i| (i % 30, (i * 7) % 32, (i * 3) % 32, (i * 5) % 32))
            {
                let pixels =
                    Pixels { columns: [left.min(right), left.max(right)], rows: [first.min(last), first.max(last)] };
                let is_open = |row: usize| (pixels.columns[0]..=pixels.columns[1]).any(|x| mask.row(row) >> x & 1 == 1);
                let expected = (pixels.rows[0]..=pixels.rows[1]).any(is_open);
                assert_eq!(mask.sees(&pixels), expected, "{round} {pixels:?}");
            }
        }
        assert!(mask.is_closed());
    }

    #[test]
    fn pixels_are_those_whose_centers_are_within() {
        let within = |x: f32, y: f32, half: f32| Pixels::within([x, y], [half, half]);
        assert_eq!(within(3.5, 4.0, 1.0), Some(Pixels { columns: [3, 4], rows: [3, 5] }));
        assert_eq!(within(-1.5, 4.0, 2.0), Some(Pixels { columns: [0, 0], rows: [2, 6] }));
        assert_eq!(within(-1.5, 4.0, 1.0), None);
        assert_eq!(within(3.5, 4.0, 0.4), None);
        let whole = Pixels { columns: [0, COLUMNS - 1], rows: [0, ROWS - 1] };
        assert_eq!(within(31.0, 40.0, f32::INFINITY), Some(whole));
    }
}
