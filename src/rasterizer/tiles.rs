//! The tile rasterizer: one compute stage draws every tile front to back, its sheets in registers.

use std::mem::offset_of;

use wgpu::{Buffer, BufferUsages, CommandEncoder, Device, Features};

use super::{Given, Prepared};
use crate::error::RenderError;
use crate::gpu::bindings::grown;
use crate::gpu::layout::{Brick, Gathered, Part, Tally};
use crate::gpu::timer::Timer;
use crate::gpu::uniforms;
use crate::pass::gather::{Gather, GatherBand, GatherBuffers, GatherMode};
use crate::splatting::{FootprintForm, Method, Order, Splatting};
use crate::stats::GroupSlabs;
use crate::tile_bins::{SHEETS, SIDE, TileBins};
use crate::view::View;

/// Threads that a subgroup may have.
const SUBGROUP_SIZES: std::ops::RangeInclusive<u32> = 8..=32;

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
    view: View,
    order: Order,
    /// Of the kernel; it changes the footprints' boxes.
    support: f64,
    search_passes: u32,
    revision: u64,
}

impl TileRasterizer {
    /// Why a device or some settings cannot be drawn by tiles; `None` if they can.
    pub(crate) fn obstacle(device: &Device, splatting: &Splatting) -> Option<RenderError> {
        let refused = |found: String, allowed: &'static str| {
            let key = "splatting.rasterizer";
            Some(RenderError::OutOfRange { key, found: format!("\"tiles\" with {found}"), allowed: allowed.to_owned() })
        };
        if splatting.method == Method::CompositeEverySample {
            let found = "splatting.method = \"composite-every-sample\"".to_owned();
            return refused(found, "\"image-aligned\" or \"axis-aligned\" with it, or \"quads\"");
        }
        if splatting.footprint != FootprintForm::SummedArea {
            return refused("splatting.footprint = \"sections\"".to_owned(), "\"summed-area\" with it, or \"quads\"");
        }
        if !device.features().contains(Features::SUBGROUP) {
            return refused("a device without subgroups".to_owned(), "\"quads\"");
        }
        let info = device.adapter_info();
        let sizes = [info.subgroup_min_size, info.subgroup_max_size];
        if sizes.iter().any(|size| !SUBGROUP_SIZES.contains(size)) {
            let found = format!("subgroups of {} to {} threads", sizes[0], sizes[1]);
            return refused(found, "subgroups of 8 to 32 threads, or \"quads\"");
        }
        None
    }

    /// Bins bricks if need be, and allocates what does not fit any more. Sections need no table here.
    ///
    /// # Errors
    /// If there is too much behind a tile, or more bricks than a binding holds.
    pub(crate) fn prepare(
        &self,
        given: Given<'_>,
        previous: Option<TileFrame>,
    ) -> Result<(TileFrame, Prepared), RenderError> {
        let Given { device, volume, view, kernel, splatting, .. } = given;
        let limits = device.limits();
        let binding = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        let mut old = Old::of(previous);
        let in_memory = volume.labels().is_some();
        let search_passes = given.ramp_lengths.iter().map(|&points| search_passes(points, in_memory)).sum();
        let is_current = |old: &Binned| {
            old.view == *view
                && (old.order, old.revision, old.search_passes) == (splatting.order, volume.revision, search_passes)
                && old.support == kernel.support()
        };
        let (current, stale) = match old.binned.take() {
            Some(binned) if is_current(&binned) => (Some(binned), false),
            _ => (None, true),
        };
        let bricks = volume.lists.all();
        let binned = match current {
            Some(binned) => binned,
            None => {
                let support = kernel.support();
                let bins = TileBins::new(bricks, view, splatting.order, support, search_passes, binding / 4)?;
                Binned { bins, view: *view, order: splatting.order, support, search_passes, revision: volume.revision }
            }
        };
        let bins = &binned.bins;
        let storage = BufferUsages::STORAGE;
        let (starts, entries) = match (old.starts.take(), old.entries.take()) {
            (Some(starts), Some(entries)) if !stale => (starts, entries),
            (starts, entries) => (
                given.filled(starts, "sheetsplat.bin_starts", bytemuck::cast_slice(&bins.starts), storage)?,
                given.filled(entries, "sheetsplat.bin_entries", bytemuck::cast_slice(&bins.entries), storage)?,
            ),
        };
        let half_boxes: Vec<[f32; 2]> = bins.half_boxes.iter().map(|&pixels| uniforms::in_f32_pixels(pixels)).collect();
        let half_boxes = bytemuck::cast_slice(&half_boxes);
        let half_boxes = given.filled(old.half_boxes.take(), "sheetsplat.half_boxes", half_boxes, storage)?;
        let own_bricks = match (&volume.lists.lists[..], old.bricks.take()) {
            ([_], _) => None,
            (_, Some(bricks)) if !stale => Some(bricks),
            (_, old) => {
                // Bindings may not be empty.
                let none = [bytemuck::Zeroable::zeroed()];
                let bytes: &[u8] = bytemuck::cast_slice::<Brick, _>(if bricks.is_empty() { &none } else { bricks });
                if bytes.len() as u64 > binding {
                    let (what, limit) = ("the bricks of the tile rasterizer", "max_storage_buffer_binding_size");
                    return Err(RenderError::Limit { what, limit, required: bytes.len() as u64, actual: binding });
                }
                Some(given.filled(old, "sheetsplat.all_bricks", bytes, storage)?)
            }
        };

        let uniform = uniforms::gather(view, kernel, splatting, bins, bricks.len() as u32);
        let pixels = u64::from(view.size[0]) * u64::from(view.size[1]);
        let hits = offset_of!(Gathered, words) as u64 + u64::from(uniform.hits) * 4;
        let bytes = hits + if given.rays.first_hit { 4 * pixels } else { 0 };
        if bytes > binding {
            let (what, limit) = ("the tile rasterizer's counts and first hits", "max_storage_buffer_binding_size");
            return Err(RenderError::Limit { what, limit, required: bytes, actual: binding });
        }
        let usage = storage | BufferUsages::COPY_DST | BufferUsages::COPY_SRC;
        let gathered = grown(device, old.gathered.take(), "sheetsplat.gathered", bytes, usage)?;
        let uniform_bytes = bytemuck::bytes_of(&uniform);
        let uniform = given.filled(old.uniform.take(), "sheetsplat.gather", uniform_bytes, BufferUsages::UNIFORM)?;

        let stride = size_of::<Part>().next_multiple_of(limits.min_uniform_buffer_offset_alignment as usize);
        let (mut part_bytes, mut dispatches) = (Vec::new(), Vec::new());
        let columns = view.size[0].div_ceil(SIDE);
        for (at, band) in given.compositing.bands.iter().enumerate() {
            let band = band.band;
            let first_tile = band.first_row / SIDE * columns;
            let tiles = band.rows.div_ceil(SIDE) * columns;
            let part = Part { first_row: band.first_row, first_tile, end_tile: first_tile + tiles };
            dispatches.push((at, part_bytes.len() as u32, tiles));
            part_bytes.extend_from_slice(bytemuck::bytes_of(&part));
            part_bytes.resize(part_bytes.len().next_multiple_of(stride), 0);
        }
        part_bytes.resize(part_bytes.len().max(stride), 0);
        let parts = given.filled(old.parts.take(), "sheetsplat.parts", &part_bytes, BufferUsages::UNIFORM)?;

        let mode = GatherMode::of(splatting, view.perspective.is_some(), volume.labels().is_some(), given.rays);
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
            hits,
            half_boxes,
            dispatches,
            bands,
        };
        Ok((frame, Prepared { bucketed: stale, tabled: false }))
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

/// Passes through loops that a lookup among so many control points takes: none if every thread of a subgroup can hold one, unless they
/// are searched `in_memory` anyway, else those of a binary search and 2 around it.
fn search_passes(points: u32, in_memory: bool) -> u32 {
    if points <= *SUBGROUP_SIZES.start() && !in_memory { 0 } else { 2 + points.ilog2() + 1 }
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
