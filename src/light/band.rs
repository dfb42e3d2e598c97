//! Bands of rows of light sheets (SPEC §14), each of which one thread draws with its bricks in one order.
//!
//! A voxel is drawn once, into all slabs that its kernel reaches from the first on in which its footprint has light. So its weights at pixels are computed once.

use super::box_filter::{Area, BoxFilter};
use super::lit::Lit;
use super::profile::passed;
use super::splat::{Shape, Splatter};
use super::window::Window;
use crate::lists::brick;
use crate::parallel::current_num_threads;

/// The minimum and the maximum number of rows of a band. Voxels at a border are drawn in both bands, but a thread needs some bands to share.
const ROWS: [usize; 2] = [12, 32];

/// Some rows of N stacks' sheets while these are made.
#[derive(Debug)]
pub(super) struct Band<const N: usize> {
    /// The first row.
    first: usize,
    /// The number of rows.
    rows: usize,
    /// The bricks whose footprints may reach the rows, by their first slab, from the last to the first.
    waiting: Vec<u32>,
    /// The bricks that may reach the slab.
    bricks: Vec<Begun>,
    /// The slab from which on all sums are 0.
    end: usize,
    /// The amounts in the slabs that kernels reach, one after the other and then from the first on again, with a margin.
    sums: Vec<f32>,
    /// The light that passes the slab.
    passed: Vec<f32>,
    /// For each stack, the light behind the slab, filtered along rows.
    pub(super) along: [Vec<f32>; N],
    /// Memory of the filter.
    line: Vec<f32>,
}

/// A brick that has begun.
#[derive(Debug)]
struct Begun {
    number: u32,
    /// The slots of voxels that are not drawn yet.
    left: u64,
}

impl<const N: usize> Band<N> {
    /// All bands of a view, with their bricks; and the number of rows of all but the last. Sums do not depend on it.
    pub(super) fn all(splatter: &Splatter<'_>) -> (Vec<Self>, usize) {
        let side = splatter.side;
        let height = side.div_ceil(3 * current_num_threads()).clamp(ROWS[0], ROWS[1]);
        let margin = splatter.margin();
        let band = |first: usize| {
            let rows = height.min(side - first);
            Self {
                first,
                rows,
                waiting: Vec::new(),
                bricks: Vec::new(),
                end: 0,
                sums: vec![0.0; splatter.slabs_of_kernel() * (rows + 2 * margin) * (side + 2 * margin)],
                passed: vec![1.0; rows * side],
                along: std::array::from_fn(|_| vec![1.0; rows * side]),
                line: Vec::new(),
            }
        };
        let mut bands: Vec<Self> = (0..side).step_by(height).map(band).collect();
        for &number in splatter.order.iter().rev() {
            let area = &splatter.placed[number as usize].area;
            if !area.is_empty() {
                let bands = &mut bands[area.low[1] / height..area.end[1].div_ceil(height)];
                bands.iter_mut().for_each(|band| band.waiting.push(number));
            }
        }
        (bands, height)
    }

    /// Finds the light that passes a slab, counted from the first one. Slabs come one after the other. Voxels are left out behind whose pixels the planes before
    /// the slab are dark.
    pub(super) fn draw(&mut self, splatter: &Splatter<'_>, slab: usize, planes: &[&[f32]]) {
        while let Some(number) =
            self.waiting.pop_if(|number| splatter.placed[*number as usize].slabs.start <= slab as i32)
        {
            let left = brick::present(&splatter.matter.bricks[number as usize]);
            self.bricks.push(Begun { number, left });
        }
        if !self.bricks.is_empty() {
            let reach = splatter.rows_of_kernel();
            let rows = self.first.saturating_sub(reach)..(self.first + self.rows + reach).min(splatter.side);
            let lit = Lit::of(planes, splatter.side, rows);
            match &splatter.shape {
                Shape::Small(window) => self.draw_windows(splatter, window, slab, &lit),
                Shape::Large(window) => self.draw_windows(splatter, window, slab, &lit),
                Shape::Ellipse(_) => self.draw_ellipses(splatter, slab, &lit),
            }
        }
        if slab >= self.end {
            self.passed.fill(1.0);
            return;
        }
        let margin = splatter.margin();
        let stride = splatter.side + 2 * margin;
        let length = (self.rows + 2 * margin) * stride;
        let sums = &mut self.sums[slab % splatter.slabs_of_kernel() * length..][..length];
        let rows = sums.chunks_exact(stride).skip(margin);
        for (to, sums) in self.passed.chunks_exact_mut(splatter.side).zip(rows) {
            to.iter_mut().zip(&sums[margin..]).for_each(|(to, &sum)| *to = passed(sum));
        }
        sums.fill(0.0);
    }

    /// Filters what passes the slab along rows, of one stack's plane before it, for what the slab's area needs.
    pub(super) fn spread(&mut self, stack: usize, (filter, area): (&BoxFilter, &Area), plane: &[f32]) {
        if area.is_empty() {
            return;
        }
        // Lit pixels beside the area count.
        let end = self.first + self.rows;
        let needed =
            area.low[1].saturating_sub(filter.reach()).max(self.first)..(area.end[1] + filter.reach()).min(end);
        let side = self.passed.len() / self.rows;
        for y in needed {
            let row = (y - self.first) * side..(y - self.first + 1) * side;
            let light = (&plane[y * side..(y + 1) * side], &self.passed[row.clone()]);
            filter.along(area.low[0]..area.end[0], light, &mut self.line, &mut self.along[stack][row]);
        }
    }

    /// Calls `draw` with the voxels that may reach a slab and are not drawn yet: their places in pixels and in slabs from the slab's near plane on, and their
    /// amounts, scaled. It tells whether a voxel is done.
    #[inline(always)]
    fn each(
        bricks: &mut Vec<Begun>,
        splatter: &Splatter<'_>,
        slab: usize,
        lit: &Lit,
        mut draw: impl FnMut([f32; 3], f32) -> bool,
    ) {
        bricks.retain_mut(|Begun { number, left }| {
            let placed = &splatter.placed[*number as usize];
            let [x, y, depth] = placed.first;
            let depth = depth - slab as f32;
            let mut reached = splatter.depths.reaching(depth) & *left;
            if reached != 0 && !lit.is_dark(&placed.area) {
                let amounts = splatter.matter.amounts(*number as usize);
                while reached != 0 {
                    let slot = reached.trailing_zeros() as usize;
                    let bit = reached & reached.wrapping_neg();
                    reached ^= bit;
                    let [right, down, behind] = splatter.slots[slot];
                    if draw([x + right, y + down, depth + behind], amounts[slot] * splatter.scale) {
                        *left ^= bit;
                    }
                }
            }
            *left != 0 && placed.slabs.end > slab as i32 + 1
        });
    }

    fn draw_windows<const W: usize>(&mut self, splatter: &Splatter<'_>, window: &Window<W>, slab: usize, lit: &Lit) {
        let (rows, side, first_row) = (self.rows as i32, splatter.side as i32, self.first as i32);
        let (width, stride, planes) = (W as i32, splatter.side + 2 * W, splatter.slabs_of_kernel());
        let length = (self.rows + 2 * W) * stride;
        let lit_windows = lit.windows::<W>(splatter.side);
        let (sums, end) = (&mut self.sums, &mut self.end);
        Self::each(&mut self.bricks, splatter, slab, lit, |[x, y, depth], amount| {
            let ((left, right), (top, down)) = (Window::<W>::first(x), Window::<W>::first(y));
            let row = top - first_row;
            let mut depth = window.depth(depth);
            // Elsewhere a voxel has no pixel of the band, and behind the slab's near plane none of the kernel lies.
            let has_pixels = row > -width && row < rows && left > -width && left < side;
            if !has_pixels || depth <= 0.0 {
                return true;
            }
            let Some(mut section) = window.section(depth) else { return false };
            if !lit_windows.has([left, top].map(|first| (first + width - 1) as usize)) {
                return false;
            }
            let footprint = window.footprint([right, down], amount);
            let start = (row + width) as usize * stride + (left + width) as usize;
            let mut plane = slab % planes;
            loop {
                for (sums, weights) in sums[plane * length + start..].chunks_mut(stride).zip(&footprint) {
                    sums[..W].iter_mut().zip(weights).for_each(|(sum, weight)| *sum += weight * section);
                }
                depth -= window.slab();
                if depth <= 0.0 {
                    break;
                }
                section = window.section(depth).unwrap_or(0.0);
                plane = if plane + 1 < planes { plane + 1 } else { 0 };
            }
            *end = slab + planes;
            true
        });
    }

    fn draw_ellipses(&mut self, splatter: &Splatter<'_>, slab: usize, lit: &Lit) {
        let Shape::Ellipse(ellipse) = &splatter.shape else { return };
        let planes = splatter.slabs_of_kernel();
        let length = self.rows * splatter.side;
        let (sums, end, first_row) = (&mut self.sums, &mut self.end, self.first as f32);
        Self::each(&mut self.bricks, splatter, slab, lit, |[x, y, mut depth], amount| {
            if depth - splatter.reach >= 1.0 {
                return false;
            }
            let mut plane = slab % planes;
            while depth + splatter.reach > 0.0 {
                let ends = [-depth, 1.0 - depth].map(|end| end * splatter.slab_width);
                ellipse.add([x, y - first_row], ends, amount, splatter.side, &mut sums[plane * length..][..length]);
                depth -= 1.0;
                plane = if plane + 1 < planes { plane + 1 } else { 0 };
                *end = slab + planes;
            }
            true
        });
    }
}
