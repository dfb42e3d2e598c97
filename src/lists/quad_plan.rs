//! The frame plan: everything that a frame's passes need, as plain data made without a GPU.

use std::ops::Range;

use glam::DVec4;

use crate::geometry::slab::{self, SlabGrid};
use crate::geometry::view_geometry::ViewGeometry;
use crate::lists::brick;
use crate::lists::brick::Brick;
use crate::lists::bucket::Buckets;
use crate::parallel::prelude::*;
use crate::settings::splatting::Order;

/// The side of a tile in pixels (§6).
pub const TILE: u32 = 32;

/// The number of tiles across and down an image.
pub fn tile_grid(size: [u32; 2]) -> [u32; 2] {
    size.map(|pixels| pixels.div_ceil(TILE))
}

/// The plan of a frame: the bricks that every sheet group visits, in compositing order.
#[derive(Clone, Debug, PartialEq)]
pub struct FramePlan {
    /// The view, or another one for which [`ViewGeometry::has_depths_of`] holds.
    pub view: ViewGeometry,
    /// The number of sheets in a group.
    pub sheets: u32,
    /// For every list, its bricks sorted by first group.
    pub orders: Vec<Vec<u32>>,
    /// The groups that a brick may reach, and those that count even if they are empty.
    pub groups: Vec<GroupPlan>,
}

/// One sheet group.
#[derive(Clone, Debug, PartialEq)]
pub struct GroupPlan {
    /// The group's first slab.
    pub first_slab: i32,
    /// The sheet depths of its near and far plane.
    pub planes: Range<f64>,
    /// For every list, the range of its bricks that may reach into the group.
    pub bricks: Vec<Range<u32>>,
}

impl FramePlan {
    /// Sorts the bricks of every list into buckets (§5.1) of groups of `sheets` sheets. The sheet depths `covered` count even if they are
    /// empty. Groups without any of the slabs `drawn` are left out.
    pub fn new<'a>(
        lists: impl IntoIterator<Item = &'a [Brick]>,
        view: ViewGeometry,
        sheets: u32,
        order: Order,
        covered: Range<f64>,
        drawn: &Range<i32>,
    ) -> Self {
        // A group is treated as a thick slab.
        let groups = view.slabs.groups(sheets);
        let buckets: Vec<Buckets> = lists
            .into_iter()
            .map(|bricks| {
                // Bricks are in memory order, so that equal scenes add up in equal order after any history of changes.
                let mut in_memory: Vec<u32> = (0..bricks.len() as u32).collect();
                let position = |&at: &u32| brick::position(&bricks[at as usize]);
                if !in_memory.is_sorted_by_key(position) {
                    in_memory.sort_unstable_by_key(position);
                }
                let touched = |at: u32| {
                    let (middle, half) = brick::bounds(&bricks[at as usize]);
                    let depths = view.depths(middle, half);
                    (depths.start < depths.end).then(|| (at, groups.touched(depths.start, depths.end)))
                };
                let (in_view, touched): (Vec<u32>, Vec<Range<i32>>) = in_memory.into_iter().filter_map(touched).unzip();
                let mut buckets = Buckets::sort(&touched);
                buckets.order.iter_mut().for_each(|at| *at = in_view[*at as usize]);
                buckets
            })
            .collect();
        let covered = groups.covered(covered);
        let all: Vec<Range<i32>> = buckets.iter().filter_map(Buckets::range).chain(covered.clone()).collect();
        let first = all.iter().map(|range| range.start).min().unwrap_or(0);
        let end = all.iter().map(|range| range.end).max().unwrap_or(0);
        let drawn = if drawn.is_empty() { 0..0 } else { SlabGrid::groups_of(drawn, sheets) };
        let (first, end) = (first.max(drawn.start), end.min(drawn.end));
        let counts = |group: i32| covered.as_ref().is_some_and(|covered| covered.contains(&group));
        let mut plans: Vec<GroupPlan> = (first..end)
            .map(|group| GroupPlan {
                first_slab: group * sheets as i32,
                planes: groups.plane(group)..groups.plane(group + 1),
                bricks: buckets.iter().map(|buckets| buckets.touching(group)).collect(),
            })
            .zip(first..end)
            .filter(|(group, number)| counts(*number) || group.bricks.iter().any(|range| !range.is_empty()))
            .map(|(group, _)| group)
            .collect();
        if order == Order::BackToFront {
            plans.reverse();
        }
        Self { view, sheets, orders: buckets.into_iter().map(|buckets| buckets.order).collect(), groups: plans }
    }
}

/// Counts of the overlaps between voxels and slabs.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Overlaps {
    /// Voxels that overlap any slab; in perspective, those beyond the near plane.
    pub voxels: u64,
    /// Voxel–slab overlaps of positive length, on or off the screen.
    pub sections: u64,
    /// The slabs from the first to the last.
    pub slabs: Range<i32>,
}

impl Overlaps {
    /// Counts the overlaps of the voxels in some bricks.
    pub fn count(bricks: &[Brick], view: &ViewGeometry) -> Self {
        let bricks = bricks.par_iter();
        if view.perspective.is_none() {
            let depths = PlaceDepths::new(view);
            return bricks.map(|brick| depths.overlaps(brick)).reduce(Self::default, Self::and);
        }
        bricks.map(|brick| Self::of_brick(brick, view)).reduce(Self::default, Self::and)
    }

    /// Counts the overlaps of the voxels in a brick.
    #[inline(always)]
    pub fn of_brick(brick: &Brick, view: &ViewGeometry) -> Self {
        let mut sum = Self::default();
        for (_, voxel) in brick::voxels(brick) {
            let slabs = view.touched(voxel);
            if !slabs.is_empty() {
                sum = sum.and(Self { voxels: 1, sections: slabs.len() as u64, slabs });
            }
        }
        sum
    }

    /// The planes of values that voxels' kernels meet, where classification comes after splatting (SPEC §9), and the slabs that the cells
    /// of bricks lie in.
    pub fn count_planes(bricks: &[Brick], view: &ViewGeometry) -> Self {
        let row = view.screen_from_voxel[2];
        let in_slabs = |depth: f64| (depth - view.slabs.origin) / view.slabs.width;
        let reach = view.reach / view.slabs.width;
        // There is no value at the eye and behind it.
        let first_plane = if view.perspective.is_some() { 1.0 } else { f64::NEG_INFINITY };
        let nearest = view.perspective.map_or(f64::NEG_INFINITY, |seen| seen.eye.near / view.slabs.width);
        let of_brick = |brick: &Brick| {
            let planes = brick::voxels(brick).map(|(_, voxel)| {
                let depth = in_slabs(row.dot(voxel.as_dvec3().extend(1.0)));
                let first = ((depth - reach + slab::ROUNDING).floor() + 1.0).max(first_plane);
                ((depth + reach - slab::ROUNDING).ceil() - first).max(0.0) as u64
            });
            let (middle, half) = brick::bounds(brick);
            let middle = in_slabs(row.dot(middle.extend(1.0)));
            let spread = row.truncate().abs().dot(half + 0.5) / view.slabs.width;
            let first = (middle - spread).max(nearest);
            Self {
                voxels: brick::present(brick).count_ones().into(),
                sections: planes.sum(),
                slabs: first.floor() as i32..((middle + spread).ceil() as i32).max(first.floor() as i32),
            }
        };
        // Bricks whose voxels have all left stay in their lists.
        let has_voxels = |brick: &&Brick| brick::present(brick) != 0;
        bricks.par_iter().filter(has_voxels).map(of_brick).reduce(Self::default, Self::and)
    }

    /// The counts of two lists of bricks together.
    pub fn and(self, other: Self) -> Self {
        match [self.voxels, other.voxels] {
            [0, _] => other,
            [_, 0] => self,
            _ => Self {
                voxels: self.voxels + other.voxels,
                sections: self.sections + other.sections,
                slabs: self.slabs.start.min(other.slabs.start)..self.slabs.end.max(other.slabs.end),
            },
        }
    }
}

/// Sheet depths in slabs, without perspective: a voxel's is the sum of its brick's and its slot's. Every new view counts all voxels, so
/// these sums replace [`ViewGeometry::touched`].
#[derive(Clone, Debug)]
pub struct PlaceDepths {
    /// The row for a voxel and 1.
    depth: DVec4,
    /// The depths of slots relative to the brick's first.
    places: [f64; brick::BRICK_VOXELS as usize],
    /// The reach of a kernel, and half a slab.
    reach: f64,
}

impl PlaceDepths {
    /// Those of a view.
    pub fn new(view: &ViewGeometry) -> Self {
        let mut depth = view.screen_from_voxel[2];
        depth.w -= view.slabs.origin;
        depth /= view.slabs.width;
        let places = std::array::from_fn(|place| depth.truncate().dot(brick::in_brick(place as u32).as_dvec3()));
        Self { depth, places, reach: view.reach / view.slabs.width - slab::ROUNDING + 0.5 }
    }

    /// Counts the overlaps of the voxels in a brick.
    #[inline(always)]
    pub fn overlaps(&self, brick: &Brick) -> Overlaps {
        let origin = self.depth.dot(brick::origin(brick).as_dvec3().extend(1.0));
        let present = brick::present(brick);
        if present == 0 {
            return Overlaps::default();
        }
        let (mut sections, mut nearest, mut farthest) = (0, i64::MAX, i64::MIN);
        // All places, without a branch, so that the loop is vectorized.
        for (place, depth) in self.places.iter().enumerate() {
            let depth = origin + depth;
            // Half a slab more, to the nearest plane: the planes that enclose a kernel. It never lies in the middle between two, because of
            // `slab::ROUNDING`.
            let (first, end) = (nearest_plane(depth - self.reach), nearest_plane(depth + self.reach));
            let is_present = present >> place & 1 == 1;
            sections += if is_present { end - first } else { 0 };
            nearest = nearest.min(if is_present { first } else { i64::MAX });
            farthest = farthest.max(if is_present { end } else { i64::MIN });
        }
        // The low bits are planes' numbers.
        let slabs = nearest as i32..farthest as i32;
        Overlaps { voxels: present.count_ones().into(), sections: sections as u64, slabs }
    }
}

/// The plane nearest to a depth, as a number whose low 32 bits are the plane's and whose differences are those of planes.
#[inline(always)]
fn nearest_plane(slabs: f64) -> i64 {
    // Adding 1.5·2⁵² rounds to a whole number, which is then in the low bits.
    const MAGIC: f64 = 6_755_399_441_055_744.0;
    (slabs + MAGIC).to_bits() as i64
}
