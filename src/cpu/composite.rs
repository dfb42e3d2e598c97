//! Compositing of one sheet of a tile, eq. 2 and SPEC §5; the same as `shaders/composite.wgsl`.

use fearless_simd::f32x8;
use fearless_simd::prelude::*;

use super::cull::OpenMask;
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
    pub(super) fn composite<S: Simd>(&self, simd: S, buffers: &mut Buffers, slot: usize, open: &mut OpenMask) {
        let Buffers { sheets, written, acc } = buffers;
        let mut rows = std::mem::take(&mut written[slot]);
        let mut has_closed = false;
        while rows != 0 {
            let row = rows.trailing_zeros() as usize;
            rows &= rows - 1;
            let sheet = &mut sheets[row][slot];
            let opaque = self.row(simd, &mut acc[row], sheet);
            *sheet = [[0.0; STRIDE]; CHANNELS];
            if opaque & open.row(row) != 0 {
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
    fn row<S: Simd>(
        &self,
        simd: S,
        acc: &mut [[f32; COLUMNS]; CHANNELS],
        sheet: &[[f32; STRIDE]; CHANNELS],
    ) -> u32 {
        let mut opaque = 0;
        for at in (0..COLUMNS).step_by(LANES) {
            let amounts = [0, 1, 2, 3].map(|channel| f32x8::from_slice(simd, &sheet[channel][at..at + LANES]));
            let before = [0, 1, 2, 3].map(|channel| f32x8::from_slice(simd, &acc[channel][at..at + LANES]));
            let after = self.pixels(simd, before, amounts);
            for channel in 0..CHANNELS {
                after[channel].store_slice(&mut acc[channel][at..at + LANES]);
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
            Compositing::Linear => {
                let scale = one / sheet[3].max(one);
                sheet.map(|channel| channel * scale)
            }
            Compositing::Exponential => {
                let scale = saturation(simd, sheet[3]);
                sheet.map(|channel| channel * scale)
            }
            _ => sheet,
        };
        // What rounding leaves beyond full opacity must not count against anything.
        let through = |alpha: f32x8<S>| (one - alpha).max(f32x8::splat(simd, 0.0));
        match (self.compositing, self.order) {
            (Compositing::Xray, _) => [0, 1, 2, 3].map(|channel| acc[channel] + sheet[channel]),
            (_, Order::FrontToBack) => {
                let through = through(acc[3]);
                [0, 1, 2, 3].map(|channel| acc[channel] + through * sheet[channel])
            }
            (_, Order::BackToFront) => {
                let through = through(sheet[3]);
                [0, 1, 2, 3].map(|channel| sheet[channel] + through * acc[channel])
            }
        }
    }
}
