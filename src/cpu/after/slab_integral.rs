//! The means of the transfer function over the values between two planes (SPEC §9), for eight pixels at a time: [`slab_integral`]'s table read by the
//! same steps as [`SlabIntegral::new`](slab_integral::SlabIntegral::new).

use std::collections::BTreeMap;

use fearless_simd::f32x8;
use fearless_simd::prelude::*;

use crate::after::normalization::Normalization;
use crate::after::slab_integral::{self, CELL, HEAD, NODE, SUM};
use crate::cpu::vector::{LANES, columns, optical_depth};
use crate::settings::splatting::Compositing;
use crate::settings::transfer_function::TransferFunction;

/// One set of tables.
#[derive(Clone, Debug)]
pub(super) struct Table {
    points: Vec<[f32; 4]>,
    /// How many of the points are bins.
    bin_count: usize,
    cells: Vec<Cell>,
    /// The min and the max number with an opacity.
    shown: [f32; 2],
    /// The min number, bins per number, the max number.
    bins: [f32; 4],
}

/// The tables of a transfer function: one for all labels without tables of their own, and one for each other label.
#[derive(Clone, Debug)]
pub(super) struct Integrals {
    is_optical_depth: bool,
    plain: Table,
    labels: BTreeMap<u16, Table>,
    /// The min and the max number with an opacity in any of them.
    pub(super) shown: [f32; 2],
}

/// Means over the numbers from f0 to f1.
#[derive(Clone, Copy, Debug)]
pub(super) struct Means<S: Simd> {
    /// `m̄`, without gradient opacity; 0 if no number has an opacity.
    pub(super) amount: f32x8<S>,
    /// `(v̄ - f0)/(f1 - f0)`; where they are equal ½.
    pub(super) share: f32x8<S>,
    /// `C̄`, unshaded.
    pub(super) color: [f32x8<S>; 3],
}

/// A cell of a table.
type Cell = [[f32; 4]; CELL];

/// The cell of lanes that have none.
const EMPTY: Cell = [[0.0; 4]; CELL];

/// A part of a cell for every lane.
#[derive(Clone, Copy, Debug)]
struct Parts<'a> {
    cells: [&'a Cell; LANES],
    from: [f32; LANES],
    to: [f32; LANES],
    weight: [f32; LANES],
}

/// Sums of m, m·(x - f_min) and m·C.
type Sums<S> = [f32x8<S>; 5];

impl Table {
    fn new(points: Vec<[f32; 4]>) -> Self {
        let ([cells, bin_count, low, high], bins) = (points[0], points[1]);
        let bin_count = bin_count as usize;
        let cells = points[HEAD + bin_count..][..CELL * cells as usize].as_chunks().0.to_vec();
        Self { bin_count, cells, shown: [low, high], bins, points }
    }

    /// The cell of a number in the table's range.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn cell_of(&self, x: f32) -> usize {
        let [least, per_number, ..] = self.bins;
        let bin = (((x - least) * per_number) as usize).min(self.bin_count - 1);
        let [mut first, mut last, ..] = self.points[HEAD + bin].map(|cell| cell as usize);
        while first < last {
            let middle = (first + last).div_ceil(2);
            if self.cells[middle][0][0] <= x { first = middle } else { last = middle - 1 }
        }
        first
    }
}

impl<'a> Parts<'a> {
    const NONE: Self = Self { cells: [&EMPTY; LANES], from: [0.0; LANES], to: [0.0; LANES], weight: [0.0; LANES] };

    #[cfg_attr(not(debug_assertions), inline(always))]
    fn set(&mut self, lane: usize, cell: &'a Cell, [from, to]: [f32; 2], weight: f32) {
        self.cells[lane] = cell;
        self.from[lane] = from;
        self.to[lane] = to;
        self.weight[lane] = weight;
    }

    /// The numbers of an entry of the cells, by lane.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn entry<S: Simd>(&self, simd: S, entry: usize) -> [f32x8<S>; 4] {
        let [a, b, c, d, e, f, g, h] = self.cells;
        columns(simd, [&a[entry], &b[entry], &c[entry], &d[entry], &e[entry], &f[entry], &g[entry], &h[entry]])
    }
}

impl Integrals {
    pub(super) fn new(
        has_labels: bool,
        transfer: &TransferFunction,
        compositing: Compositing,
        numbers: &Normalization,
    ) -> Self {
        let table = |label| Table::new(slab_integral::table(&transfer.tables(label), compositing, numbers));
        let labels = has_labels.then(|| transfer.labels.keys()).into_iter().flatten();
        let labels: BTreeMap<u16, Table> = labels.map(|&label| (label, table(Some(label)))).collect();
        let plain = table(None);
        let shown = labels.values().fold(plain.shown, |[low, high], table| {
            [
                if table.shown[0] < low { table.shown[0] } else { low },
                if table.shown[1] > high { table.shown[1] } else { high },
            ]
        });
        Self { is_optical_depth: compositing == Compositing::Exponential, plain, labels, shown }
    }

    /// The table for the voxels of a label.
    pub(super) fn table(&self, label: Option<u16>) -> &Table {
        label.and_then(|label| self.labels.get(&label)).unwrap_or(&self.plain)
    }

    /// The means of the lanes that have a bit, given the table of each.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn means<'a, S: Simd>(
        &self,
        simd: S,
        mut lanes: u32,
        [f0, f1]: [[f32; LANES]; 2],
        table_of: impl Fn(usize) -> &'a Table,
    ) -> Means<S> {
        let (mut near, mut far, mut whole) = (Parts::NONE, Parts::NONE, [[0.0; LANES]; 5]);
        let (mut lows, mut sizes) = ([0.0; LANES], [0.0; LANES]);
        let mut has_far = false;
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize;
            lanes &= lanes - 1;
            let table = table_of(lane);
            let [least, _, greatest, _] = table.bins;
            let within = |x: f32| {
                if x < least {
                    least
                } else if x > greatest {
                    greatest
                } else {
                    x
                }
            };
            let (x0, x1) = (within(f0[lane]), within(f1[lane]));
            let (low, high) = if x0 < x1 { (x0, x1) } else { (x1, x0) };
            if high < table.shown[0] || low > table.shown[1] {
                continue;
            }
            let size = high - low;
            (lows[lane], sizes[lane]) = (low, size);
            let first = table.cell_of(low);
            let cell = &table.cells[first];
            let end = cell[1][3];
            if high < end || first + 1 == table.cells.len() {
                near.set(lane, cell, [low, high], 1.0);
                continue;
            }
            let last = table.cell_of(high);
            if last == first {
                near.set(lane, cell, [low, high], 1.0);
                continue;
            }
            has_far = true;
            let last_cell = &table.cells[last];
            let start = last_cell[0][0];
            near.set(lane, cell, [low, end], (end - low) / size);
            far.set(lane, last_cell, [start, high], (high - start) / size);
            if last > first + 1 {
                let sums = table.between(first + 1, last - 1, low);
                whole.iter_mut().zip(sums).for_each(|(lanes, sum)| lanes[lane] = sum / size);
            }
        }
        let load = |lanes: &[f32; LANES]| f32x8::load_array_ref(simd, lanes);
        let (low, size) = (load(&lows), load(&sizes));
        let mut sums = self.part(simd, &near, low);
        if has_far {
            let far = self.part(simd, &far, low);
            sums = std::array::from_fn(|at| sums[at] + far[at] + load(&whole[at]));
        }
        let [amount, moment, red, green, blue] = sums;
        let (zero, one) = (f32x8::splat(simd, 0.0), f32x8::splat(simd, 1.0));
        let has_amount = amount.simd_gt(zero);
        let divisor = has_amount.select(amount, one);
        let is_range = has_amount & size.simd_gt(zero);
        let share = (moment / divisor / is_range.select(size, one)).max(zero).min(one);
        let share = is_range.select(share, f32x8::splat(simd, 0.5));
        let is_rising = load(&f0).simd_le(load(&f1));
        Means {
            amount: has_amount.select(amount, zero),
            share: is_rising.select(share, one - share),
            color: [red, green, blue].map(|channel| channel / divisor),
        }
    }

    /// The sums over parts of cells, by two Gauss nodes.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn part<S: Simd>(&self, simd: S, parts: &Parts<'_>, low: f32x8<S>) -> Sums<S> {
        let load = |lanes: &[f32; LANES]| f32x8::load_array_ref(simd, lanes);
        let (zero, one) = (f32x8::splat(simd, 0.0), f32x8::splat(simd, 1.0));
        let (from, to, weight) = (load(&parts.from), load(&parts.to), load(&parts.weight) * 0.5);
        let [start, per_width, alpha_at_start, rise] = parts.entry(simd, 0);
        let ([red, green, blue, _], [red_rise, green_rise, blue_rise, _]) =
            (parts.entry(simd, 1), parts.entry(simd, 2));
        let mut sums = [zero; 5];
        for share in [0.5 - NODE as f32, 0.5 + NODE as f32] {
            let x = from + (to - from) * share;
            let u = ((x - start) * per_width).max(zero).min(one);
            let m = weight * self.amount(simd, alpha_at_start + rise * u);
            sums[0] += m;
            sums[1] += m * (x - low);
            sums[2] += m * (red + red_rise * u);
            sums[3] += m * (green + green_rise * u);
            sums[4] += m * (blue + blue_rise * u);
        }
        sums
    }

    /// m of SPEC §5.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn amount<S: Simd>(&self, simd: S, alpha: f32x8<S>) -> f32x8<S> {
        match self.is_optical_depth {
            true => optical_depth(simd, alpha.min(f32x8::splat(simd, 0.9999))),
            false => alpha,
        }
    }
}

impl Table {
    /// The sums over whole cells, from one to another, moments from a number.
    fn between(&self, first: usize, last: usize, low: f32) -> [f32; 5] {
        let level = (first ^ last).max(1).ilog2() as usize;
        let sums = HEAD + self.bin_count + self.cells.len() * (CELL + SUM * level);
        let mut total = [0.0; 5];
        for cell in [first, last].into_iter().take(if first == last { 1 } else { 2 }) {
            let [m, moment, middle, _] = self.points[sums + SUM * cell];
            let [red, green, blue, _] = self.points[sums + SUM * cell + 1];
            let own = [m, m * (middle - low) + moment, red, green, blue];
            total.iter_mut().zip(own).for_each(|(total, own)| *total += own);
        }
        total
    }
}
