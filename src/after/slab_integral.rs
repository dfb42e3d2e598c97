//! The transfer function integrated from value to value, as a table that `f32` arithmetic reads without losing digits (SPEC §9).
//!
//! Pre-integration (Engel, Kraus, Ertl 2001) commonly tabulates the cumulative integrals of m and m·C at equal steps, which rounds steps and
//! narrow peaks off and loses the digits of short ranges, which are differences of large sums. Here the values are cut into cells at all control points and
//! ends of iso-ranges, over which α and C are linear. Where a slab's values begin and end within a cell, two Gauss nodes integrate what
//! lies between: exactly for products of linear functions, and for the logarithm of `exponential` to about 1e-5, as cells end where `1 - α` has
//! fallen to `RATIO`. Whole cells between them come from a disjoint sparse table: for every block of 2, 4, 8, … cells it holds the sums from every cell to
//! the block's middle. Any run of cells is the sum of two such entries, nothing is subtracted, and a narrow peak keeps all its digits
//! beside a wide plateau.
//!
//! A table is an array of `vec4f`, which `shaders/shared/slab_integral.wgsl` reads as [`SlabIntegral::new`] does:
//!
//! | entries | hold |
//! |---|---|
//! | `HEAD` | (cells, bins, the minimum and maximum number with an opacity, for `surface` of linear slabs of one half); (the minimum number, bins per number, the maximum number, where bins begin) |
//! | bins | (first cell, last cell, 0, 0) that a number in this bin may lie in |
//! | cells · `CELL` | (minimum number, 1/width, α, α's rise over the cell); (C, maximum number); (C's rise, 0) |
//! | levels · cells · `SUM` | (∫m, ∫m·(x - middle), middle, 0); (∫m·C, 0) between the cell and the middle of its block |
//!
//! "Numbers" are values as [`Normalization`] scales them.

use glam::{DVec3, Vec3, Vec4};

use super::normalization::Normalization;
use crate::settings::splatting::{Compositing, SlabProfile, Splatting};
use crate::settings::transfer_function::{Ramp, Tables};

/// The number of entries before the bins.
pub(crate) const HEAD: usize = 2;
/// The number of entries of a cell.
pub(crate) const CELL: usize = 3;
/// The number of entries of a sum.
pub(crate) const SUM: usize = 2;

/// The smallest ratio of `1 - α` at the two ends of a cell for `exponential`.
const RATIO: f64 = 0.840_896_415_253_714_6;

/// The cap of opacities in the logarithm of `exponential` (SPEC §5).
const MAX_ALPHA: f64 = 0.9999;

/// The distance of the two Gauss nodes of an interval from its middle, in lengths of the interval.
pub(crate) const NODE: f64 = 0.288_675_134_594_812_9;

/// A range of values over which α and C are linear.
#[derive(Clone, Copy, Debug)]
struct Cell {
    ends: [f64; 2],
    alpha: [f64; 2],
    color: [DVec3; 2],
}

/// The integrals over one or more cells: ∫m, ∫m·(x - some x), ∫m·C.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    amount: f64,
    moment: f64,
    color: DVec3,
}

/// A slab whose mean amount is below this, and whose numbers reach the range of those with an opacity by less than a hair, is told by rounding alone from one
/// that shows nothing: its middle is not bent. Many volumes have a background of exactly the value at which opacity begins.
#[cfg(feature = "cpu")]
pub(crate) const MIN_BENT: f32 = 1e-3;

/// The integral over the widest iso-range of a single value, of which `surface` makes a cell; SPEC §9's mean amount is 0 there.
#[cfg(feature = "cpu")]
pub(crate) const SINGLE: f32 = 5e-7;

/// How far beyond all values the middles of cubic slabs may lie, in lengths of the values' range: more than `|∇f0 - ∇f1|·D/8` with the steepest kernel, the widest
/// slabs and the most oblique rays.
const MOST_BEYOND: f64 = 1024.0;

/// The range of numbers that a table covers: that of all values, and for cubic slabs what their middles may be.
fn covered(splatting: &Splatting, numbers: &Normalization) -> [f64; 2] {
    let [least, greatest] = numbers.range.map(f64::from);
    let beyond = if splatting.segments() > 1 { MOST_BEYOND * (greatest - least) } else { 0.0 };
    [least - beyond, greatest + beyond].map(|x| f64::from(x as f32))
}

/// The table for a transfer function's tables, to be read by [`SlabIntegral::new`].
pub fn table(tables: &Tables, splatting: &Splatting, numbers: &Normalization) -> Vec<[f32; 4]> {
    let compositing = splatting.compositing;
    let cells = cells(tables, compositing, covered(splatting, numbers), numbers);
    let [first, end] = [cells[0].ends[0], cells[cells.len() - 1].ends[1]];
    let bins = (4 * cells.len()).next_power_of_two().clamp(16, 1024);
    // Bins divide the values' range; the first and the last one hold all that lies beyond.
    let [least, greatest] = numbers.range.map(f64::from);
    let [least, greatest] = if greatest > least { [least, greatest] } else { [first, end] };
    let per_number = bins as f64 / (greatest - least);
    // A surface is where the opacity is one half. The middle of a cubic slab that shows anything may be there where neither plane is.
    let is_half = compositing.has_surface() && splatting.slab_profile == SlabProfile::Linear;
    let is_shown = |alpha: f64| if is_half { alpha >= 0.5 } else { alpha > 0.0 };
    let shown = cells.iter().filter(|cell| is_shown(cell.alpha[0].max(cell.alpha[1])));
    // Nothing lies between these if nothing has such an opacity.
    let shown = shown.fold([f64::from(f32::MAX), f64::from(f32::MIN)], |[low, high], cell| {
        [low.min(cell.ends[0]), high.max(cell.ends[1])]
    });
    // A mean of equal values may lie a rounding error beyond all of them, where the tables' ends continue.
    let [low, high] = shown;
    let shown =
        [if low <= first { f64::from(f32::MIN) } else { low }, if high >= end { f64::from(f32::MAX) } else { high }];

    let entry = |numbers: [f64; 4]| numbers.map(|number| number as f32);
    let with = |color: DVec3, last: f64| entry([color.x, color.y, color.z, last]);
    let mut points =
        vec![entry([cells.len() as f64, bins as f64, shown[0], shown[1]]), entry([first, per_number, end, least])];
    let cell_of = |x: f64| cells.partition_point(|cell| cell.ends[1] <= x).min(cells.len() - 1) as f64;
    // Rounding may put a number into the bin beside its own.
    let slack = 0.01 / per_number;
    points.extend((0..bins).map(|bin| {
        let [low, high] = [0, 1].map(|end| least + (bin + end) as f64 / per_number);
        let first_cell = if bin == 0 { 0.0 } else { cell_of(low - slack) };
        entry([first_cell, if bin + 1 == bins { cell_of(end) } else { cell_of(high + slack) }, 0.0, 0.0])
    }));
    points.extend(cells.iter().flat_map(|cell| {
        let ([low, high], [alpha, last_alpha], [color, last_color]) = (cell.ends, cell.alpha, cell.color);
        [entry([low, 1.0 / (high - low), alpha, last_alpha - alpha]), with(color, high), with(last_color - color, 0.0)]
    }));
    for level in 0..levels(cells.len()) {
        points.extend(
            sums(&cells, compositing, level)
                .into_iter()
                .flat_map(|(sums, middle)| [entry([sums.amount, sums.moment, middle, 0.0]), with(sums.color, 0.0)]),
        );
    }
    points
}

/// The most steps of a search for the cell of a number, which divides the cells of a bin again and again.
#[cfg(feature = "gpu")]
pub(crate) fn search_steps(table: &[[f32; 4]]) -> u32 {
    let bins = table[HEAD..HEAD + table[0][1] as usize].iter();
    let most = bins.map(|&[first, last, ..]| (last - first) as u32).max().unwrap_or(0);
    most.checked_ilog2().map_or(0, |log| log + 1)
}

/// The number of levels of the sparse table.
fn levels(cells: usize) -> u32 {
    (cells - 1).max(1).ilog2() + 1
}

/// The cells in ascending order.
fn cells(tables: &Tables, compositing: Compositing, [least, greatest]: [f64; 2], numbers: &Normalization) -> Vec<Cell> {
    let value = |x: f64| numbers.base + x / numbers.scale;
    let positions = |value: f64| numbers.apply(value);
    // A surface stands where an iso-range is a single value, too: that is the least range of `f32`s around it.
    let mut iso_ranges: Vec<[f64; 2]> =
        tables.iso_ranges.iter().flat_map(|ranges| ranges.iter().map(|range| range.map(positions))).collect();
    let is_single = |[low, high]: [f64; 2]| low as f32 >= (high as f32).next_down();
    let mut singles = Vec::new();
    if compositing.has_surface() {
        for range in iso_ranges.iter_mut().filter(|range| is_single(**range)) {
            *range = [(range[0] as f32).next_down().into(), (range[1] as f32).next_up().into()];
            singles.push(*range);
        }
    }
    let ramps = positions_of(tables.opacity).chain(positions_of(tables.color)).map(positions);
    let breaks = ramps.chain(iso_ranges.into_iter().flatten());
    let mut nodes: Vec<f64> = breaks.filter(|&x| least < x && x < greatest).collect();
    // A constant's table has a width, too.
    nodes.extend([least, if greatest > least { greatest } else { least + 1.0 }]);
    nodes.sort_by(f64::total_cmp);
    nodes.dedup();
    let mut cells: Vec<Cell> = Vec::new();
    for ends in nodes.windows(2).map(|pair| [pair[0], pair[1]]) {
        let is_in_single = singles.iter().any(|&[low, high]| low <= ends[0] && ends[1] <= high);
        let is_shown = is_in_single || tables.in_iso_range(value((ends[0] + ends[1]) / 2.0));
        let shows = tables.visible && is_shown;
        let alpha = ends.map(|x| if shows { tables.opacity.at(value(x)) } else { 0.0 });
        for ends in pieces(compositing, ends, alpha) {
            let alpha = ends.map(|x| if shows { tables.opacity.at(value(x)) } else { 0.0 });
            let color = ends.map(|x| tables.color.at(value(x)));
            let in_f32 = ends.map(|x| f64::from(x as f32));
            // Ramps narrower than a step of `f32` are steps.
            if in_f32[0] < in_f32[1] {
                cells.push(Cell { ends: in_f32, alpha, color });
            }
        }
    }
    cells
}

fn positions_of<T: Copy + std::ops::Add<Output = T> + std::ops::Mul<f64, Output = T>>(
    ramp: &Ramp<T>,
) -> impl Iterator<Item = f64> + '_ {
    ramp.points().iter().map(|(position, _)| *position)
}

/// Cuts a range over which α is linear into pieces that are short enough for the logarithm of `exponential`.
fn pieces(compositing: Compositing, [low, high]: [f64; 2], alpha: [f64; 2]) -> Vec<[f64; 2]> {
    let mut cuts = vec![low, high];
    if compositing.is_optical_depth() && alpha[0] != alpha[1] {
        let [larger, smaller] = [1.0 - alpha[0].min(alpha[1]), (1.0 - alpha[0].max(alpha[1])).max(1.0 - MAX_ALPHA)];
        // Rounded here, so that α is that of the rounded place: the logarithm makes much of it.
        let place = |transparency: f64| {
            let share = ((1.0 - transparency - alpha[0]) / (alpha[1] - alpha[0])).clamp(0.0, 1.0);
            f64::from((low + (high - low) * share) as f32).clamp(low, high)
        };
        let falling = std::iter::successors(Some(larger * RATIO), |transparency| Some(transparency * RATIO));
        cuts.extend(falling.take_while(|&transparency| transparency > smaller).map(place));
        cuts.push(place(smaller));
    }
    cuts.sort_by(f64::total_cmp);
    cuts.windows(2).map(|pair| [pair[0], pair[1]]).filter(|[low, high]| low < high).collect()
}

/// m of SPEC §5.
fn amount(compositing: Compositing, alpha: f64) -> f64 {
    if compositing.is_optical_depth() { -libm::log1p(-alpha.min(MAX_ALPHA)) } else { alpha }
}

/// The integrals over a cell, with moments relative to `from`.
fn integral(cell: &Cell, compositing: Compositing, from: f64) -> Sums {
    let [low, high] = cell.ends;
    let mut sums = Sums::default();
    for share in [0.5 - NODE, 0.5 + NODE] {
        let alpha = cell.alpha[0] + (cell.alpha[1] - cell.alpha[0]) * share;
        let m = amount(compositing, alpha) * (high - low) / 2.0;
        sums.amount += m;
        sums.moment += m * (low + (high - low) * share - from);
        sums.color += m * cell.color[0].lerp(cell.color[1], share);
    }
    sums
}

/// For every cell the integrals from the cell, which is included, to the middle of its block of 2^(level + 1) cells, or from that middle to the
/// cell; and the middle.
fn sums(cells: &[Cell], compositing: Compositing, level: u32) -> Vec<(Sums, f64)> {
    let half = 1 << level;
    let mut found = vec![(Sums::default(), 0.0); cells.len()];
    for block in (0..cells.len()).step_by(2 * half) {
        let middle = block + half;
        // The last block may end before its middle; then nothing reads it, except at level 0.
        let at = if middle < cells.len() { cells[middle].ends[0] } else { cells[cells.len() - 1].ends[1] };
        let mut run = |range: &mut dyn Iterator<Item = usize>| {
            let mut total = Sums::default();
            for cell in range {
                let own = integral(&cells[cell], compositing, at);
                total.amount += own.amount;
                total.moment += own.moment;
                total.color += own.color;
                found[cell] = (total, at);
            }
        };
        run(&mut (block..middle.min(cells.len())).rev());
        run(&mut (middle.min(cells.len())..(middle + half).min(cells.len())));
    }
    found
}

/// The means of the transfer function over a slab's values in `f32`, computed in the shader's steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlabIntegral {
    /// `m̄`, the mean amount per unit length, without gradient opacity.
    pub amount: f32,
    /// `(v̄ - f0)/(f1 - f0)`; ½ if f0 and f1 are equal.
    pub share: f32,
    /// `C̄`, unshaded.
    pub color: Vec3,
}

/// The means over a part of the numbers.
#[derive(Clone, Copy, Debug, Default)]
struct Part {
    amount: f32,
    moment: f32,
    color: Vec3,
}

impl SlabIntegral {
    /// The means over the numbers from f0 to f1 by a [`table`]; `None` if none of them has an opacity.
    pub fn new(points: &[[f32; 4]], compositing: Compositing, [f0, f1]: [f32; 2]) -> Option<Self> {
        let [cell_count, bins, shown_from, shown_to] = points[0];
        let [least, per_number, greatest, origin] = points[1];
        let [x0, x1] = [f0, f1].map(|f| f.clamp(least, greatest));
        let (low, high) = (x0.min(x1), x0.max(x1));
        if high < shown_from || low > shown_to {
            return None;
        }
        let first_cell = HEAD + bins as usize;
        let cell_at = |cell: usize| &points[first_cell + CELL * cell..first_cell + CELL * (cell + 1)];
        let cell_of = |x: f32| {
            let bin = ((x - origin) * per_number).clamp(0.0, bins - 1.0) as usize;
            let [mut first, mut last, ..] = points[HEAD + bin].map(|cell| cell as usize);
            while first < last {
                let middle = (first + last).div_ceil(2);
                if cell_at(middle)[0][0] <= x { first = middle } else { last = middle - 1 }
            }
            first
        };
        let part = |cell: usize, from: f32, to: f32| {
            let [[start, per_width, alpha, rise], color, color_rise] = cell_at(cell) else { return Part::default() };
            let (color, color_rise) = (Vec4::from(*color).truncate(), Vec4::from(*color_rise).truncate());
            let mut part = Part::default();
            for share in [0.5 - NODE as f32, 0.5 + NODE as f32] {
                let x = from + (to - from) * share;
                let u = ((x - start) * per_width).clamp(0.0, 1.0);
                let m = 0.5 * amount_f32(compositing, alpha + rise * u);
                part.amount += m;
                part.moment += m * (x - low);
                part.color += m * (color + color_rise * u);
            }
            part
        };
        let [first, last] = [low, high].map(cell_of);
        let size = high - low;
        let mut sum;
        if first == last {
            sum = part(first, low, high);
        } else {
            let weight = |width: f32| width / size;
            let end = cell_at(first)[1][3];
            let start = cell_at(last)[0][0];
            let (near, far) = (part(first, low, end), part(last, start, high));
            let (near_weight, far_weight) = (weight(end - low), weight(high - start));
            sum = Part {
                amount: near.amount * near_weight + far.amount * far_weight,
                moment: near.moment * near_weight + far.moment * far_weight,
                color: near.color * near_weight + far.color * far_weight,
            };
            if last > first + 1 {
                let (a, b) = (first + 1, last - 1);
                let level = (a ^ b).max(1).ilog2() as usize;
                let sums = first_cell + cell_count as usize * (CELL + SUM * level);
                for cell in [a, b].into_iter().take(if a == b { 1 } else { 2 }) {
                    let [m, moment, middle, _] = points[sums + SUM * cell];
                    sum.amount += weight(m);
                    sum.moment += weight(m * (middle - low) + moment);
                    sum.color += Vec4::from(points[sums + SUM * cell + 1]).truncate() / size;
                }
            }
        }
        if sum.amount <= 0.0 {
            return None;
        }
        let share = if size > 0.0 { (sum.moment / sum.amount / size).clamp(0.0, 1.0) } else { 0.5 };
        let share = if f0 <= f1 { share } else { 1.0 - share };
        Some(Self { amount: sum.amount, share, color: sum.color / sum.amount })
    }
}

/// m of SPEC §5 as `shaders/shared/shading.wgsl` computes it.
fn amount_f32(compositing: Compositing, alpha: f32) -> f32 {
    if !compositing.is_optical_depth() {
        return alpha;
    }
    if alpha < 0.0625 {
        return alpha * (1.0 + alpha * (0.5 + alpha * (1.0 / 3.0 + alpha * (0.25 + alpha * 0.2))));
    }
    -libm::logf(1.0 - alpha.min(0.9999))
}
