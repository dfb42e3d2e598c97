//! The separable box filter B of SPEC §14, by which light spreads from sheet to sheet.

use std::ops::Range;

/// The columns that are filtered at a time.
const LINE: usize = 512;

/// A box filter along one axis.
#[derive(Clone, Debug)]
pub(super) struct BoxFilter {
    /// The weights at offsets from 0 on; the last one may be less than the others, which are equal.
    weights: Vec<f32>,
}

/// The pixels of a plane that may differ from 1: columns and rows, each from the first to before the end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Area {
    pub(super) low: [usize; 2],
    pub(super) end: [usize; 2],
}

impl Area {
    /// No pixels.
    pub(super) const NONE: Self = Self { low: [usize::MAX; 2], end: [0; 2] };

    /// The smallest area that holds both.
    pub(super) fn and(self, other: Self) -> Self {
        Self {
            low: [0, 1].map(|axis| self.low[axis].min(other.low[axis])),
            end: [0, 1].map(|axis| self.end[axis].max(other.end[axis])),
        }
    }

    /// The area with some pixels more at each side, in an image of `side` pixels along each side.
    pub(super) fn grown(self, by: usize, side: usize) -> Self {
        if self.is_empty() {
            return self;
        }
        Self { low: self.low.map(|low| low.saturating_sub(by)), end: self.end.map(|end| (end + by).min(side)) }
    }

    pub(super) fn is_empty(&self) -> bool {
        (0..2).any(|axis| self.low[axis] >= self.end[axis])
    }
}

impl BoxFilter {
    /// The filter of a variance in pixels².
    pub(super) fn new(variance: f64) -> Self {
        // The half-width h = whole + rest. That of a whole h is h(h + 1)/3; the rest's weight makes up for what is left.
        let mut whole = 0.0;
        while (whole + 1.0) * (whole + 2.0) / 3.0 <= variance {
            whole += 1.0;
        }
        let squares = whole * (whole + 1.0) * (2.0 * whole + 1.0) / 3.0;
        let next = (whole + 1.0) * (whole + 1.0);
        let rest = (variance * (2.0 * whole + 1.0) - squares) / (2.0 * (next - variance));
        let sum = 2.0 * (whole + rest) + 1.0;
        let mut weights = vec![(1.0 / sum) as f32; whole as usize + 1];
        if rest > 0.0 {
            weights.push((rest / sum) as f32);
        }
        Self { weights }
    }

    /// The greatest offset of a pixel that counts.
    pub(super) fn reach(&self) -> usize {
        self.weights.len() - 1
    }

    /// Filters a row of `light·passed` along itself, from a column to before another. Beyond the image there is all light. `line` is memory.
    pub(super) fn along(
        &self,
        columns: Range<usize>,
        (light, passed): (&[f32], &[f32]),
        line: &mut Vec<f32>,
        to: &mut [f32],
    ) {
        let reach = self.reach();
        line.clear();
        line.resize(reach, 1.0);
        line.extend(light.iter().zip(passed).map(|(light, passed)| light * passed));
        line.resize(light.len() + 2 * reach, 1.0);
        let start = columns.start + reach;
        self.sum(&mut to[columns], |offset| &line[start.wrapping_add_signed(offset)..]);
    }

    /// Filters a row along the columns, from a column to before another, given the rows that have been filtered along themselves at offsets from it; `None`
    /// beyond the image.
    pub(super) fn down<'a>(&self, columns: Range<usize>, row: impl Fn(isize) -> Option<&'a [f32]>, to: &mut [f32]) {
        let lit = [1.0; LINE];
        for start in columns.clone().step_by(LINE) {
            let part = start..(start + LINE).min(columns.end);
            self.sum(&mut to[part.clone()], |offset| row(offset).map_or(&lit[..], |row| &row[part.start..]));
        }
    }

    /// The weighted sum of lines at all offsets.
    fn sum<'a>(&self, to: &mut [f32], line: impl Fn(isize) -> &'a [f32]) {
        let (&weight, rest) = self.weights.split_last().unwrap_or((&1.0, &[]));
        let reach = rest.len() as isize;
        let count = to.len();
        match reach {
            0 => to.copy_from_slice(&line(0)[..count]),
            _ => to.iter_mut().zip(line(0)).for_each(|(to, &light)| *to = light * rest[0]),
        }
        // All but the last have one weight.
        for offset in 1..reach {
            for ((to, before), after) in to.iter_mut().zip(line(-offset)).zip(line(offset)) {
                *to += (before + after) * rest[0];
            }
        }
        if reach > 0 {
            for ((to, before), after) in to.iter_mut().zip(line(-reach)).zip(line(reach)) {
                *to += (before + after) * weight;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_sum_to_one_and_have_their_variance() {
        for variance in [0.0, 0.1, 0.25, 0.5, 2.0 / 3.0, 1.0, 2.0, 3.9, 4.0, 31.7, 128.0] {
            let weights: Vec<f64> = BoxFilter::new(variance).weights.into_iter().map(f64::from).collect();
            let sum = weights[0] + 2.0 * weights[1..].iter().sum::<f64>();
            let squares: f64 = (0_u32..).zip(&weights).map(|(at, weight)| 2.0 * f64::from(at * at) * weight).sum();
            assert!((sum - 1.0).abs() < 1e-6, "{variance}: {sum}");
            assert!((squares - variance).abs() < 1e-6 * (1.0 + variance), "{squares}, not {variance}");
        }
    }

    /// One dark pixel becomes the product of the weights along both axes.
    #[test]
    fn a_dark_pixel_spreads() {
        const SIDE: usize = 11;
        let filter = BoxFilter::new(1.5);
        let (light, mut passed) = (vec![1.0; SIDE * SIDE], vec![1.0; SIDE * SIDE]);
        let [x, y] = [4, 9];
        passed[x + y * SIDE] = 0.0;
        let area = Area { low: [x, y], end: [x + 1, y + 1] }.grown(filter.reach(), SIDE);
        let mut rows = vec![1.0; SIDE * SIDE];
        let mut line = Vec::new();
        for (to, row) in rows.chunks_mut(SIDE).zip(0..) {
            let row = row * SIDE..(row + 1) * SIDE;
            filter.along(area.low[0]..area.end[0], (&light[row.clone()], &passed[row]), &mut line, to);
        }
        let mut spread = vec![1.0; SIDE * SIDE];
        for (to, y) in spread.chunks_mut(SIDE).zip(0_usize..).take(area.end[1]).skip(area.low[1]) {
            let row = |offset| y.checked_add_signed(offset).and_then(|y| rows.chunks(SIDE).nth(y));
            filter.down(area.low[0]..area.end[0], row, to);
        }
        let weight = |offset: usize| filter.weights.get(offset).copied().unwrap_or(0.0);
        for (at, &light) in spread.iter().enumerate() {
            let expected = 1.0 - weight((at % SIDE).abs_diff(x)) * weight((at / SIDE).abs_diff(y));
            assert!((light - expected).abs() < 1e-6, "{at}: {light}, not {expected}");
        }
    }
}
