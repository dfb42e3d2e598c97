//! Compositing of one sheet of a tile, eq. 2 and SPEC §5; the same as `shaders/composite.wgsl`.

use fearless_simd::f32x8;
use fearless_simd::prelude::*;

use super::cull::OpenMask;
use super::cut::TileCuts;
use super::sheets::{Buffers, CHANNELS, COLUMNS, STRIDE};
use super::vector::{LANES, saturation};
use crate::settings::splatting::{Compositing, Order};

/// How sheets meet the compositing buffer.
#[derive(Clone, Copy, Debug)]
pub(super) struct Compositor {
    pub(super) compositing: Compositing,
    pub(super) order: Order,
    /// The opacity from which a pixel is opaque, where opaque pixels hide what is behind them.
    pub(super) threshold: Option<f32>,
}

impl Compositor {
    /// Composites the sheet of a slot, clears it, and closes the pixels that became opaque.
    #[inline(always)]
    pub(super) fn composite<S: Simd>(
        &self,
        simd: S,
        buffers: &mut Buffers,
        slot: usize,
        cut: Option<(&TileCuts, f32)>,
        open: &mut OpenMask,
    ) {
        let Buffers { sheets, written, acc } = buffers;
        let mut rows = std::mem::take(&mut written[slot]);
        let mut has_closed = false;
        while rows != 0 {
            let row = rows.trailing_zeros() as usize;
            rows &= rows - 1;
            let sheet = &mut sheets[row][slot];
            let mut opaque = match cut {
                None => self.row(simd, &mut acc[row], sheet),
                Some((cuts, begin)) => {
                    let ended = cut_row(simd, &cuts.rows[row], begin, sheet);
                    let opaque = self.row(simd, &mut acc[row], sheet);
                    opaque | if self.threshold.is_some() { ended } else { 0 }
                }
            };
            opaque &= open.row(row);
            *sheet = [[0.0; STRIDE]; CHANNELS];
            if opaque != 0 {
                open.close(row, opaque);
                has_closed = true;
            }
        }
        if has_closed {
            open.join();
        }
    }

    /// Composites a row; which of its pixels are opaque, if that matters.
    #[inline(always)]
    fn row<S: Simd>(&self, simd: S, acc: &mut [[f32; COLUMNS]; CHANNELS], sheet: &[[f32; STRIDE]; CHANNELS]) -> u32 {
        let mut opaque = 0;
        for at in (0..COLUMNS).step_by(LANES) {
            let after = self.pixels(simd, load_pixels(simd, acc, at), load_pixels(simd, sheet, at));
            for (channel, after) in acc.iter_mut().zip(after) {
                after.store_slice(&mut channel[at..at + LANES]);
            }
            if let Some(threshold) = self.threshold {
                let is_opaque = after[3].simd_ge(f32x8::splat(simd, threshold));
                opaque |= (is_opaque.to_bitmask() as u32) << at;
            }
        }
        opaque
    }

    /// Composites eight pixels.
    #[inline(always)]
    fn pixels<S: Simd>(&self, simd: S, acc: [f32x8<S>; 4], sheet: [f32x8<S>; 4]) -> [f32x8<S>; 4] {
        let one = f32x8::splat(simd, 1.0);
        let sheet = match self.compositing {
            Compositing::Linear => scaled(sheet, one / sheet[3].max(one)),
            Compositing::Exponential => scaled(sheet, saturation(simd, sheet[3])),
            _ => sheet,
        };
        // What rounding leaves beyond full opacity must not count against anything.
        let zero = f32x8::splat(simd, 0.0);
        match (self.compositing, self.order) {
            (Compositing::Xray, _) => sum(acc, sheet),
            (_, Order::FrontToBack) => sum(acc, scaled(sheet, (one - acc[3]).max(zero))),
            (_, Order::BackToFront) => sum(sheet, scaled(acc, (one - sheet[3]).max(zero))),
        }
    }
}

/// Leaves of a row of a sheet, which begins at `begin`, what shows of it; the pixels of which nothing behind it shows.
#[inline(always)]
fn cut_row<S: Simd>(
    simd: S,
    [start, end]: &[[f32; COLUMNS]; 2],
    begin: f32,
    sheet: &mut [[f32; STRIDE]; CHANNELS],
) -> u32 {
    let mut ended = 0;
    for at in (0..COLUMNS).step_by(LANES) {
        let start = f32x8::from_slice(simd, &start[at..at + LANES]);
        let end = f32x8::from_slice(simd, &end[at..at + LANES]);
        let far = f32x8::splat(simd, begin + 1.0);
        let share = (end.min(far) - start.max(f32x8::splat(simd, begin))).max(f32x8::splat(simd, 0.0));
        for channel in sheet.iter_mut() {
            let pixels = &mut channel[at..at + LANES];
            (f32x8::from_slice(simd, pixels) * share).store_slice(pixels);
        }
        ended |= (end.simd_le(far).to_bitmask() as u32) << at;
    }
    ended
}

#[inline(always)]
fn load_pixels<S: Simd, const N: usize>(simd: S, row: &[[f32; N]; CHANNELS], at: usize) -> [f32x8<S>; 4] {
    let [red, green, blue, alpha] = row;
    let load = |channel: &[f32; N]| f32x8::from_slice(simd, &channel[at..at + LANES]);
    [load(red), load(green), load(blue), load(alpha)]
}

#[inline(always)]
fn scaled<S: Simd>([red, green, blue, alpha]: [f32x8<S>; 4], by: f32x8<S>) -> [f32x8<S>; 4] {
    [red * by, green * by, blue * by, alpha * by]
}

#[inline(always)]
fn sum<S: Simd>(a: [f32x8<S>; 4], b: [f32x8<S>; 4]) -> [f32x8<S>; 4] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]]
}
