//! The separable box filter B of SPEC §14, by which light spreads from sheet to sheet.

use crate::parallel::prelude::*;

/// The rows that a thread filters at a time.
const ROWS: usize = 16;

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

    /// `B(light·passed)` in an area of planes of `side` pixels along each side, whose other pixels stay. Beyond the image there is all light. `along_x`
    /// is memory of as many pixels.
    pub(super) fn spread(
        &self,
        side: usize,
        area: Area,
        (light, passed): (&[f32], &[f32]),
        along_x: &mut [f32],
        spread: &mut [f32],
    ) {
        let Area { low: [left, top], end: [right, bottom] } = area;
        let reach = self.reach();
        // Lit pixels beside the area count, and all beyond the image.
        let rows = top.saturating_sub(reach)..(bottom + reach).min(side);
        let strip = &mut along_x[rows.start * side..rows.end * side];
        strip.par_chunks_mut(ROWS * side).enumerate().for_each(|(number, strip)| {
            let mut line = vec![1.0; side + 2 * reach];
            for (to, y) in strip.chunks_exact_mut(side).zip(rows.start + number * ROWS..) {
                let row = y * side..(y + 1) * side;
                for ((to, light), passed) in line[reach..].iter_mut().zip(&light[row.clone()]).zip(&passed[row]) {
                    *to = light * passed;
                }
                self.sum(&mut to[left..right], |offset| &line[(left + reach).wrapping_add_signed(offset)..]);
            }
        });
        let lit = vec![1.0; side];
        let along_x = &*along_x;
        let strip = &mut spread[top * side..bottom * side];
        strip.par_chunks_mut(ROWS * side).enumerate().for_each(|(number, strip)| {
            for (to, y) in strip.chunks_exact_mut(side).zip(top + number * ROWS..) {
                let row = |offset: isize| match y.checked_add_signed(offset) {
                    Some(y) if y < side => &along_x[y * side + left..],
                    _ => &lit[left..],
                };
                self.sum(&mut to[left..right], row);
            }
        });
    }

    /// The weighted sum of lines at all offsets.
    fn sum<'a>(&self, to: &mut [f32], line: impl Fn(isize) -> &'a [f32]) {
        to.iter_mut().zip(line(0)).for_each(|(to, &light)| *to = light * self.weights[0]);
        for (offset, &weight) in (0..).zip(&self.weights).skip(1) {
            for ((to, before), after) in to.iter_mut().zip(line(-offset)).zip(line(offset)) {
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
        let (mut along_x, mut spread) = (vec![0.0; SIDE * SIDE], vec![1.0; SIDE * SIDE]);
        filter.spread(SIDE, area, (&light, &passed), &mut along_x, &mut spread);
        let weight = |offset: usize| filter.weights.get(offset).copied().unwrap_or(0.0);
        for (at, &light) in spread.iter().enumerate() {
            let expected = 1.0 - weight((at % SIDE).abs_diff(x)) * weight((at / SIDE).abs_diff(y));
            assert!((light - expected).abs() < 1e-6, "{at}: {light}, not {expected}");
        }
    }
}
