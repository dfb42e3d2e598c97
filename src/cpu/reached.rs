//! The open pixels that a footprint reaches (§6, SPEC §6), listed before anything is added to them: what is computed for each of them fills vectors, and
//! the loop that adds has no branch.

use fearless_simd::prelude::*;

use super::cull::{OpenMask, Pixels};
use super::sheets::{COLUMNS, ROWS};
use super::vector::LANES;

/// The pixels of the largest vector: two rows of eight.
pub(super) const WIDEST: usize = 2 * LANES;

/// The pixels from which on a list is full.
const FULL: usize = 512;

/// A footprint more fits in, whatever its size, and a whole vector behind its last pixel.
const CAPACITY: usize = FULL + ROWS * COLUMNS + WIDEST;

/// A list of pixels, those of one footprint after those of another.
#[derive(Debug)]
pub(super) struct Reached {
    pub(super) count: usize,
    /// Their indices in the tile.
    pub(super) pixels: Box<[u32; CAPACITY]>,
    /// Numbers for each of them; what they mean depends on who lists them.
    pub(super) numbers: Box<[[f32; CAPACITY]; 2]>,
}

impl Reached {
    pub(super) fn new() -> Self {
        Self { count: 0, pixels: Box::new([0; CAPACITY]), numbers: Box::new([[0.0; CAPACITY]; 2]) }
    }

    /// Whether there may be no room for another footprint.
    pub(super) fn is_full(&self) -> bool {
        self.count >= FULL
    }

    /// Lists the open pixels of a box that a footprint reaches. `footprint` tells of a vector of pixels, given by their offsets from its centre, which are
    /// reached, and numbers for them. It must be inlined, or its vectors would be computed by calls.
    #[inline(always)]
    pub(super) fn list<S: Simd, V: SimdFloat<S, Element = f32>, const N: usize>(
        &mut self,
        simd: S,
        center: [f32; 2],
        pixels: &Pixels,
        open: &OpenMask,
        footprint: impl Fn([V; 2]) -> (V::Mask, [V; N]),
    ) {
        let (across, down) = if V::LEN > LANES { (LANES, V::LEN / LANES) } else { (V::LEN, 1) };
        let Pixels { columns: [left, right], rows: [first, last] } = *pixels;
        let (list, lists) = (&mut *self.pixels, &mut *self.numbers);
        let mut count = self.count.min(FULL);
        let mut column = left;
        while column <= right {
            // A difference of whole numbers and the centre is rounded once, wherever a vector begins.
            let dx = V::from_slice(simd, &COLUMN[..V::LEN]) + column as f32 - center[0];
            let mut rows = V::from_slice(simd, &ROW[..V::LEN]) + first as f32;
            let mut indices = V::Bits::from_slice(simd, &INDEX[..V::LEN]) + (first * COLUMNS + column) as u32;
            let mut row = first;
            while row <= last {
                let (is_reached, numbers) = footprint([dx, rows - center[1]]);
                let mut bits = 0;
                for next in 0..down {
                    bits |= open.bits(row + next, column, across) << (next * across);
                }
                bits &= is_reached.to_bitmask();
                let listed = V::Mask::from_bitmask(simd, bits);
                indices
                    .compress(<V::Bits as SimdBase<S>>::Mask::from_bitmask(simd, bits))
                    .store_slice(&mut list[count..count + V::LEN]);
                for (list, numbers) in lists.iter_mut().zip(&numbers) {
                    numbers.compress(listed).store_slice(&mut list[count..count + V::LEN]);
                }
                count += bits.count_ones() as usize;
                rows += down as f32;
                indices += (down * COLUMNS) as u32;
                row += down;
            }
            column += across;
        }
        self.count = count;
    }
}

/// The columns of a vector's pixels, counted from the first one, their rows, and their indices in a tile: in rows of eight.
const COLUMN: [f32; WIDEST] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];
const ROW: [f32; WIDEST] = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0];
const INDEX: [u32; WIDEST] = {
    let mut all = [0; WIDEST];
    let mut at = 0;
    while at < WIDEST {
        all[at] = (at / LANES * COLUMNS + at % LANES) as u32;
        at += 1;
    }
    all
};

#[cfg(test)]
mod tests {
    use fearless_simd::{Level, Simd};

    use super::*;
    use crate::cpu::simd::{Simd as InstructionSet, dispatch};

    /// ρ² of an offset.
    fn squared(dx: f32, dy: f32) -> f32 {
        dx * dx + dy * dy * 1.3
    }

    /// Lists a footprint whose ρ² is below a limit.
    fn list<S: Simd>(
        simd: S,
        (center, limit): ([f32; 2], f32),
        pixels: &Pixels,
        open: &OpenMask,
        reached: &mut Reached,
    ) {
        reached.list(simd, center, pixels, open, |[dx, dy]: [S::f32s; 2]| {
            let rho_squared = dx * dx + dy * dy * 1.3;
            (rho_squared.simd_lt(S::f32s::splat(simd, limit)), [rho_squared])
        });
    }

    /// Every instruction set lists the pixels that are open and reached, each once, with numbers of the same bits, whatever its vectors cover.
    #[test]
    fn pixels_are_listed_that_are_open_and_reached() {
        let mut open = OpenMask::new(COLUMNS - 1, ROWS - 2);
        (0..ROWS).for_each(|row| open.close(row, 0x8421_0401_u32.rotate_left(row as u32 * 7)));
        open.join();
        let mut state = 1_u32;
        let mut random = || {
            state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        // Near the tile's first pixel offsets from a centre are rounded.
        let mut footprints: Vec<([f32; 2], f32)> =
            (0..300).map(|_| ([0.7 * random() - 0.3, 70.0 * random() - 3.0], 40.0 * random())).collect();
        footprints.extend([([33.0, -2.5], 50.0), ([5.5, 5.5], 0.1), ([16.0, 31.0], 1e4)]);
        let levels =
            InstructionSet::available().into_iter().map(|set| set.checked().ok()).collect::<Option<Vec<Level>>>();
        for level in levels.into_iter().flatten() {
            for pair in footprints.windows(2) {
                let (mut reached, mut expected) = (Reached::new(), Vec::new());
                for &(center, limit) in pair {
                    let half = [limit.sqrt() + 0.01; 2];
                    let Some(pixels) = Pixels::within(center, half) else { continue };
                    dispatch!(level, simd => list(simd, (center, limit), &pixels, &open, &mut reached));
                    let all = (0..ROWS).flat_map(|row| (0..COLUMNS).map(move |column| (row, column)));
                    let seen = all.filter(|&(row, column)| open.row(row) >> column & 1 == 1);
                    let listed = seen.filter_map(|(row, column)| {
                        let number = squared(column as f32 - center[0], row as f32 - center[1]);
                        (number < limit).then_some(((row * COLUMNS + column) as u32, number.to_bits()))
                    });
                    let first = expected.len();
                    expected.extend(listed);
                    let pixels = reached.pixels[first..reached.count].iter();
                    let numbers = reached.numbers[0][first..reached.count].iter().map(|number| number.to_bits());
                    let mut of_footprint: Vec<(u32, u32)> = pixels.copied().zip(numbers).collect();
                    of_footprint.sort_unstable();
                    assert_eq!(of_footprint, expected[first..], "{level:?} {center:?}");
                }
                assert!(reached.count == expected.len());
            }
        }
    }
}
