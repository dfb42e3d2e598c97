//! The bricks that every sheet group of every patch visits: the buckets (§5.1) of the tile rasterizer, which walks a patch's groups
//! front to back.

use std::ops::Range;

use glam::DVec2;

use crate::error::RenderError;
use crate::error::setting::SettingError;
use crate::geometry::plane_geometry::PlaneGeometry;
use crate::geometry::slab::SlabGrid;
use crate::geometry::view_geometry::ViewGeometry;
use crate::lists::brick;
use crate::lists::brick::Brick;
use crate::parallel;
use crate::parallel::prelude::*;
use crate::settings::splatting::Order;

/// The width and height of the rasterizer's patches in pixels.
pub const PATCH: [u32; 2] = [16, 8];

/// The number of 8×4 pixel blocks in a patch, which a subgroup of 8 threads draws in as many rounds.
pub const BLOCKS: u32 = 4;

/// The number of halves of blocks in a patch, which a subgroup of 4 threads draws in as many rounds.
pub const HALVES: u32 = 2 * BLOCKS;

/// The number of sheets in a group.
pub const SHEETS: u32 = 4;

/// The maximum number of bricks: a brick's index shares a word with a slot.
const MAX_BRICKS: usize = 1 << 26;

/// The maximum number of passes through loops that a thread takes in one dispatch: llvmpipe ends a thread's loops after 65 535 passes. Every
/// loop costs one extra pass for its exit check, and so do the loops nested in it. Threads count their passes and continue in the next
/// dispatch. The difference is left for the work before the first group and after the last; looks at rays before the first are counted by themselves.
const MAX_PASSES: u32 = 64900;

/// The maximum number of passes of a group without its bricks, and the additional passes per block, for subgroups of 8 threads.
const MAX_PASSES_OF_GROUP: u32 = 60;
const MAX_PASSES_OF_BLOCK: u32 = 40;

/// The maximum number of passes of a brick, for subgroups of 8 threads: 8 to fetch and visit it, 76 to find its voxels, 56 to shade them,
/// 8 to keep them, and 10 where the queue is full.
const MAX_PASSES_OF_BRICK: u32 = 158;

/// The same where values are gathered (SPEC §9): loading them takes 16 instead of shading's 56.
const MAX_PASSES_OF_BRICK_OF_VALUES: u32 = MAX_PASSES_OF_BRICK - 40;

/// The number of passes that classify and composite four slabs of a block.
const MAX_PASSES_OF_SLABS: u32 = 200;

/// The number of passes that composite four sheets of a block.
const MAX_PASSES_OF_SHEETS: u32 = 6;

/// The number of passes that add the sheets of these slabs to those of other layers.
const MAX_PASSES_OF_SUMS: u32 = 64;

/// The number of these slabs at the pixels of a thread.
const SLABS_OF_THREAD: u32 = 4 * SHEETS;

/// The number of passes that add a brick's voxels to a block.
const MAX_PASSES_OF_ADDITION: u32 = 56;

/// The number of times that a brick's voxels are shaded in parallel.
const SHADED_PER_BRICK: u32 = 8;

/// The number of passes that determine how a block's rays are cut, or over which stretch means count, if needed.
const MAX_PASSES_OF_LOOK: u32 = 140;

/// The maximum number of passes through loops per thread, and the maxima for each kind of work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Passes {
    /// The passes in one dispatch.
    pub most: u32,
    /// The passes of a group without its bricks.
    pub per_group: u32,
    /// The passes of a brick.
    pub per_brick: u32,
    /// The passes to look up a voxel's control points in memory; where values are gathered, to find a surface in a slab, and of a slab's second half.
    pub search: u32,
}

/// What decides the passes of a view.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Work {
    /// [`Passes::search`].
    pub search: u32,
    /// The number of threads in the smallest subgroups.
    pub threads: u32,
    /// The number of layers in which values are gathered; 1 where colours are.
    pub layers: u32,
    /// Whether rays are cut, or means of their sheets count: then all of a patch's rays are looked at before the first group.
    pub looks: bool,
}

impl Passes {
    /// The passes of a view in which a workgroup draws `blocks` blocks of a patch; `values` states whether values are gathered.
    pub fn new(Work { search, threads, layers, looks }: Work, blocks: u32, values: bool) -> Self {
        let (of_voxels, of_slabs) = match values {
            true => (
                MAX_PASSES_OF_BRICK_OF_VALUES,
                MAX_PASSES_OF_SLABS.saturating_add(SLABS_OF_THREAD.saturating_mul(search)),
            ),
            false => (MAX_PASSES_OF_BRICK + SHADED_PER_BRICK * search, MAX_PASSES_OF_SHEETS),
        };
        let of_slabs = of_slabs.saturating_add(if layers > 1 { MAX_PASSES_OF_SUMS } else { 0 });
        let of_block = of_slabs.saturating_add(MAX_PASSES_OF_BLOCK + MAX_PASSES_OF_LOOK);
        let per_group = layers.saturating_mul(blocks.saturating_mul(of_block).saturating_add(MAX_PASSES_OF_GROUP));
        // Where the queue cannot hold what is found for all layers, each finds its own.
        let searches = if layers > 1 { 1 + layers } else { 1 };
        let per_brick = of_voxels.saturating_mul(searches).saturating_add(layers * blocks * MAX_PASSES_OF_ADDITION);
        // Half as many threads take twice as many passes.
        let times = 8_u32.div_ceil(threads);
        let of_all = |passes: u32| passes.saturating_mul(times);
        let most = MAX_PASSES - if looks { of_all(blocks * MAX_PASSES_OF_LOOK) } else { 0 };
        Self { most, per_group: of_all(per_group), per_brick: of_all(per_brick), search }
    }
}

/// Bricks by patch and sheet group.
#[derive(Clone, Debug, PartialEq)]
pub struct PatchBins {
    /// The first slab of the nearest group.
    pub first_slab: i32,
    /// The number of patches.
    pub patches: u32,
    /// The number of sheet groups of every patch.
    pub groups: u32,
    /// The start of every bin in this list: for every patch its groups, in compositing order; then the end of the last one, which is that of the list. The
    /// bins themselves follow, indices of bricks.
    pub words: Vec<u32>,
    /// The number of bins.
    pub bins: u32,
    /// For every group, nearest first, half the screen box in pixels around its footprints.
    pub half_boxes: Vec<DVec2>,
    /// The number of workgroups per patch: one, or one per block if too much lies behind some patch.
    pub workgroups: u32,
    /// The limits on a dispatch.
    pub passes: Passes,
    /// A number of dispatches that suffices for every patch.
    pub dispatches: u32,
}

/// The quantity that makes a view too large for the tile rasterizer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TileCapacityError {
    /// The name of the quantity.
    pub what: &'static str,
    /// Its value.
    pub required: u64,
    /// Its maximum.
    pub actual: u64,
}

impl From<TileCapacityError> for RenderError {
    fn from(TileCapacityError { what, required, actual }: TileCapacityError) -> Self {
        let found = format!("\"tiles\" with {required} {what}");
        SettingError::new("splatting.rasterizer", found, format!("at most {actual}, or \"quads\"")).into()
    }
}

/// A brick's position in the view: bounds of its voxels' pixel coordinates, and the groups that their kernels may reach.
struct Placed {
    number: u32,
    low: DVec2,
    high: DVec2,
    groups: Range<i32>,
}

/// The pixels that footprints may touch, both ends inclusive.
struct Pixels {
    first: [u32; 2],
    last: [u32; 2],
}

impl PatchBins {
    /// Sorts bricks by the patches and groups they may touch, with kernels of the radius `support`. With `planes` (SPEC §9) it is a brick's planes that count, and its footprints on them. The sheet depths `covered` belong to some
    /// group even if they are empty; groups without any of the slabs `drawn` are left out. The list may have `most_words` words.
    ///
    /// # Errors
    /// If there are more bricks in total, or behind a patch, than the rasterizer supports.
    pub fn new(
        bricks: &[Brick],
        (view, planes): (&ViewGeometry, Option<&PlaneGeometry>),
        order: Order,
        (covered, drawn): (Range<f64>, &Range<i32>),
        support: f64,
        work: Work,
        most_words: u64,
    ) -> Result<Self, TileCapacityError> {
        let check = |what, required: u64, actual: u64| {
            if required <= actual { Ok(()) } else { Err(TileCapacityError { what, required, actual }) }
        };
        check("bricks", bricks.len() as u64, MAX_BRICKS as u64)?;
        let drawn = if drawn.is_empty() { 0..0 } else { SlabGrid::groups_of(drawn, SHEETS) };
        let within = |groups: Range<i32>| groups.start.max(drawn.start)..groups.end.min(drawn.end);
        let mut placed = place(bricks, view, planes);
        placed.iter_mut().for_each(|brick| brick.groups = within(brick.groups.clone()));
        placed.retain(|brick| !brick.groups.is_empty());
        let group_planes = view.slabs.groups(SHEETS);
        let covered = group_planes.covered(covered).map(within).filter(|groups| !groups.is_empty());
        let all = || placed.iter().map(|brick| &brick.groups).chain(&covered);
        let first_group = all().map(|groups| groups.start).min().unwrap_or(0);
        let end_group = all().map(|groups| groups.end).max().unwrap_or(0);
        let groups = (end_group - first_group) as u32;
        let [columns, rows] = grid(view.size);
        let bins = u64::from(columns) * u64::from(rows) * u64::from(groups);
        check("patches times sheet groups", bins, most_words - 1)?;

        let half_boxes: Vec<DVec2> = (first_group..end_group)
            .map(|group| match planes {
                // Footprints are largest on the first of the group's planes.
                Some(planes) => {
                    let first = planes.distance_from_eye(group_planes.plane(group) + view.slabs.width);
                    planes.footprint_half_box(support, first)
                }
                None => view.half_box(support, group_planes.plane(group)..group_planes.plane(group + 1)),
            })
            .collect();

        let strip_rows = rows.div_ceil(STRIPS_PER_THREAD * parallel::current_num_threads() as u32).max(1);
        let sort = Sort { placed: &placed, half_boxes: &half_boxes, order, first_group, size: view.size };
        let first_rows: Vec<u32> = (0..rows).step_by(strip_rows as usize).collect();
        let counted = |first: u32| sort.counted(first..(first + strip_rows).min(rows));
        let strips: Vec<Strip> = first_rows.into_par_iter().map(counted).collect();
        let total: u64 = strips.iter().map(|strip| strip.entries).sum();
        check("bricks in patches and sheet groups", total, most_words - 1 - bins)?;
        let mut words = Vec::with_capacity((bins + 1 + total) as usize);
        let mut next = bins as u32 + 1;
        for count in strips.iter().flat_map(|strip| &strip.counts) {
            words.push(next);
            next += count;
        }
        words.push(next);
        let entries: Vec<_> = strips.par_iter().map(|strip| sort.sorted(strip)).collect();
        entries.into_iter().for_each(|entries| words.extend(entries));
        let starts = &words[..=bins as usize];
        let of_workgroups = |workgroups| {
            let passes = Passes::new(work, BLOCKS / workgroups, planes.is_some());
            let dispatches = dispatches(starts, groups as usize, &passes);
            dispatches.map(|dispatches| (workgroups, passes, dispatches))
        };
        let (workgroups, passes, dispatches) = of_workgroups(1).or_else(|_| of_workgroups(BLOCKS))?;
        Ok(Self {
            first_slab: first_group * SHEETS as i32,
            patches: columns * rows,
            groups,
            words,
            bins: bins as u32,
            half_boxes,
            workgroups,
            passes,
            dispatches,
        })
    }

    /// The start of every bin in [`Self::words`], and the end of the last one.
    pub fn starts(&self) -> &[u32] {
        &self.words[..=self.bins as usize]
    }
}

/// The number of strips of patches that each thread sorts in turn.
const STRIPS_PER_THREAD: u32 = 2;

/// A counting sort of bricks in strips of rows of patches, whose bins are contiguous.
struct Sort<'a> {
    placed: &'a [Placed],
    half_boxes: &'a [DVec2],
    order: Order,
    first_group: i32,
    size: [u32; 2],
}

/// Some rows of patches, and the number of bricks in each of their bins.
struct Strip {
    rows: Range<u32>,
    counts: Vec<u32>,
    entries: u64,
}

impl Sort<'_> {
    /// Calls `visit` with the index of every brick and each of its bins, within some rows of patches.
    fn visit(&self, rows: &Range<u32>, mut visit: impl FnMut(u32, usize)) {
        let ([columns, _], groups) = (grid(self.size), self.half_boxes.len());
        let farthest = self.half_boxes.iter().fold(0.0_f64, |farthest, half_box| farthest.max(half_box.y)) + SLACK;
        let (top, bottom) = (f64::from(rows.start * PATCH[1]) - farthest, f64::from(rows.end * PATCH[1]) + farthest);
        for brick in self.placed.iter().filter(|brick| brick.high.y >= top && brick.low.y <= bottom) {
            let mut touched: Option<(DVec2, Option<Pixels>)> = None;
            for group in brick.groups.clone() {
                let nth = (group - self.first_group) as usize;
                let at = match self.order {
                    Order::FrontToBack => nth,
                    Order::BackToFront => groups - 1 - nth,
                };
                let half_box = self.half_boxes[nth];
                // Without perspective all groups have the same box.
                let (_, pixels) = match &touched {
                    Some(touched) if touched.0 == half_box => touched,
                    _ => touched.insert((half_box, brick.pixels(half_box, self.size))),
                };
                let Some(Pixels { first, last }) = pixels else { continue };
                for y in (first[1] / PATCH[1]).max(rows.start)..(last[1] / PATCH[1] + 1).min(rows.end) {
                    for x in first[0] / PATCH[0]..=last[0] / PATCH[0] {
                        visit(brick.number, ((y - rows.start) * columns + x) as usize * groups + at);
                    }
                }
            }
        }
    }

    fn counted(&self, rows: Range<u32>) -> Strip {
        let [columns, _] = grid(self.size);
        let mut counts = vec![0; rows.len() * columns as usize * self.half_boxes.len()];
        let mut entries = 0;
        self.visit(&rows, |_, bin| {
            counts[bin] += 1;
            entries += 1;
        });
        Strip { rows, counts, entries }
    }

    /// The entries of a strip's bins, bin after bin.
    fn sorted(&self, strip: &Strip) -> Vec<u32> {
        let mut end = 0;
        let starts = strip.counts.iter().map(|count| {
            end += count;
            end - count
        });
        let mut next: Vec<u32> = starts.collect();
        let mut entries = vec![0; strip.entries as usize];
        self.visit(&strip.rows, |number, bin| {
            entries[next[bin] as usize] = number;
            next[bin] += 1;
        });
        entries
    }
}

/// A margin in pixels around footprints' boxes, larger than the shader's rounding errors.
const SLACK: f64 = 0.02;

impl Placed {
    /// The pixels touched by footprints that reach `half_box` around the voxels.
    fn pixels(&self, half_box: DVec2, size: [u32; 2]) -> Option<Pixels> {
        let reach = half_box + SLACK;
        let first = (self.low - reach - 0.5).ceil().max(DVec2::ZERO);
        let last = (self.high + reach - 0.5).floor().min(DVec2::from(size.map(f64::from)) - 1.0);
        let pixels = Pixels { first: first.as_uvec2().to_array(), last: last.as_uvec2().to_array() };
        first.cmple(last).all().then_some(pixels)
    }
}

/// The bricks in front of the eye in memory order, so that equal scenes add up in equal order after any history of changes.
fn place(bricks: &[Brick], view: &ViewGeometry, planes: Option<&PlaneGeometry>) -> Vec<Placed> {
    let groups = view.slabs.groups(SHEETS);
    let mut placed: Vec<Placed> = (bricks.par_iter().enumerate())
        .filter(|(_, brick)| brick.present != [0; 2])
        .filter_map(|(number, brick)| {
            let (middle, half) = brick::bounds(brick);
            let bounds = match planes {
                Some(planes) => planes.bounds(view, middle, half)?,
                None => view.bounds(middle, half)?,
            };
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

/// The number of columns and rows of patches in an image.
pub fn grid(size: [u32; 2]) -> [u32; 2] {
    [size[0].div_ceil(PATCH[0]), size[1].div_ceil(PATCH[1])]
}

/// A number of dispatches that suffices for every patch, given the number of groups: each processes groups until the next one might exceed
/// the passes.
fn dispatches(starts: &[u32], groups: usize, passes: &Passes) -> Result<u32, TileCapacityError> {
    let most = u64::from(passes.most);
    if passes.per_group >= passes.most {
        let what = "passes through loops in one sheet group";
        return Err(TileCapacityError { what, required: passes.per_group.into(), actual: most });
    }
    let patches = (starts.len() - 1) / groups.max(1);
    let of_patch = |patch: usize| {
        let (mut dispatches, mut taken) = (1, 0);
        for group in 0..groups {
            let bin = patch * groups + group;
            let bricks = starts[bin + 1] - starts[bin];
            let needed = u64::from(passes.per_group) + u64::from(bricks) * u64::from(passes.per_brick);
            if taken + needed > most && taken > 0 {
                (dispatches, taken) = (dispatches + 1, 0);
            }
            taken += needed;
            if taken > most {
                let what = "bricks behind a patch in one sheet group";
                let actual = passes.most.saturating_sub(passes.per_group) / passes.per_brick;
                return Err(TileCapacityError { what, required: bricks.into(), actual: actual.into() });
            }
        }
        Ok(dispatches)
    };
    Ok((0..patches).into_par_iter().map(of_patch).collect::<Result<Vec<_>, _>>()?.into_iter().fold(0, u32::max))
}
