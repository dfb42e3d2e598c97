//! What a frame's tiles share, and the frame: rows of tiles on all cores.

use fearless_simd::{Level, Simd, dispatch};
use rayon::prelude::*;

use super::bin::{self, Placed};
use super::composite::Compositor;
use super::count::{Drawn, Tally};
use super::cut::Cuts;
use super::kernel::KernelTables;
use super::project::Projection;
use super::resolve::Resolver;
use super::shade::Shader;
use super::sheets::{COLUMNS, ROWS};
use super::splat::Splatter;
use super::tile::TileWalk;
use crate::error::RenderError;
use crate::geometry::kernel::Kernel;
use crate::geometry::view_geometry::ViewGeometry;
use crate::gpu::layout::Brick;
use crate::image::Image;
use crate::lists::quad_plan::Overlaps;
use crate::scene::Scene;
use crate::settings::splatting::Order;
use crate::settings::transfer_function::TransferFunction;
use crate::stats::Counts;
use crate::volume::Volume;

/// Everything that decides a tile.
#[derive(Debug)]
pub(super) struct Frame<'a> {
    pub(super) volume: &'a Volume,
    pub(super) transfer: &'a TransferFunction,
    pub(super) bricks: &'a [Brick],
    pub(super) projection: Projection,
    pub(super) splatter: Splatter,
    pub(super) shader: Shader,
    pub(super) compositor: Compositor,
    pub(super) cuts: Option<Cuts>,
    pub(super) drawn: Drawn,
    /// The low-pass rule's, where it is the same for all sections.
    pub(super) amplitude: f64,
    support: f64,
    resolver: Resolver,
}

impl<'a> Frame<'a> {
    /// # Errors
    /// If the scene asks for more than can be computed.
    pub(super) fn new(
        volume: &'a Volume,
        transfer: &'a TransferFunction,
        bricks: &'a [Brick],
        scene: &Scene,
    ) -> Result<Self, RenderError> {
        let (splatting, image) = (&scene.splatting, &scene.image);
        let view = ViewGeometry::new(volume.grid(), &scene.camera, splatting, [image.width, image.height])?;
        let kernel = Kernel::new(splatting.radius, splatting.falloff);
        let from_pixels = view.footprint.footprint_from_pixels;
        let (right, down) = (from_pixels.x_axis, from_pixels.y_axis);
        let metric = [right.length_squared(), 2.0 * right.dot(down), down.length_squared()];
        let hides = splatting.culling && splatting.compositing.hides() && splatting.order == Order::FrontToBack;
        let splatter = Splatter {
            kernel: KernelTables::new(&kernel),
            radius: splatting.radius as f32,
            metric: metric.map(|coefficient| coefficient as f32),
            // A little less, for what f32 rounds.
            row_metric: ((1.0 - 1e-5) * (metric[2] - metric[1] * metric[1] / (4.0 * metric[0])).max(0.0)) as f32,
            half_box: view.footprint.half_box(kernel.support()).to_array().map(|half| half as f32),
            pixel_per_depth: view.perspective.map(|perspective| perspective.eye.pixel_per_depth as f32),
        };
        let compositor = Compositor {
            compositing: splatting.compositing,
            order: splatting.order,
            threshold: hides.then_some(splatting.opacity_threshold as f32),
        };
        Ok(Self {
            volume,
            transfer,
            bricks,
            splatter,
            shader: Shader::new(&scene.shading, splatting.compositing),
            compositor,
            cuts: Cuts::new(&scene.clip, &view, volume.grid()),
            drawn: Drawn::new(bricks.len(), &view),
            amplitude: if view.perspective.is_some() { 1.0 } else { view.footprint.amplitude },
            support: kernel.support(),
            resolver: Resolver::new(splatting.compositing, image.background),
            projection: Projection::new(view, splatting.order),
        })
    }

    /// Draws all tiles.
    pub(super) fn draw(&self, level: Level) -> (Image, Counts) {
        let [width, height] = self.projection.view.size;
        let placed = bin::place(self.bricks, &self.projection, self.support);
        let [columns, rows] = bin::tile_grid([width, height]);
        let mut pixels = vec![[0.0; 4]; width as usize * height as usize];
        let strips = pixels.par_chunks_mut(width as usize * ROWS).enumerate();
        let tallies = strips.map(|(row, strip)| self.draw_strip(level, &placed, row, columns, strip));
        let tally = tallies.reduce(Tally::default, |mut sum, tally| {
            sum += tally;
            sum
        });
        let Overlaps { voxels, sections, slabs } = Overlaps::count(self.bricks, &self.projection.view);
        let sheets = slabs.len() as u64;
        let counts = Counts {
            voxels_total: self.volume.values().len() as u64,
            voxels_in_range: voxels,
            voxels_shaded: tally.voxels_shaded,
            sections_total: sections,
            sections_rasterized: tally.sections,
            sheets,
            tiles_total: (columns * rows) as u64 * sheets,
            tiles_composited: tally.sheets_composited,
            bricks_visited: tally.bricks_visited,
            ..Counts::default()
        };
        (Image { width, height, pixels }, counts)
    }

    /// Draws a row of tiles.
    fn draw_strip(&self, level: Level, placed: &[Placed], row: usize, columns: usize, strip: &mut [[f32; 4]]) -> Tally {
        let bins = bin::bin(placed, row, columns);
        let width = self.projection.view.size[0] as usize;
        let tiles = bins.par_iter().enumerate().map_init(
            || TileWalk::new(self),
            |walk, (column, bricks)| {
                let origin = [column * COLUMNS, row * ROWS];
                dispatch!(level, simd => self.draw_tile(simd, walk, origin, placed, bricks))
            },
        );
        let mut tally = Tally::default();
        for (column, (pixels, tile_tally)) in tiles.collect::<Vec<_>>().into_iter().enumerate() {
            tally += tile_tally;
            for (line, pixels) in strip.chunks_mut(width).zip(pixels.chunks(COLUMNS)) {
                let line = &mut line[column * COLUMNS..];
                let count = line.len().min(COLUMNS);
                line[..count].copy_from_slice(&pixels[..count]);
            }
        }
        tally
    }

    /// The pixels of a tile, all of its rows and columns.
    #[inline(always)]
    fn draw_tile<S: Simd>(
        &self,
        simd: S,
        walk: &mut TileWalk,
        origin: [usize; 2],
        placed: &[Placed],
        bricks: &[u32],
    ) -> (Vec<[f32; 4]>, Tally) {
        let mut tally = Tally::default();
        let buffers = walk.draw(simd, origin, placed, bricks, &mut tally);
        let pixel =
            |row: &[[f32; COLUMNS]; 4], x: usize| self.resolver.pixel([row[0][x], row[1][x], row[2][x], row[3][x]]);
        let pixels = buffers.acc.iter().flat_map(|row| (0..COLUMNS).map(move |x| pixel(row, x)));
        (pixels.collect(), tally)
    }
}
