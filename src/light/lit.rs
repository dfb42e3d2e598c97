//! Which pixels of light sheets have light (SPEC §14): what lies where none has is left out.

use std::ops::Range;

use super::box_filter::Area;

/// The least light that counts.
const DARK: f32 = 1e-4;

/// The pixels of some rows of a plane that have light, as bits.
#[derive(Debug)]
pub(super) struct Lit {
    /// The words of a row.
    across: usize,
    /// The first row.
    first: usize,
    words: Vec<u64>,
}

/// The pixels of a word.
const WORD: usize = u64::BITS as usize;

impl Lit {
    /// The pixels in which a plane of any of several stacks has light, of some rows of `side` pixels.
    pub(super) fn of(planes: &[&[f32]], side: usize, rows: Range<usize>) -> Self {
        let (across, first) = (side.div_ceil(WORD), rows.start);
        let mut words = vec![0; across * rows.len()];
        for (words, y) in words.chunks_mut(across).zip(rows) {
            for plane in planes {
                for (word, pixels) in words.iter_mut().zip(plane[y * side..(y + 1) * side].chunks(WORD)) {
                    let bits = pixels.iter().rev().fold(0, |bits, &light| bits << 1 | u64::from(light >= DARK));
                    *word |= bits;
                }
            }
        }
        Self { across, first, words }
    }

    /// Whether no pixel of an area has light, in these rows.
    pub(super) fn is_dark(&self, Area { low, end }: &Area) -> bool {
        let [left, right] = [low[0], end[0]];
        if left >= right {
            return true;
        }
        let (first, last) = (left / WORD, (right - 1) / WORD);
        let is_lit = |row: usize| {
            let row = &self.words[row * self.across..][..self.across];
            (first..=last).any(|word| {
                let from = u64::MAX << left.saturating_sub(word * WORD).min(WORD - 1);
                let to = u64::MAX >> (WORD - (right - word * WORD).min(WORD));
                row[word] & from & to != 0
            })
        };
        let rows = |row: usize| row.saturating_sub(self.first).min(self.words.len() / self.across);
        !(rows(low[1])..rows(end[1])).any(is_lit)
    }

    /// The windows of W×W pixels in which any of these rows' pixels has light, by their last pixel.
    pub(super) fn windows<const W: usize>(&self, side: usize) -> Self {
        let across = (side + W - 1).div_ceil(WORD);
        let rows = self.words.len() / self.across;
        // Every row with the pixels to the left of lit ones' windows, and then every row with those above.
        let mut words = vec![0; across * (rows + W - 1)];
        let mut row = vec![0; across];
        for (y, lit) in self.words.chunks(self.across).enumerate() {
            row.fill(0);
            for shift in 0..W {
                for (at, &word) in lit.iter().enumerate() {
                    row[at] |= word << shift;
                    if shift > 0 && at + 1 < across {
                        row[at + 1] |= word >> (WORD - shift);
                    }
                }
            }
            for words in words[y * across..(y + W) * across].chunks_mut(across) {
                words.iter_mut().zip(&row).for_each(|(word, row)| *word |= row);
            }
        }
        Self { across, first: self.first, words }
    }

    /// Whether a pixel's bit is set.
    #[inline(always)]
    pub(super) fn has(&self, [x, y]: [usize; 2]) -> bool {
        self.words[(y - self.first) * self.across + x / WORD] >> (x % WORD) & 1 == 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn areas_are_dark_where_no_pixel_is_lit() {
        const SIDE: usize = 131;
        let mut plane = vec![0.0; SIDE * SIDE];
        let lit = [[0, 0], [63, 5], [64, 70], [130, 130], [127, 9]];
        lit.iter().for_each(|&[x, y]| plane[x + y * SIDE] = 0.5);
        let found = Lit::of(&[&plane], SIDE, 0..SIDE);
        for low in [[0, 0], [1, 0], [60, 4], [64, 4], [65, 60], [120, 1], [128, 128], [131, 131]] {
            for size in [[1, 1], [3, 9], [5, 70], [71, 12], [131, 131]] {
                let end = [0, 1].map(|axis| (low[axis] + size[axis]).min(SIDE));
                let is_in = |&[x, y]: &[usize; 2]| (low[0]..end[0]).contains(&x) && (low[1]..end[1]).contains(&y);
                assert_eq!(found.is_dark(&Area { low, end }), !lit.iter().any(is_in), "{low:?} {end:?}");
            }
        }
        let some = Lit::of(&[&plane], SIDE, 8..70);
        assert!(
            some.is_dark(&Area { low: [60, 0], end: [70, 8] })
                && !some.is_dark(&Area { low: [127, 0], end: [128, 90] })
        );
        assert!(some.windows::<4>(SIDE).has([129, 11]) && !some.windows::<4>(SIDE).has([129, 13]));
        let windows = found.windows::<4>(SIDE);
        for (x, y) in (0..SIDE + 3).flat_map(|y| (0..SIDE + 3).map(move |x| (x, y))) {
            let is_in = |&[a, b]: &[usize; 2]| a <= x && x < a + 4 && b <= y && y < b + 4;
            assert_eq!(windows.has([x, y]), lit.iter().any(is_in), "{x} {y}");
        }
    }
}
