//! A frame: the data that its tiles share, and its rows of tiles drawn on all cores.

use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

use fearless_simd::{Level, Simd};
use glam::UVec3;

use super::bin::{self, Placed};
use super::composite::Compositor;
use super::count::{Drawn, Tally};
use super::cut::{RayMode, Surfaces};
use super::first_hit;
use super::kernel::KernelTables;
use super::material::{Material, Materials};
use super::project::Projection;
use super::resolve;
use super::shade::Shader;
use super::sheets::{COLUMNS, ROWS};
use super::simd::dispatch;
use super::splat::Splatter;
use super::stream::{Chunk, Stream};
use super::tile::TileWalk;
use crate::abandon::Abandoned;
use crate::geometry::means;
use crate::geometry::view_geometry::ViewGeometry;
use crate::kernel::Kernel;
use crate::light::Lights;
use crate::lists::brick::Brick;
use crate::lists::quad_plan::{Overlaps, PlaceDepths, tile_grid};
use crate::parallel::prelude::*;
use crate::part::{Content, Extreme, Resolver};
use crate::scene::Scene;
use crate::settings::clip::CutCells;
use crate::settings::splatting::{Classification, Method};
use crate::settings::transfer_function::TransferFunction;
use crate::settings::window::{Region, Window};
use crate::stats::Counts;
use crate::volume::{Grid, Volume};

/// The data that all tiles of a frame share.
#[derive(Debug)]
pub(super) struct Frame<'a> {
    pub(super) grid: Grid,
    pub(super) voxels: Voxels<'a>,
    pub(super) projection: Projection,
    pub(super) splatter: Splatter,
    pub(super) shader: Shader,
    /// The light sheets, if there are any.
    pub(super) lights: Option<Arc<Lights>>,
    /// The cells of voxels that are not shaded, because cuts go through them.
    pub(super) cut_cells: Option<CutCells>,
    pub(super) compositor: Compositor,
    pub(super) rays: RayMode,
    pub(super) drawn: Drawn,
    /// True if voxels are composited one by one.
    pub(super) is_each: bool,
    /// The sheets that count even where they are empty.
    pub(super) counted: Range<i32>,
    /// The sheets from the first to the last that any kernel touches.
    pub(super) touched: Range<i32>,
    /// The amplitude of the low-pass rule if it is the same for all sections, else 1.
    pub(super) amplitude: f64,
    /// The pixels that are drawn.
    pub(super) region: Region,
    support: f64,
    /// `None` for a part of an image.
    resolver: Option<Resolver>,
    overlaps: Overlaps,
}

/// Where voxels come from.
#[derive(Debug)]
pub(super) enum Voxels<'a> {
    /// Volumes in memory.
    Whole {
        /// The channels whose voxels are drawn as one (SPEC §10).
        channels: Vec<(&'a Volume, &'a TransferFunction)>,
        bricks: &'a [Brick],
        materials: &'a Materials,
    },
    /// A store, whose chunks are read as their depth comes.
    Streamed(&'a Arc<Stream>),
}

/// Memory that the next frame of the same bricks uses again. What is given back to the system costs a fault for every page when it is needed again.
#[derive(Debug, Default)]
pub(super) struct Reused {
    drawn: Drawn,
    placed: Vec<Placed>,
}

/// A copy gets memory of its own.
impl Clone for Reused {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl Reused {
    /// Draws the frame of a view in this memory; the arguments are those of [`Frame::new`].
    pub(super) fn draw(
        &mut self,
        (grid, voxels): (&Grid, Voxels<'_>),
        scene: &Scene,
        view: ViewGeometry,
        host: Host,
        level: Level,
    ) -> Drawing {
        let frame = Frame::new(grid, voxels, scene, view, host, (level, std::mem::take(&mut self.drawn)));
        let drawing = frame.draw(level, &mut self.placed);
        self.drawn = frame.drawn;
        drawing
    }
}

/// A drawn frame.
#[derive(Clone, Debug)]
pub(super) struct Drawing {
    /// The pixels of the region that was drawn.
    pub(super) content: Content,
    pub(super) counts: Counts,
    /// For every pixel the depth at which the opacity asked for is reached, world units along the camera's direction; infinite where it is
    /// not. Empty if none is asked for.
    pub(super) first_hits: Vec<f32>,
}

/// What a caller adds to a scene.
#[derive(Clone, Debug)]
pub(super) struct Host {
    /// The slabs and pixels that are drawn.
    pub(super) window: Window,
    /// Whether pixels are a part (SPEC §11), without the background.
    pub(super) is_part: bool,
    /// The opacity whose depth is requested.
    pub(super) first_hit: Option<f64>,
    /// The opaque surfaces that end rays.
    pub(super) surfaces: Option<Surfaces>,
    /// The light sheets of all channels, if there are any (SPEC §14).
    pub(super) lights: Option<Arc<Lights>>,
}

impl<'a> Frame<'a> {
    /// A frame in a view. `drawn` is the memory for its record of what is drawn.
    fn new(
        grid: &Grid,
        voxels: Voxels<'a>,
        scene: &Scene,
        view: ViewGeometry,
        Host { window, is_part, first_hit, surfaces, lights }: Host,
        (level, drawn): (Level, Drawn),
    ) -> Self {
        let (splatting, image) = (&scene.splatting, &scene.image);
        let kernel = Kernel::new(splatting.radius, splatting.falloff);
        let from_pixels = view.footprint.footprint_from_pixels;
        let (right, down) = (from_pixels.x_axis, from_pixels.y_axis);
        let metric = [right.length_squared(), 2.0 * right.dot(down), down.length_squared()];
        let is_each = splatting.method == Method::CompositeEverySample;
        let splatter = Splatter {
            kernel: KernelTables::new(&kernel),
            radius: splatting.radius as f32,
            metric: metric.map(|coefficient| coefficient as f32),
            pixel_per_depth: view.perspective.map(|perspective| perspective.eye.pixel_per_depth as f32),
            is_whole: splatting.method != Method::ImageAligned,
        };
        let compositor = Compositor {
            compositing: splatting.compositing,
            order: splatting.order,
            threshold: splatting.culls_from().filter(|_| !is_each).map(|opacity| opacity as f32),
            first_hit: first_hit.map(|opacity| opacity as f32),
        };
        let (bricks, overlaps) = match &voxels {
            Voxels::Whole { bricks, .. } => (bricks.len(), count_overlaps(level, bricks, &view)),
            // Every chunk counts its own.
            Voxels::Streamed(_) => (0, Overlaps { slabs: view.slabs_of(grid), ..Overlaps::default() }),
        };
        let covered = view.slabs.covered(means::covered(&view, grid, splatting));
        let Window { slabs, region } = window.with_lead(splatting.compositing, Classification::Before);
        let projection = Projection::new(view, splatting.order, &slabs);
        Self {
            grid: *grid,
            voxels,
            splatter,
            shader: Shader::new(&scene.shading, &scene.camera.basis(), splatting.compositing),
            lights,
            cut_cells: scene.clip.unshaded_cells(grid),
            compositor,
            rays: RayMode::new(scene, &view, grid, surfaces),
            drawn: drawn.renewed(bricks, &view),
            is_each,
            counted: covered.map_or(i32::MIN..i32::MIN, |slabs| projection.sheets_of(&slabs)),
            touched: projection.sheets_of(&overlaps.slabs),
            amplitude: if view.perspective.is_some() { 1.0 } else { view.footprint.amplitude },
            support: kernel.support(),
            region,
            resolver: (!is_part).then(|| Resolver::new(splatting, Classification::Before, image.background)),
            overlaps,
            projection,
        }
    }

    /// Draws all tiles. `placed` is the memory for where bricks are.
    fn draw(&self, level: Level, placed: &mut Vec<Placed>) -> Drawing {
        match &self.voxels {
            Voxels::Whole { bricks, .. } => bin::place(level, bricks, &self.projection, self.support, placed),
            Voxels::Streamed(stream) => *placed = stream.placed(),
        }
        let has_hits = self.compositor.first_hit.is_some();
        let outputs = Outputs { has_hits, has_extremes: false };
        let (content, first_hits, tally) = draw_tiles(
            (self.projection.view.size, &self.region),
            outputs,
            placed,
            || TileWalk::new(self),
            |walk, origin, bricks| dispatch!(level, simd => self.draw_tile(simd, walk, origin, placed, bricks)),
        );
        let [columns, rows] = tile_grid(self.projection.view.size);
        let overlaps = match &self.voxels {
            Voxels::Whole { .. } => self.overlaps.clone(),
            Voxels::Streamed(stream) => stream.overlaps(),
        };
        // There are no sheets where voxels are composited one by one.
        let sheets = if self.is_each { 0 } else { self.touched.len() as u64 };
        let counts = Counts {
            voxels_total: self.grid.dims.to_array().map(u64::from).iter().product(),
            voxels_in_range: overlaps.voxels,
            voxels_shaded: tally.voxels_shaded,
            sections_total: overlaps.sections,
            sections_rasterized: tally.sections,
            sheets,
            tiles_total: u64::from(columns * rows) * sheets,
            tiles_composited: if self.is_each { 0 } else { tally.tiles_composited },
            bricks_visited: tally.bricks_visited,
            ..Counts::default()
        };
        Drawing { content, counts, first_hits }
    }

    /// The number of channels whose voxels are drawn as one (SPEC §10).
    pub(super) fn channels(&self) -> usize {
        match &self.voxels {
            Voxels::Whole { channels, .. } => channels.len(),
            Voxels::Streamed(_) => 1,
        }
    }

    /// The material of a voxel in a channel, or in a chunk of a store.
    pub(super) fn material(&self, chunk: Option<&Chunk>, channel: usize, voxel: UVec3) -> Material {
        match (&self.voxels, chunk) {
            (Voxels::Whole { channels, .. }, _) => {
                let (volume, transfer) = channels[channel];
                Material::of(volume, transfer, voxel)
            }
            (Voxels::Streamed(stream), Some(chunk)) => stream.material(chunk, voxel),
            (Voxels::Streamed(_), None) => Material::default(),
        }
    }

    /// Whether a part of the image is drawn.
    pub(super) fn is_part(&self) -> bool {
        self.resolver.is_none()
    }

    /// Draws a tile, including rows and columns outside the image.
    #[inline(always)]
    fn draw_tile<S: Simd>(
        &self,
        simd: S,
        walk: &mut TileWalk,
        origin: [usize; 2],
        placed: &[Placed],
        bricks: &[u32],
    ) -> Tile {
        let (buffers, rays, tally) = walk.draw(simd, origin, placed, bricks);
        let pixels = resolve::tile(self.resolver.as_ref(), buffers);
        let first_hits = match self.compositor.first_hit {
            None => Vec::new(),
            Some(_) => first_hit::depths(buffers, rays, &self.rays.rays, origin, self.grid.unit()),
        };
        Tile { pixels, extremes: Vec::new(), first_hits, tally }
    }
}

/// [`Overlaps::count`] by an instruction set.
fn count_overlaps(level: Level, bricks: &[Brick], view: &ViewGeometry) -> Overlaps {
    /// The bricks that a thread counts at a time.
    const AT_A_TIME: usize = 512;
    let depths = PlaceDepths::new(view);
    let of_chunk = |bricks: &[Brick]| {
        dispatch!(level, simd => simd.vectorize(
            #[inline(always)]
            || {
                let mut sum = Overlaps::default();
                for brick in bricks {
                    sum = sum.and(match view.perspective {
                        None => depths.overlaps(brick),
                        Some(_) => Overlaps::of_brick(brick, view),
                    });
                }
                sum
            },
        ))
    };
    bricks.par_chunks(AT_A_TIME).map(of_chunk).reduce(Overlaps::default, Overlaps::and)
}

/// The pixels of a tile, row by row.
#[derive(Default)]
pub(super) struct Tile {
    pub(super) pixels: Vec<[f32; 4]>,
    /// Empty if no extremes are requested.
    pub(super) extremes: Vec<Extreme>,
    /// Empty if no first hits are requested.
    pub(super) first_hits: Vec<f32>,
    pub(super) tally: Tally,
}

/// What is requested of pixels beside their colours.
#[derive(Clone, Copy)]
pub(super) struct Outputs {
    pub(super) has_hits: bool,
    pub(super) has_extremes: bool,
}

/// Draws the tiles of a region of an image on all cores by `draw_tile`, which gets a walk that no other tile uses meanwhile, the tile's first pixel and
/// its bricks. Returns the region's pixels, first hits if they are requested, and counts of the work.
pub(super) fn draw_tiles<W: Send>(
    (size, region): ([u32; 2], &Region),
    Outputs { has_hits, has_extremes }: Outputs,
    placed: &[Placed],
    new_walk: impl Fn() -> W + Sync,
    draw_tile: impl Fn(&mut W, [usize; 2], &[u32]) -> Tile + Sync,
) -> (Content, Vec<f32>, Tally) {
    let columns = bin::columns(size);
    let drawn = region.columns().start / COLUMNS..region.columns().end.div_ceil(COLUMNS);
    let count = |is_requested: bool| if is_requested { region.pixels() } else { 0 };
    let mut colors = vec![[0.0; 4]; count(true)];
    let mut extremes = vec![Extreme::default(); count(has_extremes)];
    let mut first_hits = vec![f32::INFINITY; count(has_hits)];
    let others = strips(&mut extremes, region).into_iter().zip(strips(&mut first_hits, region));
    let strips: Vec<_> = strips(&mut colors, region).into_iter().zip(others).collect();
    let first_row = region.rows().start / ROWS;
    let by_row = bin::by_row(placed, first_row + strips.len());
    let walks = Mutex::new(Vec::new());
    let idle_walks = || walks.lock().unwrap_or_else(PoisonError::into_inner);
    let abandoned = Abandoned::here();
    let tally = strips.into_par_iter().enumerate().map(|(at, (colors, (extremes, hits)))| {
        let row = first_row + at;
        let bins = bin::by_tile(&by_row[row], columns);
        // Tile by tile, because a thread that is handed several of the last ones draws alone while others wait.
        let tiles = bins[drawn.clone()].par_iter().zip(drawn.clone()).with_max_len(1).map(|(bricks, column)| {
            if abandoned.is_true() {
                return Tile::default();
            }
            let idle = idle_walks().pop();
            let mut walk = idle.unwrap_or_else(&new_walk);
            let tile = draw_tile(&mut walk, [column * COLUMNS, row * ROWS], bricks);
            idle_walks().push(walk);
            tile
        });
        let mut tally = Tally::default();
        for (column, tile) in drawn.clone().zip(tiles.collect::<Vec<_>>()) {
            tally += tile.tally;
            copy_tile(&tile.pixels, [column, row], region, colors);
            copy_tile(&tile.extremes, [column, row], region, extremes);
            copy_tile(&tile.first_hits, [column, row], region, hits);
        }
        tally
    });
    let tally = tally.reduce(Tally::default, |mut sum, tally| {
        sum += tally;
        sum
    });
    (Content { colors, extremes }, first_hits, tally)
}

/// The rows of a region that lie in a row of tiles.
fn rows_in(region: &Region, row: usize) -> Range<usize> {
    region.rows().start.max(row * ROWS)..region.rows().end.min((row + 1) * ROWS)
}

/// A region's pixels by rows of tiles; empty slices of no pixels.
fn strips<'a, T>(mut pixels: &'a mut [T], region: &Region) -> Vec<&'a mut [T]> {
    let width = if pixels.is_empty() { 0 } else { region.width as usize };
    let rows = region.rows().start / ROWS..region.rows().end.div_ceil(ROWS);
    let strip = |row: usize| {
        let (strip, rest) = std::mem::take(&mut pixels).split_at_mut(rows_in(region, row).len() * width);
        pixels = rest;
        strip
    };
    rows.map(strip).collect()
}

/// Copies the part of a tile that lies in the region to its place in a row of tiles.
fn copy_tile<T: Copy>(tile: &[T], [column, row]: [usize; 2], region: &Region, strip: &mut [T]) {
    let left = region.columns().start.max(column * COLUMNS);
    let right = region.columns().end.min((column + 1) * COLUMNS);
    let lines = tile.chunks(COLUMNS).skip(rows_in(region, row).start - row * ROWS);
    for (line, tile) in strip.chunks_mut(region.width as usize).zip(lines) {
        let tile = &tile[left - column * COLUMNS..right - column * COLUMNS];
        line[left - region.columns().start..right - region.columns().start].copy_from_slice(tile);
    }
}
