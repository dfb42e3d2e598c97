//! Which bricks every sheet group of every tile looks at: the buckets (§5.1) of the tile rasteriser, which walks a tile's
//! groups front to back.

use std::ops::Range;

use glam::DVec2;
use rayon::prelude::*;

use crate::brick;
use crate::error::RenderError;
use crate::gpu::layout::Brick;
use crate::splatting::Order;
use crate::view::View;

/// Side of the rasteriser's tiles, pixels.
pub const SIDE: u32 = 16;

/// Width and height of the units that a tile consists of, two across and four down, pixels.
const UNIT: [u32; 2] = [8, 4];

/// Units of a tile.
pub const UNITS: u32 = SIDE * SIDE / (UNIT[0] * UNIT[1]);

/// Sheets of a group.
pub const SHEETS: u32 = 4;

/// The most bricks: their numbers share a word with the units.
const MAX_BRICKS: usize = 1 << 24;

/// Passes through all its loops that a thread may take in one dispatch: llvmpipe ends loops after 65535. The pass that finds a loop
/// at its end counts, and in that pass one through every loop inside. Threads count them, and go on in the next dispatch. What is left is
/// for what comes before and after, planes that clip a thread's four pixels first of all.
const MAX_PASSES: u32 = 65000;

/// Queues that a brick's voxels fill at most: one voxel for each of the 8 threads.
const QUEUES_PER_BRICK: u32 = 8;

/// Passes of a brick at most: 12 to fetch and visit it and to test its places, and 4 to share a queue with another brick.
const PASSES_PER_VISIT: u32 = 16;

/// Passes to fetch as many entries as there are threads.
const PASSES_PER_FETCH: u32 = 3;

/// Passes of a queue at most: that one, 8 to fill it, 6 that do not search for control points, and 5 for its voxels, two by two.
const PASSES_PER_QUEUE: u32 = 20;

/// Passes of a group at most besides: that one, 12 that find no more voxels, and 2 to composite; without bricks 14.
const PASSES_PER_GROUP: u32 = 16;

/// Passes that a thread may take, and takes at most.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Passes {
    /// In one dispatch.
    pub most: u32,
    /// For a group, bricks not counted.
    pub per_group: u32,
    /// To fetch entries, one for each thread.
    pub per_fetch: u32,
    /// To visit a brick.
    pub per_visit: u32,
    /// For a queue of voxels.
    pub per_queue: u32,
}

impl Passes {
    /// Those of a view whose voxels take at most `search` passes to look up their control points in memory.
    fn new(search: u32) -> Self {
        let per_queue = PASSES_PER_QUEUE + search;
        Self {
            most: MAX_PASSES,
            per_group: PASSES_PER_GROUP,
            per_fetch: PASSES_PER_FETCH,
            per_visit: PASSES_PER_VISIT,
            per_queue,
        }
    }

    /// For a brick, visited and in queues.
    pub fn per_brick(&self) -> u32 {
        self.per_visit + QUEUES_PER_BRICK * self.per_queue
    }
}

/// Bricks by tile and sheet group.
#[derive(Clone, Debug, PartialEq)]
pub struct TileBins {
    /// The first slab of the nearest group.
    pub first_slab: i32,
    /// Number of tiles.
    pub tiles: u32,
    /// Sheet groups of every tile.
    pub groups: u32,
    /// Where every tile's groups start in `entries`, in the order they are composited in, tile after tile; at last the end.
    pub starts: Vec<u32>,
    /// Number of a brick, and in the last byte the units of the tile that it may touch, row by row.
    pub entries: Vec<u32>,
    /// For every group, nearest first, half the screen box around its footprints, pixels.
    pub half_boxes: Vec<DVec2>,
    /// What bounds a dispatch.
    pub passes: Passes,
    /// Dispatches that are enough for every tile.
    pub dispatches: u32,
}

/// Why a view cannot be drawn by tiles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unfit {
    /// What there is too much of.
    pub what: &'static str,
    /// How much there is.
    pub required: u64,
    /// How much there may be.
    pub actual: u64,
}

impl From<Unfit> for RenderError {
    fn from(Unfit { what, required, actual }: Unfit) -> Self {
        Self::OutOfRange {
            key: "splatting.rasterizer",
            found: format!("\"tiles\" with {required} {what}"),
            allowed: format!("at most {actual}, or \"quads\""),
        }
    }
}

/// Where a brick's voxels are: bounds of their pixel coordinates, and the groups that their kernels may reach.
struct Placed {
    number: u32,
    low: DVec2,
    high: DVec2,
    groups: Range<i32>,
}

/// Pixels that footprints may touch, both ends inclusive.
struct Pixels {
    first: [u32; 2],
    last: [u32; 2],
}

impl TileBins {
    /// Sorts bricks by the tiles and groups they may touch, with kernels of the radius `support`. The sheet depths `covered` are in some
    /// group even where they hold nothing. A thread passes through loops at most
    /// `search_passes` times to look up a voxel's control points in memory. Neither list may have more than `most_words` words.
    ///
    /// # Errors
    /// If there are more bricks, or more of them behind a tile, than the rasteriser can take.
    pub fn new(
        bricks: &[Brick],
        view: &View,
        order: Order,
        covered: Range<f64>,
        support: f64,
        search_passes: u32,
        most_words: u64,
    ) -> Result<Self, Unfit> {
        let check = |what, required: u64, actual: u64| {
            if required <= actual { Ok(()) } else { Err(Unfit { what, required, actual }) }
        };
        check("bricks", bricks.len() as u64, MAX_BRICKS as u64)?;
        let placed = place(bricks, view);
        let planes = view.slabs.groups(SHEETS);
        let covered = planes.covered(covered);
        let all = || placed.iter().map(|brick| &brick.groups).chain(&covered);
        let first_group = all().map(|groups| groups.start).min().unwrap_or(0);
        let end_group = all().map(|groups| groups.end).max().unwrap_or(0);
        let groups = (end_group - first_group) as u32;
        let [columns, rows] = view.size.map(|pixels| pixels.div_ceil(SIDE));
        let bins = u64::from(columns) * u64::from(rows) * u64::from(groups);
        check("tiles times sheet groups", bins, most_words - 1)?;

        let half_boxes: Vec<DVec2> = (first_group..end_group)
            .map(|group| view.half_box(support, planes.plane(group)..planes.plane(group + 1)))
            .collect();

        // A counting sort: bins' sizes, where they start, and their entries.
        let bins_of = |brick: &Placed, visit: &mut dyn FnMut(usize, u32)| {
            for group in brick.groups.clone() {
                let at = match order {
                    Order::FrontToBack => group - first_group,
                    Order::BackToFront => end_group - 1 - group,
                };
                let half_box = half_boxes[(group - first_group) as usize];
                let Some(pixels) = brick.pixels(half_box, view.size) else { continue };
                for y in pixels.first[1] / SIDE..=pixels.last[1] / SIDE {
                    for x in pixels.first[0] / SIDE..=pixels.last[0] / SIDE {
                        let units = units_touched(&pixels, [x * SIDE, y * SIDE]);
                        visit(((y * columns + x) * groups) as usize + at as usize, units);
                    }
                }
            }
        };
        let mut starts = vec![0_u32; bins as usize + 1];
        let mut total = 0_u64;
        for brick in &placed {
            bins_of(brick, &mut |bin, _| {
                starts[bin + 1] += 1;
                total += 1;
            });
        }
        check("bricks' parts in tiles and sheet groups", total, most_words)?;
        for bin in 1..starts.len() {
            starts[bin] += starts[bin - 1];
        }
        let mut next = starts.clone();
        let mut entries = vec![0; total as usize];
        for brick in &placed {
            bins_of(brick, &mut |bin, units| {
                entries[next[bin] as usize] = brick.number | units << 24;
                next[bin] += 1;
            });
        }
        let passes = Passes::new(search_passes);
        let dispatches = dispatches(&starts, &entries, groups as usize, &passes)?;
        Ok(Self {
            first_slab: first_group * SHEETS as i32,
            tiles: columns * rows,
            groups,
            starts,
            entries,
            half_boxes,
            passes,
            dispatches,
        })
    }
}

impl Placed {
    /// Pixels that footprints may touch which reach so far around voxels.
    fn pixels(&self, half_box: DVec2, size: [u32; 2]) -> Option<Pixels> {
        // More slack than the shader rounds with.
        let reach = half_box + 0.02;
        let first = (self.low - reach - 0.5).ceil().max(DVec2::ZERO);
        let last = (self.high + reach - 0.5).floor().min(DVec2::from(size.map(f64::from)) - 1.0);
        let pixels = Pixels { first: first.as_uvec2().to_array(), last: last.as_uvec2().to_array() };
        first.cmple(last).all().then_some(pixels)
    }
}

/// The bricks that are before the eye, in memory order whatever changes of iso-range came before: equal scenes add up in equal order.
fn place(bricks: &[Brick], view: &View) -> Vec<Placed> {
    let groups = view.slabs.groups(SHEETS);
    let mut placed: Vec<Placed> = (bricks.par_iter().enumerate())
        .filter(|(_, brick)| brick.present != [0; 2])
        .filter_map(|(number, brick)| {
            let (middle, half) = brick::bounds(brick);
            let bounds = view.bounds(middle, half)?;
            let is_beyond_near = bounds.depths.start < bounds.depths.end;
            is_beyond_near.then(|| Placed {
                number: number as u32,
                low: bounds.low,
                high: bounds.high,
                groups: groups.touched(bounds.depths.start, bounds.depths.end),
            })
        })
        .collect();
    let position = |placed: &Placed| brick::position(&bricks[placed.number as usize]);
    if !placed.is_sorted_by_key(position) {
        placed.par_sort_unstable_by_key(position);
    }
    placed
}

/// Which units of the tile at `corner` some pixels touch, one bit each.
fn units_touched(pixels: &Pixels, corner: [u32; 2]) -> u32 {
    let touches = |axis: usize, unit: u32| {
        let low = corner[axis] + unit * UNIT[axis];
        pixels.first[axis] < low + UNIT[axis] && pixels.last[axis] >= low
    };
    let bit = |unit: u32| u32::from(touches(0, unit % 2) && touches(1, unit / 2)) << unit;
    (0..UNITS).map(bit).sum()
}

/// Dispatches that are enough for every subgroup of every tile: in each it takes groups until one might be too much.
fn dispatches(starts: &[u32], entries: &[u32], groups: usize, passes: &Passes) -> Result<u32, Unfit> {
    let most_bricks = passes.most.saturating_sub(passes.per_group) / passes.per_brick();
    // Of one unit's 8 threads, or of 32 threads and all units: those need the fewest queues.
    let of_subgroup = |starts: &[u32], units: u32, per_brick: u32| {
        let (mut dispatches, mut taken) = (1, 0);
        for group in starts.windows(2) {
            let bricks = &entries[group[0] as usize..group[1] as usize];
            if taken + passes.per_group + bricks.len() as u32 * passes.per_brick() > passes.most {
                dispatches += 1;
                taken = 0;
            }
            let visited = bricks.iter().filter(|&&entry| entry >> 24 & units != 0).count() as u32;
            taken += passes.per_group + visited * per_brick + (bricks.len() as u32).div_ceil(8) * passes.per_fetch;
        }
        dispatches
    };
    let of_tile = |first: usize| {
        let starts = &starts[first..=first + groups];
        let bricks = starts.windows(2).map(|group| group[1] - group[0]).max().unwrap_or(0);
        if bricks > most_bricks {
            let (what, required) = ("bricks behind a tile in one sheet group", bricks.into());
            return Err(Unfit { what, required, actual: most_bricks.into() });
        }
        let of_unit = |unit: u32| of_subgroup(starts, 1 << unit, passes.per_brick());
        let of_all = of_subgroup(starts, !0, passes.per_visit + QUEUES_PER_BRICK / 4 * passes.per_queue);
        Ok((0..UNITS).map(of_unit).fold(of_all, u32::max))
    };
    let tiles = (0..starts.len() - 1).into_par_iter().step_by(groups.max(1));
    tiles.map(of_tile).try_reduce(|| 0, |a, b| Ok(a.max(b)))
}
