//! The amounts a_k of a light sheet (SPEC §14): kernel sections of §5, as the light that passes them, `exp(-a_k)`.
//!
//! A band of rows is one thread's, and takes its bricks in one order.

use glam::DVec4;

use super::box_filter::Area;
use super::lit::Lit;
use super::matter::LightMatter;
use super::profile::{Profile, least, most, nearest, passed};
use super::view::LightView;
use super::window::{Places, Window};
use crate::geometry::slab::SlabGrid;
use crate::kernel::Kernel;
use crate::lists::brick::{self, BRICK_VOXELS};
use crate::lists::bucket::Buckets;
use crate::parallel::prelude::*;

/// The rows of a band.
const ROWS: usize = 16;

/// Where a brick lies in a light's view.
#[derive(Clone, Debug)]
struct Placed {
    /// Its first slot: pixels right of the first pixel's centre and below it, and slabs from the first one's near plane on.
    first: [f32; 3],
    /// The pixels that its footprints may reach.
    area: Area,
}

/// A voxel's section in a slab.
struct Section {
    /// The pixel coordinates, from the band's first pixel.
    center: [f32; 2],
    /// The slab's planes, grid units along the ray from the voxel.
    planes: [f32; 2],
    /// The amount per `unit`, scaled.
    amount: f32,
}

/// How footprints are drawn.
#[derive(Debug)]
enum Shape {
    /// Round ones of a radius of at most 2 pixels.
    Small(Window<4>),
    /// Round ones of a radius of at most 4 pixels.
    Large(Window<8>),
    /// Any.
    Ellipse(Ellipse),
}

/// Footprints that are ellipses.
#[derive(Debug)]
struct Ellipse {
    profile: Profile,
    /// ρ² of a pixel offset (x, y): the coefficients of x², xy and y².
    metric: [f32; 3],
    /// Half the height of a footprint's box in pixels.
    half_height: f32,
}

/// The voxels of a volume, as a light sees them.
#[derive(Debug)]
pub(super) struct Splatter<'a> {
    matter: &'a LightMatter,
    shape: Shape,
    side: usize,
    /// By slot, from a brick's first one: pixels right, pixels down, slabs.
    slots: [[f32; BRICK_VOXELS as usize]; 3],
    /// `1/λ`, times the low-pass rule's amplitude.
    scale: f32,
    /// Grid units along a kernel's ray to a slab's width.
    per_slab: f32,
    /// A kernel's reach in slabs.
    reach: f32,
    placed: Vec<Placed>,
    buckets: Buckets,
}

impl<'a> Splatter<'a> {
    /// The voxels in a view whose first slab is given.
    pub(super) fn new(matter: &'a LightMatter, light: &LightView, kernel: &Kernel, first: i32) -> Self {
        let (view, side) = (&light.view, light.side);
        let half_box = view.footprint.half_box(kernel.support());
        let middle = (side as f64 - 1.0) / 2.0;
        let slabs = SlabGrid { origin: view.slabs.plane(first), ..view.slabs };
        let [x, y, depth, _] = view.screen_from_voxel;
        let (x, y) = (x + DVec4::W * middle, y + DVec4::W * middle);
        let depth = (depth - DVec4::W * slabs.origin) / slabs.width;
        let of_brick = |brick: &brick::Brick| {
            let (center, half) = brick::bounds(brick);
            let area = [(x, half_box.x), (y, half_box.y)].map(|(row, reach)| {
                let (at, spread) = (row.dot(center.extend(1.0)), row.truncate().abs().dot(half) + reach);
                let end = side as f64;
                [
                    libm::floor(at - spread).clamp(0.0, end) as usize,
                    (libm::ceil(at + spread) + 1.0).clamp(0.0, end) as usize,
                ]
            });
            let depths = view.depths(center, half);
            let placed = Placed {
                first: [x, y, depth].map(|row| row.dot(brick::origin(brick).as_dvec3().extend(1.0)) as f32),
                area: Area { low: area.map(|[low, _]| low), end: area.map(|[_, end]| end) },
            };
            (placed, slabs.touched(depths.start, depths.end))
        };
        let (placed, touched): (Vec<Placed>, Vec<_>) = matter.bricks.par_iter().map(of_brick).unzip();
        let slots = [x, y, depth].map(|row| {
            let offset = |slot: usize| brick::in_brick(slot as u32).as_dvec3();
            std::array::from_fn(|slot| row.truncate().dot(offset(slot)) as f32)
        });
        Self {
            matter,
            shape: Shape::new(light, kernel, slabs.width),
            side,
            slots,
            scale: (view.footprint.amplitude / view.lambda) as f32,
            per_slab: slabs.width as f32,
            reach: (view.reach / slabs.width) as f32,
            placed,
            buckets: Buckets::sort(&touched),
        }
    }

    /// The light that passes a slab, counted from the first one, at each pixel; and the pixels at which it is not all. Bricks are left out whose pixels are
    /// dark.
    pub(super) fn slab(&self, slab: usize, lit: &Lit, passed: &mut [f32]) -> Area {
        let range = self.buckets.touching(slab as i32);
        let listed = self.buckets.order[range.start as usize..range.end as usize].par_iter();
        let shown: Vec<u32> =
            listed.copied().filter(|&number| !lit.is_dark(&self.placed[number as usize].area)).collect();
        let areas = shown.iter().map(|&number| self.placed[number as usize].area);
        let touched = areas.fold(Area::NONE, Area::and);
        let windows = match &self.shape {
            Shape::Small(_) => Some(lit.windows::<4>(self.side)),
            Shape::Large(_) => Some(lit.windows::<8>(self.side)),
            Shape::Ellipse(_) => None,
        };
        let mut by_band = vec![Vec::new(); self.side.div_ceil(ROWS)];
        for &brick in &shown {
            let Area { low, end } = self.placed[brick as usize].area;
            by_band[low[1] / ROWS..end[1].div_ceil(ROWS)].iter_mut().for_each(|bricks| bricks.push(brick));
        }
        let bands = passed.par_chunks_mut(ROWS * self.side).zip(by_band.par_iter()).enumerate();
        bands.for_each(|(number, (passed, bricks))| {
            if bricks.is_empty() {
                passed.fill(1.0);
                return;
            }
            let first_row = number * ROWS;
            let within = (slab, first_row);
            match (&self.shape, &windows) {
                (Shape::Small(window), Some(lit)) => self.draw_windows(window, within, (bricks, lit), passed),
                (Shape::Large(window), Some(lit)) => self.draw_windows(window, within, (bricks, lit), passed),
                (Shape::Ellipse(ellipse), _) => {
                    passed.fill(0.0);
                    self.sections(slab, first_row, bricks, |section| ellipse.add(&section, self.side, passed));
                    passed.iter_mut().for_each(|pixel| *pixel = self::passed(*pixel));
                }
                _ => {}
            }
        });
        touched
    }

    /// Calls `add` with the sections of some bricks in a slab.
    #[inline(always)]
    fn sections(&self, slab: usize, first_row: usize, bricks: &[u32], mut add: impl FnMut(Section)) {
        for &brick in bricks {
            let [x, y, depth] = self.placed[brick as usize].first;
            let (y, depth) = (y - first_row as f32, depth - slab as f32);
            for (slot, amount) in self.matter.voxels(brick as usize) {
                let slot = slot as usize % BRICK_VOXELS as usize;
                let [right, down, behind] = self.slots.each_ref().map(|offsets| offsets[slot]);
                let depth = depth + behind;
                if depth + self.reach > 0.0 && depth - self.reach < 1.0 {
                    let planes = [-depth * self.per_slab, (1.0 - depth) * self.per_slab];
                    add(Section { center: [x + right, y + down], planes, amount: amount * self.scale });
                }
            }
        }
    }

    /// Draws the sections of some bricks in a slab by windows, of those that have light.
    fn draw_windows<const W: usize>(
        &self,
        window: &Window<W>,
        (slab, first_row): (usize, usize),
        (bricks, lit): (&[u32], &Lit),
        passed: &mut [f32],
    ) {
        let (rows, stride) = (passed.len() / self.side, self.side + 2 * W);
        // With room for windows at every side.
        let mut sums = vec![0.0; (rows + 2 * W) * stride];
        let mut places = Places::default();
        for &brick in bricks {
            let [x, y, depth] = self.placed[brick as usize].first;
            // All slots, without a branch, so that the loops are vectorized.
            window.place(&self.slots, [x, y, depth - slab as f32], &mut places);
            for (slot, amount) in self.matter.voxels(brick as usize) {
                let slot = slot as usize % BRICK_VOXELS as usize;
                let [left, top] = [places.left[slot], places.top[slot]];
                let row = top - first_row as i32;
                let is_in_band = row > -(W as i32) && row < rows as i32;
                let is_in_image = left > -(W as i32) && left < self.side as i32;
                if !(is_in_band && is_in_image && window.reaches(&places, slot)) {
                    continue;
                }
                let last = [left, top].map(|first| (first + W as i32 - 1) as usize);
                if top > -(W as i32) && top < self.side as i32 && lit.has(last) {
                    let first = (row + W as i32) as usize * stride + (left + W as i32) as usize;
                    window.add(&places, slot, amount * self.scale, (&mut sums[first..], stride));
                }
            }
        }
        let sums = sums.chunks_exact(stride).skip(W);
        for (passed, sums) in passed.chunks_exact_mut(self.side).zip(sums) {
            passed.iter_mut().zip(&sums[W..]).for_each(|(passed, &sum)| *passed = self::passed(sum));
        }
    }
}

impl Shape {
    fn new(light: &LightView, kernel: &Kernel, slab_width: f64) -> Self {
        let view = &light.view;
        let from_pixels = view.footprint.footprint_from_pixels;
        let (right, down) = (from_pixels.x_axis, from_pixels.y_axis);
        let metric = [right.length_squared(), 2.0 * right.dot(down), down.length_squared()];
        // Where pixels are larger than voxels, the low-pass rule makes every footprint a circle, with a pixel for a grid unit.
        let is_round = metric.iter().zip([1.0, 0.0, 1.0]).all(|(found, round)| (found - round).abs() < 1e-9);
        if is_round && Window::<4>::suits(kernel) {
            return Self::Small(Window::new(kernel, slab_width));
        }
        if is_round && Window::<8>::suits(kernel) {
            return Self::Large(Window::new(kernel, slab_width));
        }
        Self::Ellipse(Ellipse {
            profile: Profile::new(kernel),
            metric: metric.map(|coefficient| coefficient as f32),
            half_height: view.footprint.half_box(kernel.support()).y as f32,
        })
    }
}

impl Ellipse {
    /// Adds a section to the sums of a band of rows, `side` pixels wide.
    #[inline(always)]
    fn add(&self, section: &Section, side: usize, sums: &mut [f32]) {
        let Section { center: [x, y], planes, amount } = *section;
        let [near, far] = planes.map(|plane| self.profile.along(plane));
        let [xx, xy, yy] = self.metric;
        let rows = (sums.len() / side) as i32;
        let first = nearest(y - self.half_height).max(0);
        let last = nearest(y + self.half_height).min(rows - 1);
        for row in first..=last {
            let dy = row as f32 - y;
            // Where the row crosses the ellipse ρ² = reach.
            let middle = -xy * dy / (2.0 * xx);
            let rest = (self.profile.reach - (yy * dy + 0.5 * xy * middle) * dy) / xx;
            if rest <= 0.0 {
                continue;
            }
            let half = rest.sqrt();
            let left = nearest(x + middle - half).max(0);
            let right = nearest(x + middle + half).min(side as i32 - 1);
            if left > right {
                continue;
            }
            let start = row as usize * side;
            for (sum, column) in sums[start + left as usize..=start + right as usize].iter_mut().zip(left..) {
                let dx = column as f32 - x;
                let square = least(most(xx * dx * dx + (xy * dx + yy * dy) * dy, 0.0), self.profile.reach);
                let [gauss, end] = self.profile.rim(square);
                let clamped = |k: f32| least(most(k, -end), end);
                *sum += gauss * amount * (clamped(far) - clamped(near));
            }
        }
    }
}
