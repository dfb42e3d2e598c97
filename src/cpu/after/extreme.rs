//! `maximum`, `minimum` and `average` after splatting (SPEC §9): one value per pixel is chosen from its values on the planes, and classified.

use fearless_simd::prelude::*;
use fearless_simd::{f32x8, mask32x8};

use super::classify::Looks;
use super::frame::Frame;
use super::planes::Plane;
use crate::cpu::cut::TileRays;
use crate::cpu::shade;
use crate::cpu::sheets::{Buffers, COLUMNS, ROWS};
use crate::cpu::vector::{LANES, mask};
use crate::part::Extreme;
use crate::settings::splatting::Compositing;

/// The choice of a row's pixels: number, gradient, and place among slabs; the weight is 0 where nothing was chosen.
#[derive(Clone, Copy, Debug)]
struct Kept {
    number: [f32; COLUMNS],
    gradient: [[f32; COLUMNS]; 3],
    place: [f32; COLUMNS],
    weight: [f32; COLUMNS],
}

const NOTHING: Kept =
    Kept { number: [0.0; COLUMNS], gradient: [[0.0; COLUMNS]; 3], place: [0.0; COLUMNS], weight: [0.0; COLUMNS] };

/// The values that a tile's pixels choose, row by row.
#[derive(Debug)]
pub(super) struct Chosen {
    /// The chosen points within the visible stretches of pixels' rays; for `average` the sums over all points, whose number is the weight.
    best: Vec<Kept>,
    /// On both planes of the slab that a stretch's middle lies in.
    middle: Vec<[Kept; 2]>,
    /// The colours of the three, where voxels have their own; else empty.
    colors: Vec<[KeptColors; 3]>,
}

/// The colours of a row's pixels.
type KeptColors = [[f32; COLUMNS]; 4];

const BLACK: KeptColors = [[0.0; COLUMNS]; 4];

impl Chosen {
    /// Empty, with or without colours; of no rows if nothing is chosen.
    pub(super) fn new(compositing: Compositing, has_colors: bool) -> Self {
        let rows = if compositing.is_choice() { ROWS } else { 0 };
        let colors = vec![[BLACK; 3]; if has_colors { rows } else { 0 }];
        Self { best: vec![NOTHING; rows], middle: vec![[NOTHING; 2]; rows], colors }
    }

    /// Which of eight pixels have chosen a point.
    #[inline(always)]
    pub(super) fn are_chosen<S: Simd>(&self, simd: S, [column, row]: [usize; 2]) -> u32 {
        let weights = f32x8::from_slice(simd, &self.best[row].weight[column..column + LANES]);
        weights.simd_gt(f32x8::splat(simd, 0.0)).to_bitmask() as u32
    }

    pub(super) fn clear(&mut self) {
        self.best.fill(NOTHING);
        self.middle.fill([NOTHING; 2]);
        self.colors.fill([BLACK; 3]);
    }

    /// The chosen values, row by row (SPEC §11), and in `pixels`, which are classified, the own colours of means, which are not.
    pub(super) fn extremes(&self, frame: &Frame<'_>, rays: &TileRays, pixels: &mut [[f32; 4]]) -> Vec<Extreme> {
        let is_average = frame.compositing.is_average();
        if is_average {
            for (at, pixel) in pixels.iter_mut().enumerate() {
                let (row, column) = (at / COLUMNS, at % COLUMNS);
                let count = self.best[row].weight[column];
                if count > 0.0 {
                    let own = self.colors.get(row).map_or([0.0; 4], |[sums, ..]| sums.map(|sum| sum[column]));
                    *pixel = own.map(|sum| sum / count);
                }
            }
        }
        let [low, high] = frame.numbers.range;
        let span = if high > low { high - low } else { 1.0 };
        let of = |row: usize, at: usize| {
            let (best, [near, far]) = (&self.best[row], &self.middle[row]);
            let extreme = |number: f32, counted| Extreme { value: (number - low) / span, counted, label: 0.0 };
            if best.weight[at] > 0.0 && is_average {
                let value = frame.value(best.number[at] / best.weight[at]) as f32;
                return Extreme { value, counted: Extreme::MIDDLE + best.weight[at], label: 0.0 };
            }
            if best.weight[at] > 0.0 {
                return extreme(best.number[at], Extreme::POINT);
            }
            let Some(shown) = &rays.shown else { return Extreme::default() };
            let [start, end] = [shown[row][0][at], shown[row][1][at]];
            let (first, second) = match (near.weight[at] > 0.0, far.weight[at] > 0.0) {
                _ if start >= end => return Extreme::default(),
                (true, true) => (near.number[at], far.number[at]),
                (true, false) => (near.number[at], near.number[at]),
                (false, true) => (far.number[at], far.number[at]),
                (false, false) => return Extreme::default(),
            };
            let middle = (start + end) * 0.5;
            extreme(first + (second - first) * (middle - middle.floor()), Extreme::MIDDLE)
        };
        let rows = 0..self.best.len();
        rows.flat_map(|row| (0..COLUMNS).map(move |at| (row, at))).map(|(row, at)| of(row, at)).collect()
    }
}

/// The position of the middle of a stretch: its slab, and the fraction of the slab before it.
#[inline(always)]
fn middle_of<S: Simd>(stretch: [f32x8<S>; 2]) -> [f32x8<S>; 2] {
    let middle = (stretch[0] + stretch[1]) * 0.5;
    let slab = middle.floor();
    [slab, middle - slab]
}

impl Frame<'_> {
    /// Looks at the points of a slab's planes, as far as it has not yet.
    #[inline(always)]
    pub(super) fn choose<S: Simd>(
        &self,
        simd: S,
        looks: &Looks<'_>,
        planes: &mut [Plane; 2],
        wanted: &[u32; ROWS],
        chosen: &mut Chosen,
    ) {
        for (row, wanted) in wanted.iter().enumerate() {
            for column in (0..COLUMNS).step_by(LANES) {
                let lanes = wanted >> column & u32::from(u8::MAX);
                let lanes = self.reaching(simd, lanes, looks, planes[0].number, [column, row]);
                for plane in &mut *planes {
                    let new = lanes & !(plane.chosen[row] >> column);
                    plane.chosen[row] |= new << column;
                    if new != 0 {
                        self.choose_from(simd, looks, plane, new, [column, row], chosen);
                    }
                }
            }
        }
    }

    /// Looks at the points of some of eight pixels on a plane.
    #[inline(always)]
    pub(super) fn choose_from<S: Simd>(
        &self,
        simd: S,
        looks: &Looks<'_>,
        plane: &mut Plane,
        lanes: u32,
        [column, row]: [usize; 2],
        chosen: &mut Chosen,
    ) {
        self.find_values(simd, plane, lanes, [column, row]);
        let values = f32x8::from_slice(simd, &plane.rows[row].values[column..column + LANES]);
        let has_value = values.simd_eq(values) & mask(simd, lanes);
        let here = f32x8::splat(simd, looks.rays.begin(plane.number));
        let stretch = looks.stretch(simd, [column, row]);
        // Plane k belongs to slab k; it is before that slab and behind slab k - 1.
        let is_drawn = mask(simd, if self.slabs.contains(&plane.number) { u32::from(u8::MAX) } else { 0 });
        let counts = stretch[0].simd_le(here) & here.simd_le(stretch[1]) & has_value & is_drawn;
        let better = self.is_better(simd, &chosen.best[row], column, values) & counts;
        let [slab, _] = middle_of(stretch);
        let middles = [0, 1].map(|behind| {
            let is_drawn =
                mask(simd, if self.slabs.contains(&(plane.number - behind)) { u32::from(u8::MAX) } else { 0 });
            (slab + behind as f32).simd_eq(here) & has_value & is_drawn
        });
        let is_needed = (better | middles[0] | middles[1]).to_bitmask() as u32;
        let mut gradient = [f32x8::splat(simd, 0.0); 3];
        if self.needs_gradients && !self.compositing.is_average() {
            self.find_gradients(simd, plane, is_needed, [column, row]);
            let gradients = &plane.rows[row].gradients;
            let load = |axis: usize| f32x8::from_slice(simd, &gradients[axis][column..column + LANES]);
            gradient = [load(0), load(1), load(2)];
        }
        let is_average = self.compositing.is_average();
        if let Some(kept) = chosen.colors.get_mut(row) {
            self.find_colors(
                simd,
                plane,
                (better | counts | middles[0] | middles[1]).to_bitmask() as u32,
                [column, row],
            );
            let places = [if is_average { counts } else { better }, middles[0], middles[1]];
            for (at, (kept, is_there)) in kept.iter_mut().zip(places).enumerate() {
                for (kept, new) in kept.iter_mut().zip(&plane.colors[row]) {
                    let [old, new] = [&*kept, new].map(|row| f32x8::from_slice(simd, &row[column..column + LANES]));
                    let new = if at == 0 && is_average { old + new } else { new };
                    is_there.select(new, old).store_slice(&mut kept[column..column + LANES]);
                }
            }
        }
        if is_average {
            chosen.best[row].add(simd, column, values, counts.to_bitmask() as u32);
        } else {
            chosen.best[row].set(simd, column, (values, &gradient, here), better.to_bitmask() as u32);
        }
        for (kept, is_there) in chosen.middle[row].iter_mut().zip(middles) {
            kept.set(simd, column, (values, &gradient, here), is_there.to_bitmask() as u32);
        }
    }

    /// Which of eight values are the ones to choose, so far.
    #[inline(always)]
    fn is_better<S: Simd>(&self, simd: S, kept: &Kept, column: usize, values: f32x8<S>) -> mask32x8<S> {
        let load = |row: &[f32; COLUMNS]| f32x8::from_slice(simd, &row[column..column + LANES]);
        let (number, weight) = (load(&kept.number), load(&kept.weight));
        let is_better = match self.compositing.keeps_least() {
            true => values.simd_lt(number - self.hair),
            false => values.simd_gt(number + self.hair),
        };
        is_better | weight.simd_eq(f32x8::splat(simd, 0.0))
    }

    /// Classifies what a tile's pixels chose, into the compositing buffer.
    #[inline(always)]
    pub(super) fn classify_chosen<S: Simd>(&self, simd: S, looks: &Looks<'_>, chosen: &Chosen, buffers: &mut Buffers) {
        for (row, (best, middle)) in chosen.best.iter().zip(&chosen.middle).enumerate() {
            for column in (0..COLUMNS).step_by(LANES) {
                self.classify_group(simd, looks, (best, middle), chosen.colors.get(row), [column, row], buffers);
            }
        }
    }

    #[inline(always)]
    fn classify_group<S: Simd>(
        &self,
        simd: S,
        looks: &Looks<'_>,
        (best, [near, far]): (&Kept, &[Kept; 2]),
        colors: Option<&[KeptColors; 3]>,
        [column, row]: [usize; 2],
        buffers: &mut Buffers,
    ) {
        let splat = |number: f32| f32x8::splat(simd, number);
        let load = |row: &[f32; COLUMNS]| f32x8::from_slice(simd, &row[column..column + LANES]);
        let stretch = looks.stretch(simd, [column, row]);
        let [slab, share] = middle_of(stretch);
        let has = |kept: &Kept| load(&kept.weight).simd_gt(splat(0.0));
        let (has_best, has_near, has_far) = (has(best), has(near), has(far));
        let shown = stretch[0].simd_lt(stretch[1]) & (has_best | has_near | has_far);
        let lanes = shown.to_bitmask() as u32;
        if lanes == 0 {
            return;
        }
        let line = |of: fn(&Kept, usize) -> &[f32; COLUMNS], at: usize| {
            let (near, far) = (load(of(near, at)), load(of(far, at)));
            let (first, second) = (has_near.select(near, far), has_far.select(far, near));
            has_best.select(load(of(best, at)), first + (second - first) * share)
        };
        let is_average = self.compositing.is_average();
        let count = if is_average { load(&best.weight).max(splat(1.0)) } else { splat(1.0) };
        let numbers = (line(|kept, _| &kept.number, 0) / has_best.select(count, splat(1.0))).to_array();
        let gradient = [0, 1, 2].map(|axis| line(|kept, axis| &kept.gradient[axis], axis));
        let place = match is_average {
            true => slab + share,
            false => has_best.select(load(&best.place), slab + share),
        };
        // Where a middle is chosen, the mean of its slab's two planes.
        let own = colors.map(|kept| {
            let own = [0, 1, 2, 3].map(|component| {
                let [best, near, far] = kept.each_ref().map(|kept| load(&kept[component]));
                let middle = (has_near.select(near, far) + has_far.select(far, near)) * 0.5;
                has_best.select(best / count, middle)
            });
            own.map(f32x8::to_array)
        });
        let lengths = self.length(gradient);
        let places = place.to_array();
        let (mut alphas, mut colors) = ([0.0; LANES], [[0.0; LANES]; 3]);
        for lane in (0..LANES).filter(|lane| lanes >> lane & 1 == 1) {
            let at = [looks.origin[0] + column, looks.origin[1] + row];
            let label = match (self.labels, is_average) {
                (false, _) => None,
                (true, true) => self.middle_label([at[0] + lane, at[1]]),
                (true, false) => self.label(at, lane, looks.rays.slab(places[lane])),
            };
            let tables = self.transfer.tables(label);
            let value = self.value(numbers[lane]);
            alphas[lane] = match is_average {
                true if tables.visible && tables.in_iso_range(value) => tables.opacity.at(value) as f32,
                true => 0.0,
                false => tables.alpha(value, lengths[lane]) as f32,
            };
            let color = tables.color.at(value).as_vec3().to_array();
            let [rgb @ .., opacity] = own.map_or([color[0], color[1], color[2], 1.0], |own| own.map(|row| row[lane]));
            alphas[lane] *= opacity;
            (0..3).for_each(|channel| colors[channel][lane] = rgb[channel]);
        }
        let mut color = colors.each_ref().map(|channel| f32x8::load_array_ref(simd, channel));
        if !is_average {
            let left = self.left(simd, lanes, looks, [column, row], |lane| looks.rays.slab(places[lane]));
            let shaded = self.shaded(simd, color, gradient, looks.to_eye(simd, self, [column, row]), left);
            let faces = looks.faces(lanes, [column, row], |lane| looks.rays.slab(places[lane]).floor() as i32);
            color = shade::select(mask(simd, faces), color, shaded);
        }
        let alpha = f32x8::load_array(simd, alphas);
        let [red, green, blue] = color.map(|channel| channel * alpha);
        for (channel, pixels) in buffers.acc[row].iter_mut().zip([red, green, blue, alpha]) {
            pixels.store_slice(&mut channel[column..column + LANES]);
        }
        if let Some(opacity) = self.compositor.first_hit {
            let is_hit = alpha.simd_ge(splat(opacity)) & shown;
            let hits = is_hit.select(place, splat(f32::INFINITY));
            hits.store_slice(&mut buffers.hits[row][column..column + LANES]);
        }
    }
}

impl Kept {
    /// Adds values where there is a bit.
    #[inline(always)]
    fn add<S: Simd>(&mut self, simd: S, column: usize, values: f32x8<S>, bits: u32) {
        for (row, new) in [(&mut self.number, values), (&mut self.weight, f32x8::splat(simd, 1.0))] {
            let old = f32x8::from_slice(simd, &row[column..column + LANES]);
            let sum = old + mask(simd, bits).select(new, f32x8::splat(simd, 0.0));
            sum.store_slice(&mut row[column..column + LANES]);
        }
    }

    /// Puts numbers in where there is a bit.
    #[inline(always)]
    fn set<S: Simd>(
        &mut self,
        simd: S,
        column: usize,
        (number, [x, y, z], place): (f32x8<S>, &[f32x8<S>; 3], f32x8<S>),
        bits: u32,
    ) {
        if bits == 0 {
            return;
        }
        let [gx, gy, gz] = &mut self.gradient;
        let rows = [&mut self.number, gx, gy, gz, &mut self.place, &mut self.weight];
        for (row, new) in rows.into_iter().zip([number, *x, *y, *z, place, f32x8::splat(simd, 1.0)]) {
            let old = f32x8::from_slice(simd, &row[column..column + LANES]);
            mask(simd, bits).select(new, old).store_slice(&mut row[column..column + LANES]);
        }
    }
}
