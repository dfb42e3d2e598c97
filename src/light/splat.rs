//! The amounts a_k of light sheets (SPEC §14): kernel sections of §5, in the geometry of one view. [`super::band`] adds them up.

use std::ops::Range;

use glam::DVec4;

use super::box_filter::Area;
use super::matter::{LightMatter, SLOTS};
use super::profile::{Profile, least, most, nearest};
use super::view::LightView;
use super::window::Window;
use crate::geometry::slab::SlabGrid;
use crate::kernel::Kernel;
use crate::lists::brick;
use crate::lists::bucket::Buckets;
use crate::parallel::prelude::*;

/// Where a brick lies in a light's view.
#[derive(Clone, Debug)]
pub(super) struct Placed {
    /// Its first slot: pixels right of the first pixel's centre and below it, and slabs from the first one's near plane on.
    pub(super) first: [f32; 3],
    /// The pixels that its footprints may reach.
    pub(super) area: Area,
    /// The slabs that its kernels may reach, counted from the first one.
    pub(super) slabs: Range<i32>,
}

/// How footprints are drawn.
#[derive(Debug)]
pub(super) enum Shape {
    /// Round ones of a radius of at most 2 pixels.
    Small(Window<4>),
    /// Round ones of a radius of at most 4 pixels.
    Large(Window<8>),
    /// Any.
    Ellipse(Ellipse),
}

/// Footprints that are ellipses.
#[derive(Debug)]
pub(super) struct Ellipse {
    profile: Profile,
    /// ρ² of a pixel offset (x, y): the coefficients of x², xy and y².
    metric: [f32; 3],
    /// Half the height of a footprint's box in pixels.
    half_height: f32,
}

/// The voxels of a volume, as a light sees them.
#[derive(Debug)]
pub(super) struct Splatter<'a> {
    pub(super) matter: &'a LightMatter,
    pub(super) shape: Shape,
    pub(super) side: usize,
    /// By slot, from a brick's first one: pixels right, pixels down, slabs.
    pub(super) slots: [[f32; 3]; SLOTS],
    pub(super) depths: Depths,
    /// `1/λ`, times the low-pass rule's amplitude.
    pub(super) scale: f32,
    /// Grid units along a kernel's ray to a slab's width.
    pub(super) slab_width: f32,
    /// A kernel's reach in slabs.
    pub(super) reach: f32,
    pub(super) placed: Vec<Placed>,
    /// The bricks by their first slab.
    pub(super) order: Vec<u32>,
}

/// Which slots of a brick may reach a slab.
#[derive(Debug)]
pub(super) struct Depths {
    /// The least depth of a slot, in slabs from the first slot.
    least: f32,
    /// Intervals per slab.
    per_slab: f32,
    /// A kernel's reach in slabs.
    reach: f32,
    /// The slots whose depths are less than those at which intervals begin.
    below: [u64; INTERVALS + 3],
}

/// The intervals from the least depth of a slot to the greatest.
const INTERVALS: usize = 64;

impl Depths {
    fn new(slots: &[[f32; 3]; SLOTS], reach: f32) -> Self {
        let depths = slots.map(|[_, _, depth]| depth);
        let least = depths.into_iter().fold(f32::INFINITY, f32::min);
        let most = depths.into_iter().fold(f32::NEG_INFINITY, f32::max);
        let per_slab = INTERVALS as f32 / (most - least);
        let is_below = |depth: f32, at: usize| (depth - least) * per_slab < at as f32;
        let bits = |at: usize| {
            depths.iter().enumerate().fold(0, |bits, (slot, &depth)| bits | u64::from(is_below(depth, at)) << slot)
        };
        Self { least, per_slab, reach, below: std::array::from_fn(bits) }
    }

    /// The slots whose kernels reach a slab, and perhaps a few more, given the depth of the first slot in slabs from the slab's near plane on.
    #[inline(always)]
    pub(super) fn reaching(&self, depth: f32) -> u64 {
        let interval = |depth: f32| ((depth - self.least) * self.per_slab) as i32;
        let below = |at: i32| self.below[(at.max(0) as usize).min(INTERVALS + 2)];
        // An interval more at both ends, since casts round towards 0 and numbers are rounded.
        below(interval(1.0 + self.reach - depth).saturating_add(2))
            & !below(interval(-self.reach - depth).saturating_sub(1))
    }
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
            Placed {
                first: [x, y, depth].map(|row| row.dot(brick::origin(brick).as_dvec3().extend(1.0)) as f32),
                area: Area { low: area.map(|[low, _]| low), end: area.map(|[_, end]| end) },
                slabs: slabs.touched(depths.start, depths.end),
            }
        };
        let placed: Vec<Placed> = matter.bricks.par_iter().map(of_brick).collect();
        let touched: Vec<Range<i32>> = placed.iter().map(|placed| placed.slabs.clone()).collect();
        let slots = std::array::from_fn(|slot| {
            let offset = brick::in_brick(slot as u32).as_dvec3();
            [x, y, depth].map(|row| row.truncate().dot(offset) as f32)
        });
        let reach = (view.reach / slabs.width) as f32;
        Self {
            matter,
            shape: Shape::new(light, kernel, slabs.width),
            side,
            depths: Depths::new(&slots, reach),
            slots,
            scale: (view.footprint.amplitude / view.lambda) as f32,
            slab_width: slabs.width as f32,
            reach,
            placed,
            order: Buckets::sort(&touched).order,
        }
    }

    /// The pixels that footprints may reach of the bricks that begin in each of some number of slabs.
    pub(super) fn begun(&self, slabs: usize) -> Vec<Area> {
        let mut areas = vec![Area::NONE; slabs];
        for Placed { area, slabs: touched, .. } in &self.placed {
            let begun = &mut areas[(touched.start.max(0) as usize).min(slabs - 1)];
            *begun = begun.and(*area);
        }
        areas
    }

    /// The maximum number of slabs that a kernel reaches.
    pub(super) fn slabs_of_kernel(&self) -> usize {
        (2.0 * self.reach).ceil() as usize + 2
    }

    /// The rows that sums have above and below those of a band, and the columns beside the image.
    pub(super) fn margin(&self) -> usize {
        match self.shape {
            Shape::Small(_) => 4,
            Shape::Large(_) => 8,
            Shape::Ellipse(_) => 0,
        }
    }

    /// The rows beyond a band that footprints with pixels in the band reach.
    pub(super) fn rows_of_kernel(&self) -> usize {
        match &self.shape {
            Shape::Small(_) => 3,
            Shape::Large(_) => 7,
            Shape::Ellipse(ellipse) => (2.0 * ellipse.half_height).ceil() as usize + 1,
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
    /// Adds a voxel's section between two planes, in grid units along the ray from the voxel, to the sums of a band of rows, `side` pixels wide, from whose
    /// first pixel its place is given.
    #[inline(always)]
    pub(super) fn add(&self, [x, y]: [f32; 2], planes: [f32; 2], amount: f32, side: usize, sums: &mut [f32]) {
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
