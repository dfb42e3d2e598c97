//! Bricks by tile and first sheet: the buckets (§5.1) of the native backend.

use std::ops::Range;

use fearless_simd::{Level, Simd};
use glam::{DVec2, DVec3};

use super::project::Projection;
use super::sheets::{COLUMNS, ROWS};
use super::simd::dispatch;
use crate::lists::brick;
use crate::lists::brick::Brick;
use crate::parallel::prelude::*;

/// Slack around footprints' boxes for rounding in f32: pixels, and a fraction of the box.
const SLACK: f64 = 0.02;
const RELATIVE_SLACK: f64 = 1e-5;

/// A brick as a view sees it.
#[derive(Clone, Debug)]
pub(super) struct Placed {
    /// Its number in the list of bricks.
    pub(super) brick: u32,
    /// The channel whose brick it is, where each has bricks of its own.
    pub(super) channel: u32,
    /// The first sheet that its kernels may reach.
    pub(super) first: i32,
    /// The sheet behind the last one.
    pub(super) end: i32,
    /// Half the size of a box that contains the box around any of its footprints, pixels.
    pub(super) half_box: [f32; 2],
    /// The middle of the box around all of its footprints, in pixel coordinates whose whole numbers are pixel centres, and half its size.
    pub(super) middle: [f32; 2],
    pub(super) half: [f32; 2],
    /// The tiles that its footprints may touch: the first and last column, and the first and last row. Off the image the first are larger.
    pub(super) columns: [u16; 2],
    pub(super) rows: [u16; 2],
}

impl Placed {
    /// A brick off the image.
    const NOWHERE: Self = Self {
        brick: 0,
        channel: 0,
        first: 0,
        end: 0,
        half_box: [0.0; 2],
        middle: [0.0; 2],
        half: [0.0; 2],
        columns: [1, 0],
        rows: [1, 0],
    };
}

/// The number of columns of tiles in an image.
pub(super) fn columns(size: [u32; 2]) -> usize {
    (size[0] as usize).div_ceil(COLUMNS)
}

/// Where all bricks are, in their order; `placed` is the memory for it.
pub(super) fn place(level: Level, bricks: &[Brick], projection: &Projection, support: f64, placed: &mut Vec<Placed>) {
    /// The bricks that a thread places at a time.
    const AT_A_TIME: usize = 1024;
    placed.resize(bricks.len(), Placed::NOWHERE);
    let chunks = bricks.par_chunks(AT_A_TIME).zip(placed.par_chunks_mut(AT_A_TIME)).enumerate();
    chunks.for_each(|(chunk, (bricks, placed))| {
        dispatch!(level, simd => simd.vectorize(
            #[inline(always)]
            || {
                for ((number, brick), placed) in (chunk * AT_A_TIME..).zip(bricks).zip(placed) {
                    *placed = place_brick(number as u32, brick, projection, support).unwrap_or(Placed::NOWHERE);
                }
            },
        ));
    });
}

/// Where a brick is; `None` off the image.
#[inline(always)]
pub(super) fn place_brick(number: u32, brick: &Brick, projection: &Projection, support: f64) -> Option<Placed> {
    place_box(number, brick::bounds(brick), projection, support)
}

/// Where a box of voxels is, given by its middle and half its size; `None` off the image.
#[inline(always)]
pub(super) fn place_box(
    number: u32,
    (middle, half): (DVec3, DVec3),
    projection: &Projection,
    support: f64,
) -> Option<Placed> {
    let view = &projection.view;
    let bounds = view.bounds(middle, half)?;
    let Range { start, end } = bounds.depths;
    if start >= end {
        return None;
    }
    let half_box = view.half_box(support, start..end) * (1.0 + RELATIVE_SLACK) + SLACK;
    let tiles = |axis: usize, side: usize| {
        let low = (bounds.low - half_box - 0.5)[axis].max(0.0);
        let high = (bounds.high + half_box - 0.5)[axis].min(f64::from(view.size[axis]) - 1.0);
        // Pixel centres are at whole numbers here.
        (low <= high).then(|| [low, high].map(|pixel| (pixel as usize / side) as u16))
    };
    let (columns, rows) = (tiles(0, COLUMNS)?, tiles(1, ROWS)?);
    let Range { start: first, end } = projection.reached(&view.slabs.touched(start, end));
    if first >= end {
        return None;
    }
    let [half_box, middle, half] =
        [half_box, (bounds.low + bounds.high) / 2.0 - 0.5, (bounds.high - bounds.low) / 2.0 + half_box]
            .map(|of: DVec2| of.as_vec2().to_array());
    Some(Placed { brick: number, channel: 0, first, end, half_box, middle, half, columns, rows })
}

/// A placed brick in a row of tiles.
#[derive(Clone, Copy, Debug)]
pub(super) struct InRow {
    /// Its index in the list of placed bricks.
    at: u32,
    first: i32,
    columns: [u16; 2],
}

/// The bricks of each of some rows of tiles.
pub(super) fn by_row(placed: &[Placed], rows: usize) -> Vec<Vec<InRow>> {
    let mut by_row = vec![Vec::new(); rows];
    for (at, &Placed { first, columns, rows: [top, bottom], .. }) in (0..).zip(placed) {
        let rows = by_row.iter_mut().take(bottom as usize + 1).skip(top.into());
        rows.for_each(|row| row.push(InRow { at, first, columns }));
    }
    by_row
}

/// The bricks of every tile of a row of tiles, as indices into the list of placed bricks: by first sheet, those that share it in the list's order.
pub(super) fn by_tile(of_row: &[InRow], columns: usize) -> Vec<Vec<u32>> {
    let mut tiles = vec![Vec::new(); columns];
    for InRow { at, columns: [first, last], .. } in by_first(of_row) {
        tiles[first.into()..=last.into()].iter_mut().for_each(|tile| tile.push(at));
    }
    tiles
}

/// Sorts bricks by first sheet; those that share it keep their order.
fn by_first(bricks: &[InRow]) -> Vec<InRow> {
    let Some(least) = bricks.iter().map(|brick| brick.first).min() else { return Vec::new() };
    // How many begin before each sheet.
    let mut before = Vec::new();
    for brick in bricks {
        let next = (brick.first - least) as usize + 1;
        before.resize(before.len().max(next + 1), 0_u32);
        before[next] += 1;
    }
    let mut sum = 0;
    before.iter_mut().for_each(|count| (sum, *count) = (sum + *count, sum + *count));
    let mut sorted = bricks.to_vec();
    for brick in bricks {
        let place = &mut before[(brick.first - least) as usize];
        sorted[*place as usize] = *brick;
        *place += 1;
    }
    sorted
}
