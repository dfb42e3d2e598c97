//! The means of the transfer function over the values between two planes (SPEC §9), for eight pixels at a time: [`slab_integral`]'s table read by the
//! same steps as [`SlabIntegral::new`](slab_integral::SlabIntegral::new).

use std::collections::BTreeMap;

use fearless_simd::prelude::*;
use fearless_simd::{f32x8, f32x16, i32x8};

use crate::after::normalization::Normalization;
use crate::after::slab_integral::{self, CELL, HEAD, NODE, SUM};
use crate::cpu::count::bits;
use crate::cpu::vector::{LANES, columns, mask, optical_depth};
use crate::settings::splatting::Splatting;
use crate::settings::transfer_function::TransferFunction;

/// One set of tables.
#[derive(Clone, Debug)]
pub(super) struct Table {
    points: Vec<[f32; 4]>,
    /// The first and the last cell that a number of each bin may lie in.
    bins: Vec<[u32; 2]>,
    cells: Vec<Cell>,
    covered: Covered,
}

/// Which numbers a table covers, and how bins divide them.
#[derive(Clone, Copy, Debug)]
struct Covered {
    /// The min and the max number with an opacity.
    shown: [f32; 2],
    /// The min and the max number.
    all: [f32; 2],
    /// Where bins begin.
    origin: f32,
    bins_per_number: f32,
    last_bin: f32,
}

/// The numbers between two planes, by lane.
struct Between<S: Simd> {
    low: f32x8<S>,
    high: f32x8<S>,
    /// Their bins.
    bins: [[i32; LANES]; 2],
    /// The lanes in which a number may have an opacity.
    lanes: u32,
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

impl<S: Simd> Means<S> {
    /// Which of the lanes that have a bit show anything.
    #[inline(always)]
    pub(super) fn visible(&self, simd: S, lanes: u32) -> u32 {
        lanes & self.amount.simd_gt(f32x8::splat(simd, 0.0)).to_bitmask() as u32
    }
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
        let ([cells, bin_count, low, high], [first, bins_per_number, end, origin]) = (points[0], points[1]);
        let cell_points = HEAD + bin_count as usize;
        let bins = points[HEAD..cell_points].iter().map(|&[first, last, ..]| [first as u32, last as u32]).collect();
        let cells = points[cell_points..][..CELL * cells as usize].as_chunks().0.to_vec();
        let last_bin = bin_count - 1.0;
        let covered = Covered { shown: [low, high], all: [first, end], origin, bins_per_number, last_bin };
        Self { bins, cells, covered, points }
    }

    /// The cell of a number in the table's range, given its bin.
    #[inline(always)]
    fn cell_of(&self, x: f32, bin: i32) -> usize {
        let [mut first, mut last] = self.bins[bin as usize].map(|cell| cell as usize);
        while first < last {
            let middle = (first + last).div_ceil(2);
            if self.cells[middle][0][0] <= x { first = middle } else { last = middle - 1 }
        }
        first
    }
}

impl<S: Simd> Between<S> {
    /// Those from f0 to f1 in the lanes that have a bit, given their tables, which may all be the same.
    #[inline(always)]
    fn new(simd: S, [f0, f1]: [f32x8<S>; 2], lanes: u32, tables: &[&Table; LANES], are_same: bool) -> Self {
        let of = |number: fn(&Covered) -> f32| match are_same {
            true => f32x8::splat(simd, number(&tables[0].covered)),
            false => f32x8::load_array(simd, tables.map(|table| number(&table.covered))),
        };
        let (least, greatest) = (of(|covered| covered.all[0]), of(|covered| covered.all[1]));
        let (x0, x1) = (within(f0, [least, greatest]), within(f1, [least, greatest]));
        let is_rising = x0.simd_lt(x1);
        let (low, high) = (is_rising.select(x0, x1), is_rising.select(x1, x0));
        let is_hidden = high.simd_lt(of(|covered| covered.shown[0])) | low.simd_gt(of(|covered| covered.shown[1]));
        let (per_number, last_bin) = (of(|covered| covered.bins_per_number), of(|covered| covered.last_bin));
        let origin = of(|covered| covered.origin);
        let bins = [low, high].map(|x| {
            let bin = within((x - origin) * per_number, [f32x8::splat(simd, 0.0), last_bin]);
            bin.to_int::<i32x8<S>>().to_array()
        });
        Self { low, high, bins, lanes: lanes & !(is_hidden.to_bitmask() as u32) }
    }
}

/// Every number that lies in its range as it is. One below the range, or NaN, becomes the range's least number, and one above it the greatest.
#[inline(always)]
fn within<S: Simd>(x: f32x8<S>, [least, greatest]: [f32x8<S>; 2]) -> f32x8<S> {
    let at_least = x.simd_gt(least).select(x, least);
    at_least.simd_gt(greatest).select(greatest, at_least)
}

impl<'a> Parts<'a> {
    const NONE: Self = Self { cells: [&EMPTY; LANES], from: [0.0; LANES], to: [0.0; LANES], weight: [0.0; LANES] };

    #[inline(always)]
    fn set(&mut self, lane: usize, cell: &'a Cell, [from, to]: [f32; 2], weight: f32) {
        self.cells[lane] = cell;
        self.from[lane] = from;
        self.to[lane] = to;
        self.weight[lane] = weight;
    }

    /// The numbers of an entry of the cells, by lane.
    #[inline(always)]
    fn entry<S: Simd>(&self, simd: S, entry: usize) -> [f32x8<S>; 4] {
        let [a, b, c, d, e, f, g, h] = self.cells;
        columns(simd, [&a[entry], &b[entry], &c[entry], &d[entry], &e[entry], &f[entry], &g[entry], &h[entry]])
    }
}

impl Integrals {
    pub(super) fn new(
        has_labels: bool,
        transfer: &TransferFunction,
        splatting: &Splatting,
        numbers: &Normalization,
    ) -> Self {
        let table = |label| Table::new(slab_integral::table(&transfer.tables(label), splatting, numbers));
        let mut labels = BTreeMap::new();
        for &label in has_labels.then(|| transfer.labels.keys()).into_iter().flatten() {
            labels.insert(label, table(Some(label)));
        }
        let plain = table(None);
        let shown = labels.values().fold(plain.covered.shown, |[low, high], table| {
            [
                if table.covered.shown[0] < low { table.covered.shown[0] } else { low },
                if table.covered.shown[1] > high { table.covered.shown[1] } else { high },
            ]
        });
        Self { is_optical_depth: splatting.compositing.is_optical_depth(), plain, labels, shown }
    }

    /// The table for the voxels of a label.
    pub(super) fn table(&self, label: Option<u16>) -> &Table {
        label.and_then(|label| self.labels.get(&label)).unwrap_or(&self.plain)
    }

    /// The means of the lanes that have a bit, given the table of each; if they only tell what is visible, nothing but the amounts.
    #[inline(always)]
    pub(super) fn means<'a, S: Simd>(
        &self,
        simd: S,
        (lanes, only_tell): (u32, bool),
        [f0, f1]: [f32x8<S>; 2],
        table_of: Option<impl Fn(usize) -> &'a Table>,
    ) -> Means<S> {
        let mut tables = [&self.plain; LANES];
        let are_same = table_of.is_none();
        if let Some(table_of) = table_of {
            bits(lanes.into()).for_each(|lane| tables[lane as usize] = table_of(lane as usize));
        }
        let between = Between::new(simd, [f0, f1], lanes, &tables, are_same);
        let size = between.high - between.low;
        let (lows, highs, sizes) = (between.low.to_array(), between.high.to_array(), size.to_array());
        let (mut near, mut far, mut whole) = (Parts::NONE, Parts::NONE, [[0.0; LANES]; 5]);
        let mut has_far = false;
        for lane in bits(between.lanes.into()) {
            let lane = lane as usize;
            let (table, low, high, size) = (tables[lane], lows[lane], highs[lane], sizes[lane]);
            let first = table.cell_of(low, between.bins[0][lane]);
            let cell = &table.cells[first];
            let end = cell[1][3];
            if high < end || first + 1 == table.cells.len() {
                near.set(lane, cell, [low, high], 1.0);
                continue;
            }
            let last = table.cell_of(high, between.bins[1][lane]);
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
        let (zero, one) = (f32x8::splat(simd, 0.0), f32x8::splat(simd, 1.0));
        let is_counted = mask(simd, between.lanes);
        let (low, size) = (is_counted.select(between.low, zero), is_counted.select(size, zero));
        let load = |lanes: &[f32; LANES]| f32x8::load_array_ref(simd, lanes);
        let mut sums = self.part(simd, &near, low, only_tell);
        if has_far {
            let far = self.part(simd, &far, low, only_tell);
            sums = std::array::from_fn(|at| sums[at] + far[at] + load(&whole[at]));
        }
        let [amount, moment, red, green, blue] = sums;
        let has_amount = amount.simd_gt(zero);
        let divisor = has_amount.select(amount, one);
        let is_range = has_amount & size.simd_gt(zero);
        let share = (moment / divisor / is_range.select(size, one)).max(zero).min(one);
        let share = is_range.select(share, f32x8::splat(simd, 0.5));
        let is_rising = f0.simd_le(f1);
        Means {
            amount: has_amount.select(amount, zero),
            share: is_rising.select(share, one - share),
            color: [red, green, blue].map(|channel| channel / divisor),
        }
    }

    /// The sums over parts of cells, by two Gauss nodes; only that of m, if it only tells what is visible.
    #[inline(always)]
    fn part<S: Simd>(&self, simd: S, parts: &Parts<'_>, low: f32x8<S>, only_tell: bool) -> Sums<S> {
        let load = |lanes: &[f32; LANES]| f32x8::load_array_ref(simd, lanes);
        let (zero, one) = (f32x8::splat(simd, 0.0), f32x8::splat(simd, 1.0));
        let (from, to, weight) = (load(&parts.from), load(&parts.to), load(&parts.weight) * 0.5);
        let [start, per_width, alpha_at_start, rise] = parts.entry(simd, 0);
        // Both nodes at once.
        let twice = |of: f32x8<S>| of.combine(of);
        let share = f32x8::splat(simd, 0.5 - NODE as f32).combine(f32x8::splat(simd, 0.5 + NODE as f32));
        let x = twice(from) + twice(to - from) * share;
        let u = ((x - twice(start)) * twice(per_width)).max(twice(zero)).min(twice(one));
        let m = twice(weight) * self.amount(simd, twice(alpha_at_start) + twice(rise) * u);
        let sum = |of: f32x16<S>| {
            let (first, second) = of.split();
            first + second
        };
        if only_tell {
            return [sum(m), zero, zero, zero, zero];
        }
        let ([red, green, blue, _], [red_rise, green_rise, blue_rise, _]) =
            (parts.entry(simd, 1), parts.entry(simd, 2));
        let of_color = |at_start: f32x8<S>, rise: f32x8<S>| sum(m * (twice(at_start) + twice(rise) * u));
        [
            sum(m),
            sum(m * (x - twice(low))),
            of_color(red, red_rise),
            of_color(green, green_rise),
            of_color(blue, blue_rise),
        ]
    }

    /// m of SPEC §5.
    #[inline(always)]
    fn amount<S: Simd>(&self, simd: S, alpha: f32x16<S>) -> f32x16<S> {
        match self.is_optical_depth {
            true => optical_depth(simd, alpha.min(f32x16::splat(simd, 0.9999))),
            false => alpha,
        }
    }
}

impl Table {
    /// The sums over whole cells, from one to another, moments from a number.
    fn between(&self, first: usize, last: usize, low: f32) -> [f32; 5] {
        let level = (first ^ last).max(1).ilog2() as usize;
        let sums = HEAD + self.bins.len() + self.cells.len() * (CELL + SUM * level);
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
