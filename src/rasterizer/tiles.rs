//! The tile rasterizer: one compute stage draws every tile front to back, its sheets in registers.

use std::mem::offset_of;
use std::ops::Range;

use wgpu::{Buffer, BufferUsages, CommandEncoder, Limits};

use super::way::SUBGROUP_SIZES;
use super::{Given, Needs, Prepared};
use crate::error::RenderError;
use crate::geometry::view_geometry::ViewGeometry;
use crate::gpu::bindings::{Wanted, grown, sizes, wanted, wanted_for, written};
use crate::gpu::layout::{Brick, Gather as GatherUniform, Gathered, Part, Tally};
use crate::gpu::timer::Timer;
use crate::gpu::uniforms;
use crate::lists::tile_bins::{self, SHEETS, TileBins};
use crate::pass::gather::{Gather, GatherBand, GatherBuffers, GatherMode};
use crate::rasterizer::request::FrameRequest;
use crate::settings::splatting::Order;
use crate::stats::GroupSlabs;

/// The stage.
#[derive(Debug, Default)]
pub(crate) struct TileRasterizer {
    gather: Gather,
}

/// A frame's part that is the tile rasterizer's.
#[derive(Debug)]
pub(crate) struct TileFrame {
    binned: Binned,
    uniform: Buffer,
    parts: Buffer,
    /// All bricks in one buffer, where the volume's own are in several.
    bricks: Option<Buffer>,
    starts: Buffer,
    entries: Buffer,
    gathered: Buffer,
    /// Where in it first hits start, bytes.
    hits: u64,
    half_boxes: Buffer,
    /// For every band of the compositing buffer its number, and the offset of its part and its tiles.
    dispatches: Vec<(usize, u32, u32)>,
    bands: Vec<GatherBand>,
}

/// What only changes with the view or the bricks.
#[derive(Debug)]
struct Binned {
    bins: TileBins,
    view: ViewGeometry,
    order: Order,
    /// [`means::covered`](crate::geometry::means::covered).
    covered: Range<f64>,
    /// Of the kernel; it changes the footprints' boxes.
    support: f64,
    revision: u64,
}

impl TileRasterizer {
    /// Bins bricks if need be, and allocates what does not fit any more. Sections need no table here.
    ///
    /// # Errors
    /// If there is too much behind a tile, or more bricks than a binding holds.
    pub(crate) fn prepare(
        &self,
        given: Given<'_>,
        previous: Option<TileFrame>,
    ) -> Result<(TileFrame, Prepared), RenderError> {
        let Given { device, queue, volume, request, .. } = given;
        let FrameRequest { splatting, view, kernel, covered, rays, .. } = request;
        let limits = device.limits();
        let mut old = Old::of(previous);
        let search = all_search_passes(request, volume.labels().is_some());
        let is_current = |old: &Binned| {
            old.view == *view
                && (old.order, old.revision, old.bins.passes.search) == (splatting.order, volume.revision, search)
                && (old.support, &old.covered) == (kernel.support(), covered)
        };
        let (current, stale) = match old.binned.take() {
            Some(binned) if is_current(&binned) => (Some(binned), false),
            _ => (None, true),
        };
        let bricks = volume.lists.all();
        let binned = match current {
            Some(binned) => binned,
            None => Binned {
                bins: bins(&limits, request, bricks, search)?,
                view: *view,
                order: splatting.order,
                covered: covered.clone(),
                support: kernel.support(),
                revision: volume.revision,
            },
        };
        let bins = &binned.bins;
        let uniform = uniforms::gather(view, kernel, splatting, bins, bricks.len() as u32);
        let wanted = WantedBuffers::new(&limits, request, bins, (bricks.len(), volume.lists.lists.len()))?;
        let write = |old, wanted: &Wanted, bytes: &[u8]| written(device, queue, old, wanted, bytes);
        let (starts, entries) = match (old.starts.take(), old.entries.take()) {
            (Some(starts), Some(entries)) if !stale => (starts, entries),
            (starts, entries) => (
                write(starts, &wanted.starts, bytemuck::cast_slice(&bins.starts))?,
                write(entries, &wanted.entries, bytemuck::cast_slice(&bins.entries))?,
            ),
        };
        let half_boxes: Vec<[f32; 2]> = bins.half_boxes.iter().map(|&pixels| uniforms::in_f32_pixels(pixels)).collect();
        let half_boxes = write(old.half_boxes.take(), &wanted.half_boxes, bytemuck::cast_slice(&half_boxes))?;
        let own_bricks = match (wanted.bricks, old.bricks.take()) {
            (None, _) => None,
            (_, Some(bricks)) if !stale => Some(bricks),
            (Some(wanted), old) => Some(write(old, &wanted, bytemuck::cast_slice(bricks))?),
        };
        let gathered = grown(device, old.gathered.take(), &wanted.gathered)?;
        let uniform = write(old.uniform.take(), &wanted.uniform, bytemuck::bytes_of(&uniform))?;

        let stride = part_stride(&limits);
        let (mut part_bytes, mut dispatches) = (Vec::new(), Vec::new());
        let [columns, _] = tile_bins::grid(view.size);
        for (at, band) in request.bands.iter().enumerate() {
            let first_tile = band.first_row / tile_bins::TILE[1] * columns;
            let tiles = band.rows.div_ceil(tile_bins::TILE[1]) * columns;
            let part = Part { first_row: band.first_row, first_tile, end_tile: first_tile + tiles };
            dispatches.push((at, part_bytes.len() as u32, tiles));
            part_bytes.extend_from_slice(bytemuck::bytes_of(&part));
            part_bytes.resize(part_bytes.len().next_multiple_of(stride), 0);
        }
        let parts = write(old.parts.take(), &wanted.parts, &part_bytes)?;

        let of_volume = [volume.labels().is_some(), volume.has_holes()];
        let mode = GatherMode::of(splatting, view.perspective.is_some(), of_volume, *rays, bins.parts);
        let buffers = GatherBuffers {
            frame: given.frame,
            gather: &uniform,
            parts: &parts,
            bricks: own_bricks.as_ref().unwrap_or_else(|| &volume.lists.lists[0].buffer),
            starts: &starts,
            entries: &entries,
            control_points: given.control_points,
            values: volume.values(),
            labels: volume.labels(),
            gathered: &gathered,
            half_boxes: &half_boxes,
            cut: given.cut,
        };
        let bind = |acc| self.gather.bind(device, mode, buffers, acc, bins.dispatches);
        let bands = given.compositing.bands.iter().map(|band| bind(&band.acc)).collect();
        let frame = TileFrame {
            binned,
            uniform,
            parts,
            bricks: own_bricks,
            starts,
            entries,
            gathered,
            hits: wanted.hits,
            half_boxes,
            dispatches,
            bands,
        };
        Ok((frame, Prepared { bucketed: stale, tabled: false }))
    }

    /// What a new frame of these bricks, in so many lists, will take.
    ///
    /// # Errors
    /// Those of [`Self::prepare`].
    pub(crate) fn estimate(
        limits: &Limits,
        request: &FrameRequest,
        (bricks, lists): (&[Brick], usize),
        by_label: bool,
    ) -> Result<Needs, RenderError> {
        let bins = bins(limits, request, bricks, all_search_passes(request, by_label))?;
        let wanted = WantedBuffers::new(limits, request, &bins, (bricks.len(), lists))?;
        let WantedBuffers { uniform, parts, starts, entries, gathered, half_boxes, bricks, .. } = wanted;
        let buffers: Vec<Wanted> =
            [uniform, parts, starts, entries, gathered, half_boxes].into_iter().chain(bricks).collect();
        let bands = request.bands.len() as u64 * GatherBand::estimate(bins.dispatches);
        let groups = bins.groups as usize;
        Ok(Needs { bytes: sizes(limits, &buffers)? + bands, groups, passes: TileFrame::PASSES })
    }

    /// Draws the frame.
    pub(crate) fn record(&self, encoder: &mut CommandEncoder, timer: &mut Option<Timer>, frame: &TileFrame) {
        encoder.clear_buffer(&frame.gathered, 0, None);
        frame.bands.iter().for_each(|band| band.clear(encoder));
        let mut pass = encoder.begin_compute_pass(&super::compute("sheetsplat.gather", timer, "gather"));
        for &(band, offset, tiles) in &frame.dispatches {
            self.gather.record(&mut pass, &frame.bands[band], offset, tiles);
        }
    }
}

impl TileFrame {
    /// Passes of a frame.
    pub(crate) const PASSES: usize = 1;

    /// Its groups' slabs.
    pub(crate) fn group_slabs(&self) -> GroupSlabs {
        let bins = &self.binned.bins;
        let firsts = (0..bins.groups as i32).map(|group| bins.first_slab + group * SHEETS as i32);
        let firsts = match self.binned.order {
            Order::FrontToBack => firsts.collect(),
            Order::BackToFront => firsts.rev().collect(),
        };
        GroupSlabs { firsts, sheets: SHEETS }
    }

    /// Copies the frame's counts to the start of `staging`.
    pub(crate) fn copy_counts(&self, encoder: &mut CommandEncoder, staging: &Buffer) {
        let bytes = size_of::<Tally>() as u64 + u64::from(self.binned.bins.groups) * 4;
        encoder.copy_buffer_to_buffer(&self.gathered, 0, staging, 0, bytes);
    }

    /// The words of first hits, and where in their buffer they start, bytes.
    pub(crate) fn first_hits(&self) -> (&Buffer, u64) {
        (&self.gathered, self.hits)
    }

    /// Bytes of GPU memory.
    pub(crate) fn gpu_bytes(&self) -> u64 {
        let Self { uniform, parts, starts, entries, gathered, half_boxes, bricks, .. } = self;
        let bands: u64 = self.bands.iter().map(GatherBand::gpu_bytes).sum();
        let buffers = [uniform, parts, starts, entries, gathered, half_boxes].into_iter().chain(bricks);
        bands + buffers.map(Buffer::size).sum::<u64>()
    }
}

/// The buffers of a frame, all but those of bands.
struct WantedBuffers {
    uniform: Wanted,
    parts: Wanted,
    starts: Wanted,
    entries: Wanted,
    gathered: Wanted,
    /// Where in it first hits start, bytes.
    hits: u64,
    half_boxes: Wanted,
    /// If the volume's own are in several buffers, or in none.
    bricks: Option<Wanted>,
}

impl WantedBuffers {
    /// For so many bricks, in so many lists.
    fn new(
        limits: &Limits,
        request: &FrameRequest,
        bins: &TileBins,
        (bricks, lists): (usize, usize),
    ) -> Result<Self, RenderError> {
        let FrameRequest { view, kernel, splatting, .. } = request;
        let (binding, storage) = (binding(limits), BufferUsages::STORAGE);
        let within = |what, required: u64| {
            let (limit, actual) = ("max_storage_buffer_binding_size", binding);
            if required > actual { Err(RenderError::Limit { what, limit, required, actual }) } else { Ok(required) }
        };
        // Bindings may not be empty.
        let brick_bytes = (bricks.max(1) * size_of::<Brick>()) as u64;
        let brick_bytes = match lists {
            1 => None,
            _ => Some(within("the bricks of the tile rasterizer", brick_bytes)?),
        };
        let words = uniforms::gather(view, kernel, splatting, bins, bricks as u32).hits;
        let hits = offset_of!(Gathered, words) as u64 + u64::from(words) * 4;
        let gathered = within("the tile rasterizer's counts and first hits", hits + request.hit_bytes())?;
        let words = |words: usize| words as u64 * 4;
        let part_bytes = (request.bands.len() * part_stride(limits)) as u64;
        Ok(Self {
            uniform: wanted_for("sheetsplat.gather", size_of::<GatherUniform>() as u64, BufferUsages::UNIFORM),
            parts: wanted_for("sheetsplat.parts", part_bytes, BufferUsages::UNIFORM),
            starts: wanted_for("sheetsplat.bin_starts", words(bins.starts.len()), storage),
            entries: wanted_for("sheetsplat.bin_entries", words(bins.entries.len()), storage),
            gathered: wanted(
                "sheetsplat.gathered",
                gathered,
                storage | BufferUsages::COPY_DST | BufferUsages::COPY_SRC,
            ),
            hits,
            half_boxes: wanted_for("sheetsplat.half_boxes", words(2 * bins.half_boxes.len()), storage),
            bricks: brick_bytes.map(|bytes| wanted_for("sheetsplat.all_bricks", bytes, storage)),
        })
    }
}

/// Bytes that a storage binding may have.
fn binding(limits: &Limits) -> u64 {
    limits.max_storage_buffer_binding_size.min(limits.max_buffer_size)
}

/// Bytes from one part to the next.
fn part_stride(limits: &Limits) -> usize {
    size_of::<Part>().next_multiple_of(limits.min_uniform_buffer_offset_alignment as usize)
}

fn bins(limits: &Limits, request: &FrameRequest, bricks: &[Brick], search: u32) -> Result<TileBins, RenderError> {
    let FrameRequest { view, splatting, kernel, covered, .. } = request;
    let most_words = binding(limits) / 4;
    let (order, support) = (splatting.order, kernel.support());
    Ok(TileBins::new(bricks, view, order, covered.clone(), support, search, most_words)?)
}

/// Passes through loops to look up a voxel's control points: all ramps are searched in memory if any is, as threads hold no more than one
/// point each.
fn all_search_passes(request: &FrameRequest, by_label: bool) -> u32 {
    let lengths = request.ramps.lengths();
    let in_memory = by_label || lengths.iter().any(|&points| points > *SUBGROUP_SIZES.start());
    if in_memory { 1 + lengths.iter().map(|&points| search_passes(points)).sum::<u32>() } else { 0 }
}

/// Passes through loops that a binary search among so many control points takes.
fn search_passes(points: u32) -> u32 {
    points.ilog2() + 2
}

/// What of the previous frame may be taken over.
#[derive(Default)]
struct Old {
    binned: Option<Binned>,
    uniform: Option<Buffer>,
    parts: Option<Buffer>,
    bricks: Option<Buffer>,
    starts: Option<Buffer>,
    entries: Option<Buffer>,
    gathered: Option<Buffer>,
    half_boxes: Option<Buffer>,
}

impl Old {
    fn of(frame: Option<TileFrame>) -> Self {
        let Some(frame) = frame else { return Self::default() };
        Self {
            binned: Some(frame.binned),
            uniform: Some(frame.uniform),
            parts: Some(frame.parts),
            bricks: frame.bricks,
            starts: Some(frame.starts),
            entries: Some(frame.entries),
            gathered: Some(frame.gathered),
            half_boxes: Some(frame.half_boxes),
        }
    }
}
