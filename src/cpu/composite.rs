//! Compositing of one sheet of a tile, eq. 2 and SPEC §5; the same as `shaders/composite.wgsl`.

use fearless_simd::f32x8;
use fearless_simd::prelude::*;

use super::cull::OpenMask;
use super::cut::TileRays;
use super::sheets::{Buffers, CHANNELS, COLUMNS, ROWS, Sheet, VECTORS};
use super::vector::{LANES, saturation};
use crate::lists::quad_plan::TILE;
use crate::settings::splatting::{Compositing, Order};

/// Red, green, blue and opacity of eight pixels.
type Pixels<S> = [f32x8<S>; CHANNELS];

/// The rule by which sheets are composited into the compositing buffer.
#[derive(Clone, Copy, Debug)]
pub(super) struct Compositor {
    pub(super) compositing: Compositing,
    pub(super) order: Order,
    /// The opacity threshold of opaque pixels; `None` if nothing is culled.
    pub(super) threshold: Option<f32>,
    /// The opacity whose depth is requested.
    pub(super) first_hit: Option<f32>,
}

/// The stretch of rays that a sheet stands for, in slabs as [`TileRays`] counts them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stretch {
    /// The beginning of its slab.
    pub(super) slab: f32,
    pub(super) begin: f32,
    pub(super) end: f32,
}

impl Stretch {
    /// A slab, given its beginning.
    pub(super) fn slab(slab: f32) -> Self {
        Self { slab, begin: slab, end: slab + 1.0 }
    }

    /// One of as many segments of a slab.
    pub(super) fn segment(slab: f32, number: usize, segments: usize) -> Self {
        let length = 1.0 / segments as f32;
        let begin = slab + length * number as f32;
        Self { slab, begin, end: begin + length }
    }
}

impl Compositor {
    /// Composites the sheet of a stretch of rays, empties it, and finds the pixels that became opaque; the number of tiles
    /// as statistics count them (SPEC §8) in which there was anything to composite.
    #[inline(always)]
    pub(super) fn composite<S: Simd>(
        &self,
        simd: S,
        sheet: &mut impl Sheet,
        buffers: &mut Buffers,
        (rays, stretch): (&TileRays, Stretch),
        open: &mut OpenMask,
    ) -> u64 {
        let filled = sheet.rows();
        let mut rows = match self.compositing {
            // While no surface has been reached, the compositing buffer holds the previous sheet.
            Compositing::Surface => filled | std::mem::replace(&mut buffers.kept, filled),
            // Empty pixels count too.
            Compositing::Minimum => u64::MAX >> (u64::BITS as usize - ROWS),
            _ => filled,
        };
        let has_empty = self.compositing.has_surface() || self.compositing.keeps_least();
        let tiles = tiles_of(rows & open.rows());
        while rows != 0 {
            let row = rows.trailing_zeros() as usize;
            rows &= rows - 1;
            let mut opaque = 0;
            for vector in 0..VECTORS {
                let pixels = match sheet.take(simd, row, vector) {
                    Some(pixels) => pixels,
                    None if has_empty => [f32x8::splat(simd, 0.0); CHANNELS],
                    None => continue,
                };
                opaque |= self.vector(simd, pixels, buffers, (rays, stretch), [row, vector * LANES]);
            }
            open.find(row, opaque);
        }
        tiles
    }

    /// Composites eight pixels of a row, from a column on. Returns which of the row's pixels are now opaque, as bits; 0 if nothing is culled.
    #[inline(always)]
    fn vector<S: Simd>(
        &self,
        simd: S,
        mut pixels: Pixels<S>,
        buffers: &mut Buffers,
        (rays, stretch): (&TileRays, Stretch),
        [row, at]: [usize; 2],
    ) -> u32 {
        let splat = |number: f32| f32x8::splat(simd, number);
        let load = |row: &[f32; COLUMNS]| f32x8::from_slice(simd, &row[at..at + LANES]);
        let mut shown = [splat(f32::NEG_INFINITY), splat(f32::INFINITY)];
        let mut closed = 0;
        if let Some(rows) = &rays.shown {
            shown = [load(&rows[row][0]), load(&rows[row][1])];
            closed = shown[1].simd_le(splat(stretch.slab + 1.0)).to_bitmask() as u32;
            if !self.compositing.keeps_least() {
                let [start, end] = within(simd, shown, stretch);
                pixels = scaled(pixels, (end - start).max(splat(0.0)));
            }
        }
        if let Some(weights) = &rays.weights {
            pixels = scaled(pixels, load(&weights[row]));
        }
        let acc = &mut buffers.acc[row];
        let before = acc.each_ref().map(load);
        let mut after = self.pixels(simd, before, pixels);
        if let Some(counted) = &rays.counted {
            let middle = splat(stretch.slab + 0.5);
            let counts = load(&counted[row][0]).simd_le(middle) & middle.simd_le(load(&counted[row][1]));
            after = std::array::from_fn(|channel| counts.select(after[channel], before[channel]));
        }
        for (channel, after) in acc.iter_mut().zip(after) {
            after.store_slice(&mut channel[at..at + LANES]);
        }
        if self.first_hit.is_some() {
            let hits = &mut buffers.hits[row];
            let opacities = [before[3], pixels[3], after[3]];
            let hit = self.hit(simd, load(hits), opacities, shown, stretch);
            hit.store_slice(&mut hits[at..at + LANES]);
        }
        self.threshold.map_or(0, |threshold| (after[3].simd_ge(splat(threshold)).to_bitmask() as u32 | closed) << at)
    }

    /// Composites eight pixels. By means ([`Compositing`]): for the minimum the compositing buffer keeps 2 less the opacity, and 0 where
    /// nothing counted; for a surface that is not reached the mean of the last sheet.
    #[inline(always)]
    fn pixels<S: Simd>(&self, simd: S, acc: Pixels<S>, sheet: Pixels<S>) -> Pixels<S> {
        let splat = |number: f32| f32x8::splat(simd, number);
        let (zero, one) = (splat(0.0), splat(1.0));
        let sheet = match self.compositing {
            Compositing::Linear => scaled(sheet, one / sheet[3].max(one)),
            Compositing::Exponential => scaled(sheet, saturation(simd, sheet[3])),
            _ => sheet,
        };
        match (self.compositing, self.order) {
            (Compositing::Xray | Compositing::Average, _) => sum(acc, sheet),
            (Compositing::Maximum, _) => self.kept(acc, sheet, sheet[3].min(one), one),
            (Compositing::Minimum, _) => {
                let opacity = f32x8::splat(simd, 2.0) - sheet[3].min(one);
                self.kept(acc, sheet, opacity, one)
            }
            (Compositing::Surface, _) => {
                let share = crossing(acc[3], sheet[3]);
                let there: Pixels<S> =
                    std::array::from_fn(|channel| acc[channel] + (sheet[channel] - acc[channel]) * share);
                let reached = [there[0] / there[3], there[1] / there[3], there[2] / there[3], one];
                let (is_reached, is_below) = (acc[3].simd_ge(one), sheet[3].simd_lt(f32x8::splat(simd, 0.5)));
                let now = |channel: usize| is_below.select(sheet[channel], reached[channel]);
                std::array::from_fn(|channel| is_reached.select(acc[channel], now(channel)))
            }
            // Opacity beyond 1 is a rounding error and must not hide another sheet.
            (_, Order::FrontToBack) => {
                // An opacity that rounding keeps a hair below 1 would let many faint sheets through.
                let left = one - acc[3];
                sum(acc, scaled(sheet, left.simd_gt(splat(f32::EPSILON)).select(left, zero)))
            }
            (_, Order::BackToFront) => sum(sheet, scaled(acc, (one - sheet[3]).max(zero))),
        }
    }

    /// Keeps a sheet where its opacity is larger, or equal and nearer. Opacities above 1 count as equal.
    #[inline(always)]
    fn kept<S: Simd>(&self, acc: Pixels<S>, sheet: Pixels<S>, opacity: f32x8<S>, one: f32x8<S>) -> Pixels<S> {
        let passes = match self.order {
            Order::FrontToBack => opacity.simd_gt(acc[3]),
            Order::BackToFront => opacity.simd_ge(acc[3]),
        };
        let scale = one / sheet[3].max(one);
        let color = [sheet[0] * scale, sheet[1] * scale, sheet[2] * scale, opacity];
        std::array::from_fn(|channel| passes.select(color[channel], acc[channel]))
    }

    /// Notes where the requested opacity is reached for pixels that reach it in this sheet, as `shaders/composite.wgsl` does.
    #[inline(always)]
    fn hit<S: Simd>(
        &self,
        simd: S,
        hit: f32x8<S>,
        [before, sheet, after]: [f32x8<S>; 3],
        shown: [f32x8<S>; 2],
        stretch: Stretch,
    ) -> f32x8<S> {
        let is_surface = self.compositing.has_surface();
        let opacity = f32x8::splat(simd, if is_surface { 1.0 } else { self.first_hit.unwrap_or(1.0) });
        let is_here = before.simd_lt(opacity) & after.simd_ge(opacity);
        let at = if is_surface {
            // Counted from the middle of the previous slab.
            (crossing(before, sheet) + (stretch.slab - 0.5)).max(shown[0]).min(shown[1])
        } else {
            let [start, end] = within(simd, shown, stretch);
            start + (end - start) * ((opacity - before) / (after - before))
        };
        is_here.select(at, hit)
    }
}

/// The number of tiles of [`TILE`] rows that hold any of some rows.
pub(super) fn tiles_of(rows: u64) -> u64 {
    let of_tile = u64::MAX >> (u64::BITS - TILE);
    (0..ROWS as u32).step_by(TILE as usize).map(|first| u64::from(rows >> first & of_tile != 0)).sum()
}

/// The part of what rays show that lies in a stretch.
#[inline(always)]
fn within<S: Simd>(simd: S, [start, end]: [f32x8<S>; 2], Stretch { begin, end: last, .. }: Stretch) -> [f32x8<S>; 2] {
    [start.max(f32x8::splat(simd, begin)), end.min(f32x8::splat(simd, last))]
}

/// Where between the middles of a slab and of the next one their means' opacity is one half, if it grows evenly.
#[inline(always)]
fn crossing<S: Simd>(before: f32x8<S>, mean: f32x8<S>) -> f32x8<S> {
    (0.5 - before) / (mean - before)
}

#[inline(always)]
fn scaled<S: Simd>([red, green, blue, alpha]: Pixels<S>, by: f32x8<S>) -> Pixels<S> {
    [red * by, green * by, blue * by, alpha * by]
}

#[inline(always)]
fn sum<S: Simd>(a: Pixels<S>, b: Pixels<S>) -> Pixels<S> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]]
}
