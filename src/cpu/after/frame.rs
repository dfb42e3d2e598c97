//! A frame where classification comes after splatting: the data that its tiles share, and its tiles drawn on all cores.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

use fearless_simd::Level;
use fearless_simd::prelude::*;
use glam::{DVec3, UVec3};

use super::field::Field;
use super::low_pass::LowPass;
use super::matter::Matter;
use super::place::Placement;
use super::planes::Points;
use super::slab_integral::Integrals;
use super::tile::TileWalk;
use crate::after::normalization::Normalization;
use crate::cpu::composite::Compositor;
use crate::cpu::cut::{RayMode, TileRays};
use crate::cpu::first_hit;
use crate::cpu::frame::{Drawing, Host, Outputs, Tile, draw_tiles};
use crate::cpu::resolve;
use crate::cpu::shade::Shader;
use crate::cpu::sheets::{COLUMNS, ROWS};
use crate::cpu::simd::dispatch;
use crate::geometry::pixel_ray::counted;
use crate::geometry::view_geometry::ViewGeometry;
use crate::light::Lights;
use crate::lists::brick;
use crate::lists::brick::Brick;
use crate::lists::quad_plan::tile_grid;
use crate::parallel::prelude::*;
use crate::part::Resolver;
use crate::scene::Scene;
use crate::settings::shading::MIN_GRADIENT;
use crate::settings::splatting::{Classification, Compositing, Order, sheets_per_test};
use crate::settings::transfer_function::TransferFunction;
use crate::settings::window::{Region, Window};
use crate::stats::Counts;
use crate::volume::Grid;

/// Everything that decides a tile in one channel.
#[derive(Debug)]
pub(in crate::cpu) struct Frame<'a> {
    /// The channel's number; sheets are sums over all channels (SPEC §10).
    pub(super) channel: usize,
    pub(super) matter: Matter<'a>,
    pub(super) grid: Grid,
    pub(super) transfer: &'a TransferFunction,
    /// The map from values to the numbers that are interpolated.
    pub(super) numbers: Normalization,
    pub(super) placement: Placement,
    pub(super) field: Field<'a>,
    pub(super) integrals: Integrals,
    pub(super) shader: Shader,
    /// The light sheets of all channels, if there are any.
    pub(super) lights: Option<Arc<Lights>>,
    pub(super) compositor: Compositor,
    /// After as many sheets opaque pixels are closed.
    pub(super) sheets_per_test: i32,
    pub(super) rays: RayMode,
    /// By brick of a grid in memory: [`WANTED`], [`DRAWN`], or 0.
    drawn: Vec<AtomicU8>,
    pub(super) compositing: Compositing,
    /// Whether values that are not chosen may be left out.
    pub(super) is_bounded: bool,
    /// Numbers that differ by less count as equal.
    pub(super) hair: f32,
    /// The number of segments of a slab, along each of which values run linearly.
    pub(super) segments: usize,
    /// From a difference of gradients times a way in `unit`s to an eighth of a difference of numbers.
    pub(super) bend: f32,
    /// Whether anything depends on gradients.
    pub(super) needs_gradients: bool,
    pub(super) has_gradient_opacity: bool,
    /// Values per number.
    pub(super) per_number: f32,
    /// In numbers per [`Field::gradient_length`].
    pub(super) min_gradient: f32,
    /// Whether labels have tables of their own.
    pub(super) labels: bool,
    /// To the eye, if that is far away.
    pub(super) to_eye: [f32; 3],
    /// The slabs whose sheets may hold anything of the channel.
    pub(super) touched: Range<i32>,
    /// The slabs that are drawn.
    pub(super) slabs: Range<i32>,
    /// The pixels that are drawn.
    pub(super) region: Region,
    /// `None` for a part of an image.
    resolver: Option<Resolver>,
}

/// A brick in whose cells rays may enter a slab with an opacity.
const WANTED: u8 = 1;
/// One that a tile has drawn.
const DRAWN: u8 = 2;

/// Values that differ by less, relative to the range of the coefficients, count as equal: in homogeneous matter only rounding tells them apart.
const HAIR_OF_RANGE: f32 = 2e-6;

impl<'a> Frame<'a> {
    /// A channel's frame in a view, the one that the coefficients were looked at in.
    pub(in crate::cpu) fn new(
        channel: usize,
        (matter, transfer): (Matter<'a>, &'a TransferFunction),
        scene: &Scene,
        view: ViewGeometry,
        Host { window, is_part, first_hit, surfaces, lights }: Host,
    ) -> Self {
        let (splatting, shading, grid) = (&scene.splatting, &scene.shading, matter.grid());
        let Window { slabs, region } = window;
        let placement = Placement::new(view, &grid, &slabs);
        let (numbers, labelled) = (matter.numbers(), matter.labelled());
        let can_hide = splatting.compositing.hides() && splatting.order == Order::FrontToBack;
        let tables = labelled.map(|_| transfer.labels.keys()).into_iter().flatten();
        let tables = tables.map(|&label| transfer.tables(Some(label))).chain([transfer.tables(None)]);
        let has_gradient_opacity = tables.into_iter().any(|tables| tables.gradient_opacity.is_some());
        let segments = splatting.segments() as usize;
        let unshaded = if scene.clip.shade_faces { 0 } else { scene.clip.half_spaces(&grid).len() };
        let mut drawn = Vec::new();
        if let Matter::Whole { coefficients, .. } = matter {
            drawn.resize_with(placement.bricks().element_product() as usize, || AtomicU8::new(0));
            for &brick in coefficients.wanted() {
                drawn[brick as usize].store(WANTED, Ordering::Relaxed);
            }
        }
        let (at_hand, extent, coefficients, colors) = matter.at_hand();
        let kernel = (splatting.radius, splatting.falloff);
        let field = Field::new(
            (at_hand, extent),
            (coefficients, colors),
            matter.differences(),
            numbers,
            kernel,
            shading.gradient,
        );
        Self {
            channel,
            matter,
            transfer,
            numbers,
            integrals: Integrals::new(labelled.is_some(), transfer, splatting, &matter.all_numbers()),
            shader: Shader::new(shading, &scene.camera.basis(), splatting.compositing),
            lights,
            compositor: Compositor {
                compositing: splatting.compositing,
                order: Order::FrontToBack,
                threshold: (splatting.culling && can_hide).then_some(splatting.opacity_threshold as f32),
                first_hit: first_hit.map(|opacity| opacity as f32),
            },
            sheets_per_test: sheets_per_test(splatting.slab_width) as i32,
            rays: RayMode::within(&view, &grid, (counted(&view, &scene.clip, &grid), unshaded), surfaces),
            drawn,
            compositing: splatting.compositing,
            is_bounded: splatting.culling,
            hair: HAIR_OF_RANGE * (numbers.range[1] - numbers.range[0]),
            segments,
            needs_gradients: shading.enabled || has_gradient_opacity || segments > 1,
            has_gradient_opacity,
            per_number: (1.0 / numbers.scale) as f32,
            bend: (grid.unit() / field.gradient_length / 8.0) as f32,
            // A length of 0 is below it.
            min_gradient: ((MIN_GRADIENT * numbers.scale * field.gradient_length) as f32).max(f32::MIN_POSITIVE),
            field,
            labels: labelled.is_some() && !transfer.labels.is_empty(),
            to_eye: (-view.basis.w).to_array().map(|component| component as f32),
            touched: touched(&placement, &matter),
            slabs,
            region,
            resolver: (!is_part).then(|| Resolver::new(splatting, Classification::After, scene.image.background)),
            grid,
            placement,
        }
    }

    /// The rays of a tile's pixels among slabs, and the pixels' directions to the eye where these differ.
    pub(super) fn rays_of_tile(&self, origin: [usize; 2]) -> (TileRays, Vec<[[f32; COLUMNS]; 3]>) {
        let mut rays = self.rays.of_tile(origin);
        let length = |ray: &crate::cpu::ray::PixelRay| (ray.length() / ray.slabs_per_depth()) as f32;
        let is_perspective = self.placement.view.perspective.is_some();
        let mut weights = vec![[length(&self.rays.rays.of(origin)); COLUMNS]; ROWS];
        let mut to_eye = vec![[[0.0; COLUMNS]; 3]; if is_perspective { ROWS } else { 0 }];
        if is_perspective {
            for (y, x) in (0..ROWS).flat_map(|y| (0..COLUMNS).map(move |x| (y, x))) {
                let ray = self.rays.rays.of([origin[0] + x, origin[1] + y]);
                weights[y][x] = length(&ray);
                let direction = ray.toward_eye();
                (0..3).for_each(|axis| to_eye[y][axis][x] = direction[axis] as f32);
            }
        }
        rays.weights = Some(weights);
        (rays, to_eye)
    }

    /// Draws all tiles, each in all channels.
    pub(in crate::cpu) fn draw(frames: &[Self], level: Level) -> Drawing {
        let first = &frames[0];
        let size = first.placement.view.size;
        let place = |frame: &Self| {
            if frame.is_searched() {
                return Vec::new();
            }
            let mut placed = frame.placement.place(&frame.matter.wanted(), |number| frame.matter.bounds(number));
            placed.iter_mut().for_each(|placed| placed.channel = frame.channel as u32);
            placed
        };
        let placed = frames.iter().map(place).collect::<Vec<_>>().concat();
        let has_hits = first.compositor.first_hit.is_some();
        let has_extremes = first.resolver.is_none() && first.compositing.is_choice();
        let (content, first_hits, tally) = draw_tiles(
            (size, &first.region),
            Outputs { has_hits, has_extremes },
            &placed,
            || TileWalk::new(frames),
            |walk, origin, bricks| {
                let (buffers, rays, tally) = dispatch!(level, simd => walk.draw(simd, origin, &placed, bricks));
                let mut pixels = resolve::tile(first.resolver.as_ref(), buffers);
                let unit = first.grid.unit();
                let first_hits = match has_hits {
                    true => first_hit::depths(buffers, rays, &first.rays.rays, origin, unit),
                    false => Vec::new(),
                };
                let extremes = if has_extremes { walk.extremes(&mut pixels) } else { Vec::new() };
                Tile { pixels, extremes, first_hits, tally }
            },
        );
        let [columns, rows] = tile_grid(size);
        let sheets = Self::touched(frames).len() as u64;
        let sections =
            frames.iter().map(|frame| frame.sections(level)).fold([0; 2], |sum, of| [sum[0] + of[0], sum[1] + of[1]]);
        let voxels = |frame: &Self| -> u64 {
            frame.matter.shown().iter().map(|brick| u64::from(brick::present(brick).count_ones())).sum()
        };
        let counts = Counts {
            voxels_total: first.grid.dims.as_u64vec3().element_product(),
            voxels_in_range: frames.iter().map(voxels).sum(),
            sections_total: sections[0],
            sections_rasterized: sections[1],
            sheets,
            tiles_total: u64::from(columns * rows) * sheets,
            tiles_composited: tally.tiles_composited,
            bricks_visited: tally.bricks_visited,
            ..Counts::default()
        };
        Drawing { content, counts, first_hits }
    }

    /// Whether each pixel's ray is searched for the value that it chooses.
    pub(super) fn is_searched(&self) -> bool {
        self.compositing.is_choice() && matches!(self.matter, Matter::Whole { .. })
    }

    /// The slabs whose sheets may hold anything in any channel.
    pub(super) fn touched(frames: &[Self]) -> Range<i32> {
        let touched = frames.iter().map(|frame| frame.touched.clone()).filter(|touched| !touched.is_empty());
        touched.reduce(|a, b| a.start.min(b.start)..a.end.max(b.end)).unwrap_or(0..0)
    }

    /// Reads what a box of voxels of a volume in memory, from one to before another, is drawn from: what is read counts for nothing, but is in the cache when
    /// it is drawn.
    pub(super) fn read_ahead(&self, (first, end): (UVec3, UVec3)) {
        if let Matter::Whole { .. } = self.matter {
            let cells = self.matter.cells();
            for (z, y) in (first.z..end.z).flat_map(|z| (first.y..end.y).map(move |y| (z, y))) {
                let index = self.field.extent.index(UVec3::new(first.x, y, z));
                std::hint::black_box((self.field.read(index), cells.map(|cells| cells.read(index))));
            }
        }
    }

    /// Records that a tile draws one of the grid's bricks. Returns whether it is the first one to.
    #[inline]
    pub(super) fn draw_brick(&self, brick: u32) -> bool {
        let Some(drawn) = self.drawn.get(brick as usize) else { return false };
        drawn.load(Ordering::Relaxed) != DRAWN && drawn.swap(DRAWN, Ordering::Relaxed) != DRAWN
    }

    /// The points of a plane in a tile, given by its first pixel, and the plane's kernels; `None` at the eye and behind it.
    pub(super) fn points(&self, plane: i32, origin: [usize; 2]) -> Option<(Points, LowPass)> {
        let Placement { geometry, view, .. } = &self.placement;
        if view.perspective.is_some() && plane <= 0 {
            return None;
        }
        let at = |column: usize, row: usize| self.voxel_at([origin[0] + column, origin[1] + row], plane.into());
        let first = at(0, 0);
        let points = Points {
            first,
            right: (at(COLUMNS, 0) - first) / COLUMNS as f64,
            down: (at(0, ROWS) - first) / ROWS as f64,
        };
        Some((points, LowPass::new(geometry, geometry.distance_from_eye(view.slabs.plane(plane)))))
    }

    /// Pairs of voxels and planes nearer to them than the kernel's radius: all, and those of bricks that were drawn. A brick that is not
    /// wanted itself was drawn unless its kernels reach wanted bricks and none of those was.
    fn sections(&self, level: Level) -> [u64; 2] {
        let Placement { geometry, view, .. } = &self.placement;
        let across = self.placement.bricks();
        let reach = (geometry.widest_half_box(view) / f64::from(brick::SIDE)).ceil().min(across.as_dvec3()).as_uvec3();
        let of_brick = |brick: &Brick| {
            let at = brick::origin(brick) / brick::SIDE;
            let (low, end) = (at.saturating_sub(reach), (at + reach + 1).min(across));
            let rows = (low.z..end.z).flat_map(|z| (low.y..end.y).map(move |y| across.x * (y + across.y * z)));
            let around = rows.flat_map(|row| &self.drawn[(row + low.x) as usize..(row + end.x) as usize]);
            let state = |state: &AtomicU8| state.load(Ordering::Relaxed);
            let own = state(&self.drawn[(at.x + across.x * (at.y + across.y * at.z)) as usize]);
            let is_hidden = if own == 0 { around.map(state).max() == Some(WANTED) } else { own == WANTED };
            let sections = dispatch!(level, simd => simd.vectorize(
                #[inline(always)]
                || self.placement.sections(simd, brick),
            ));
            [sections, if is_hidden { 0 } else { sections }]
        };
        self.matter.shown().par_iter().map(of_brick).reduce(|| [0; 2], |a, b| [a[0] + b[0], a[1] + b[1]])
    }
}

/// The slabs from the first to the last that the cells of the bricks reach that may be shown; of all voxels, if these are not known.
fn touched(placement: &Placement, matter: &Matter<'_>) -> Range<i32> {
    let view = &placement.view;
    let near = view.perspective.map_or(f64::NEG_INFINITY, |perspective| perspective.eye.near);
    let slabs = |(middle, half): (DVec3, DVec3)| {
        let row = view.screen_from_voxel[2];
        let depth = row.dot(middle.extend(1.0)) - view.slabs.origin;
        let spread = row.truncate().abs().dot(half + 0.5);
        let first = (depth - spread).max(near) / view.slabs.width;
        first.floor() as i32..((depth + spread) / view.slabs.width).ceil() as i32
    };
    let either = |a: Range<i32>, b: Range<i32>| a.start.min(b.start)..a.end.max(b.end);
    let all = match matter {
        Matter::Whole { .. } => matter.shown().par_iter().map(|brick| slabs(brick::bounds(brick))).reduce_with(either),
        Matter::Streamed { .. } => Some(slabs((matter.grid().center(), matter.grid().center()))),
    };
    all.filter(|all| !all.is_empty()).unwrap_or(0..0)
}
