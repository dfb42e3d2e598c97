//! The tile rasterizer: one compute stage draws every tile front to back, its sheets in registers.

use std::ops::Range;

use wgpu::{Buffer, BufferUsages, CommandEncoder, Limits};

use super::kind::SUBGROUP_SIZES;
use super::{FrameEstimate, FrameInputs, Prepared};
use crate::error::RenderError;
use crate::geometry::view_geometry::ViewGeometry;
use crate::gpu::bindings::{BufferSpec, buffer_spec, content_spec, grown, sizes, written};
use crate::gpu::classified_volume::ClassifiedVolume;
use crate::gpu::gathered_layout::GatheredLayout;
use crate::gpu::layout::{Brick, Gather as GatherUniform, PatchRange, Planes};
use crate::gpu::timer::Timer;
use crate::gpu::uniforms;
use crate::lists::matter::Matter;
use crate::lists::patch_bins::{self, PatchBins, SHEETS};
use crate::pass::gather::{self, Gather, GatherBand, GatherBuffers, GatherMode};
use crate::rasterizer::request::FrameRequest;
use crate::setting_error::SettingError;
use crate::settings::splatting::{Classification, Order, Splatting};
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
    /// The bricks of what matters, where not the volume's own are drawn.
    matter: Option<(Matter, Vec<Brick>)>,
    uniform: Buffer,
    /// [`Planes`], unused where classification comes before splatting.
    planes: Buffer,
    patch_ranges: Buffer,
    /// All bricks in one buffer, where the volume's own are in several.
    bricks: Option<Buffer>,
    starts: Buffer,
    entries: Buffer,
    gathered: Buffer,
    results: GatheredLayout,
    half_boxes: Buffer,
    /// For every band of the compositing buffer its number, and the offset of its part and its tiles.
    dispatches: Vec<(usize, u32, u32)>,
    bands: Vec<GatherBand>,
}

/// What only changes with the view or the bricks.
#[derive(Debug)]
struct Binned {
    bins: PatchBins,
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
        inputs: FrameInputs<'_>,
        previous: Option<TileFrame>,
    ) -> Result<(TileFrame, Prepared), RenderError> {
        let FrameInputs { device, queue, volume, request, .. } = inputs;
        let FrameRequest { splatting, view, kernel, covered, rays, .. } = request;
        let limits = device.limits();
        let mut old = PreviousBuffers::of(previous);
        let search = all_search_passes(request, volume.labels().is_some());
        let order = drawn_order(splatting);
        let matter = matter(request, volume, old.matter.take());
        let is_current = |old: &Binned| {
            !matter.as_ref().is_some_and(|matter| matter.is_new)
                && old.view == *view
                && (old.order, old.revision, old.bins.passes.search) == (order, volume.revision, search)
                && (old.support, &old.covered) == (kernel.support(), covered)
        };
        let (current, stale) = match old.binned.take() {
            Some(binned) if is_current(&binned) => (Some(binned), false),
            _ => (None, true),
        };
        let (bricks, lists) = match &matter {
            Some(matter) => (&matter.bricks[..], 0),
            None => (volume.lists.all(), volume.lists.lists.len()),
        };
        let binned = match current {
            Some(binned) => binned,
            None => Binned {
                bins: bins(&limits, request, bricks, search)?,
                view: *view,
                order,
                covered: covered.clone(),
                support: kernel.support(),
                revision: volume.revision,
            },
        };
        let bins = &binned.bins;
        let results = GatheredLayout::new(view, bins, bricks.len() as u32);
        let uniform = uniforms::gather(view, kernel, splatting, bins, &results);
        let planes = match &request.planes {
            Some((geometry, numbers)) => uniforms::planes(geometry, view, volume.gpu_volume().value_format(), numbers),
            None => bytemuck::Zeroable::zeroed(),
        };
        let spec = BufferSpecs::new(&limits, request, (bins, &results), lists)?;
        let write = |old, spec: &BufferSpec, bytes: &[u8]| written(device, queue, old, spec, bytes);
        let (starts, entries) = match (old.starts.take(), old.entries.take()) {
            (Some(starts), Some(entries)) if !stale => (starts, entries),
            (starts, entries) => (
                write(starts, &spec.starts, bytemuck::cast_slice(&bins.starts))?,
                write(entries, &spec.entries, bytemuck::cast_slice(&bins.entries))?,
            ),
        };
        let half_boxes: Vec<[f32; 2]> = bins.half_boxes.iter().map(|&pixels| uniforms::in_f32_pixels(pixels)).collect();
        let half_boxes = write(old.half_boxes.take(), &spec.half_boxes, bytemuck::cast_slice(&half_boxes))?;
        let own_bricks = match (spec.bricks, old.bricks.take()) {
            (None, _) => None,
            (_, Some(bricks)) if !stale => Some(bricks),
            (Some(spec), old) => Some(write(old, &spec, bytemuck::cast_slice(bricks))?),
        };
        let gathered = grown(device, old.gathered.take(), &spec.gathered)?;
        let uniform = write(old.uniform.take(), &spec.uniform, bytemuck::bytes_of(&uniform))?;
        let planes = write(old.planes.take(), &spec.planes, bytemuck::bytes_of(&planes))?;

        let stride = range_stride(&limits);
        let (mut range_bytes, mut dispatches) = (Vec::new(), Vec::new());
        let [columns, _] = patch_bins::grid(view.size);
        for (at, band) in request.bands.iter().enumerate() {
            let first_patch = band.first_row / patch_bins::PATCH[1] * columns;
            let patches = band.rows.div_ceil(patch_bins::PATCH[1]) * columns;
            let range = PatchRange { first_row: band.first_row, first_patch, end_patch: first_patch + patches };
            dispatches.push((at, range_bytes.len() as u32, patches));
            range_bytes.extend_from_slice(bytemuck::bytes_of(&range));
            range_bytes.resize(range_bytes.len().next_multiple_of(stride), 0);
        }
        let patch_ranges = write(old.patch_ranges.take(), &spec.patch_ranges, &range_bytes)?;

        let labels = match splatting.classification {
            Classification::Before => volume.labels(),
            Classification::After => volume.gpu_volume().labels().filter(|_| volume.classifies_by_label()),
        };
        let of_volume = [labels.is_some(), volume.has_holes()];
        let mode = GatherMode::of(
            (splatting, request.gradient),
            view.perspective.is_some(),
            of_volume,
            *rays,
            bins.workgroups,
        );
        let (least, actual) = (gather::least_workgroup_bytes(mode), limits.max_compute_workgroup_storage_size);
        if least > actual {
            let found = format!(
                "\"tiles\" with shading.gradient = \"kernel\" and a max_compute_workgroup_storage_size of {actual}"
            );
            return Err(SettingError::new(
                "splatting.rasterizer",
                found,
                format!("at least {least}, or \"differences\""),
            )
            .into());
        }
        let buffers = GatherBuffers {
            frame: inputs.frame,
            gather: &uniform,
            planes: &planes,
            patch_ranges: &patch_ranges,
            bricks: own_bricks.as_ref().unwrap_or_else(|| &volume.lists.lists[0].buffer),
            starts: &starts,
            entries: &entries,
            control_points: inputs.control_points,
            values: volume.values(),
            coefficients: None,
            labels,
            gathered: &gathered,
            half_boxes: &half_boxes,
            cut: inputs.cut,
        };
        let bind = |acc| self.gather.bind(device, mode, buffers, acc, bins.dispatches);
        let bands = inputs.compositing.bands.iter().map(|band| bind(&band.acc)).collect();
        let frame = TileFrame {
            binned,
            matter: matter.map(|matter| (matter.what, matter.bricks)),
            uniform,
            planes,
            patch_ranges,
            bricks: own_bricks,
            starts,
            entries,
            gathered,
            results,
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
    ) -> Result<FrameEstimate, RenderError> {
        let bins = bins(limits, request, bricks, all_search_passes(request, by_label))?;
        let results = GatheredLayout::new(&request.view, &bins, bricks.len() as u32);
        let spec = BufferSpecs::new(limits, request, (&bins, &results), lists)?;
        let BufferSpecs { uniform, planes, patch_ranges, starts, entries, gathered, half_boxes, bricks, .. } = spec;
        let buffers: Vec<BufferSpec> =
            [uniform, planes, patch_ranges, starts, entries, gathered, half_boxes].into_iter().chain(bricks).collect();
        let bands = request.bands.len() as u64 * GatherBand::estimate(bins.dispatches);
        let groups = bins.groups as usize;
        Ok(FrameEstimate { bytes: sizes(limits, &buffers)? + bands, groups, passes: TileFrame::PASSES })
    }

    /// Draws the frame.
    pub(crate) fn record(&self, encoder: &mut CommandEncoder, timer: &mut Option<Timer>, frame: &TileFrame) {
        encoder.clear_buffer(&frame.gathered, 0, None);
        frame.bands.iter().for_each(|band| band.clear(encoder));
        let mut pass = encoder.begin_compute_pass(&super::compute("sheetsplat.gather", timer, "gather"));
        for &(band, offset, patches) in &frame.dispatches {
            self.gather.record(&mut pass, &frame.bands[band], offset, patches);
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
        encoder.copy_buffer_to_buffer(&self.gathered, 0, staging, 0, self.results.count_bytes());
    }

    /// The words of first hits, and where in their buffer they start, bytes.
    pub(crate) fn first_hits(&self) -> (&Buffer, u64) {
        (&self.gathered, self.results.hits_byte())
    }

    /// Bytes of GPU memory.
    pub(crate) fn gpu_bytes(&self) -> u64 {
        let Self { uniform, planes, patch_ranges, starts, entries, gathered, half_boxes, bricks, .. } = self;
        let bands: u64 = self.bands.iter().map(GatherBand::gpu_bytes).sum();
        let buffers = [uniform, planes, patch_ranges, starts, entries, gathered, half_boxes].into_iter().chain(bricks);
        bands + buffers.map(Buffer::size).sum::<u64>()
    }
}

/// The buffers of a frame, all but those of bands.
struct BufferSpecs {
    uniform: BufferSpec,
    planes: BufferSpec,
    patch_ranges: BufferSpec,
    starts: BufferSpec,
    entries: BufferSpec,
    gathered: BufferSpec,
    half_boxes: BufferSpec,
    /// If the volume's own are in several buffers, or in none.
    bricks: Option<BufferSpec>,
}

impl BufferSpecs {
    /// The buffers for a view of a volume whose bricks are divided among `lists` lists.
    fn new(
        limits: &Limits,
        request: &FrameRequest,
        (bins, results): (&PatchBins, &GatheredLayout),
        lists: usize,
    ) -> Result<Self, RenderError> {
        let (binding, storage) = (binding(limits), BufferUsages::STORAGE);
        let within = |what, required: u64| {
            let (limit, actual) = ("max_storage_buffer_binding_size", binding);
            if required > actual { Err(RenderError::Limit { what, limit, required, actual }) } else { Ok(required) }
        };
        // Bindings may not be empty.
        let brick_bytes = u64::from(results.bricks.max(1)) * size_of::<Brick>() as u64;
        let brick_bytes = match lists {
            1 => None,
            _ => Some(within("the bricks of the tile rasterizer", brick_bytes)?),
        };
        let gathered = results.hits_byte() + request.hit_bytes();
        let gathered = within("the tile rasterizer's counts and first hits", gathered)?;
        let words = |words: usize| words as u64 * 4;
        let range_bytes = (request.bands.len() * range_stride(limits)) as u64;
        Ok(Self {
            uniform: content_spec("sheetsplat.gather", size_of::<GatherUniform>() as u64, BufferUsages::UNIFORM),
            planes: content_spec("sheetsplat.planes", size_of::<Planes>() as u64, BufferUsages::UNIFORM),
            patch_ranges: content_spec("sheetsplat.patch_ranges", range_bytes, BufferUsages::UNIFORM),
            starts: content_spec("sheetsplat.bin_starts", words(bins.starts.len()), storage),
            entries: content_spec("sheetsplat.bin_entries", words(bins.entries.len()), storage),
            gathered: buffer_spec(
                "sheetsplat.gathered",
                gathered,
                storage | BufferUsages::COPY_DST | BufferUsages::COPY_SRC,
            ),
            half_boxes: content_spec("sheetsplat.half_boxes", words(2 * bins.half_boxes.len()), storage),
            bricks: brick_bytes.map(|bytes| content_spec("sheetsplat.all_bricks", bytes, storage)),
        })
    }
}

/// Bytes that a storage binding may have.
fn binding(limits: &Limits) -> u64 {
    limits.max_storage_buffer_binding_size.min(limits.max_buffer_size)
}

/// Bytes from one part to the next.
fn range_stride(limits: &Limits) -> usize {
    size_of::<PatchRange>().next_multiple_of(limits.min_uniform_buffer_offset_alignment as usize)
}

fn bins(limits: &Limits, request: &FrameRequest, bricks: &[Brick], search: u32) -> Result<PatchBins, RenderError> {
    let FrameRequest { view, splatting, kernel, covered, planes, .. } = request;
    let planes = planes.as_ref().map(|(geometry, _)| geometry);
    let most_words = binding(limits) / 4;
    let (order, support) = (drawn_order(splatting), kernel.support());
    Ok(PatchBins::new(bricks, (view, planes), order, covered.clone(), support, search, most_words)?)
}

/// The order in which groups are drawn. Planes are handed on from front to back; after splatting the order makes no difference to an image.
fn drawn_order(splatting: &Splatting) -> Order {
    match splatting.classification {
        Classification::Before => splatting.order,
        Classification::After => Order::FrontToBack,
    }
}

/// What matters where classification comes after splatting.
struct NewMatter {
    what: Matter,
    bricks: Vec<Brick>,
    is_new: bool,
}

fn matter(request: &FrameRequest, volume: &ClassifiedVolume, old: Option<(Matter, Vec<Brick>)>) -> Option<NewMatter> {
    if request.splatting.classification == Classification::Before {
        return None;
    }
    let what = Matter::new(volume.transfer(), &request.splatting, &request.view, volume.grid());
    Some(match old {
        Some((old, bricks)) if old == what => NewMatter { what, bricks, is_new: false },
        _ => {
            let bricks = what.bricks(volume.grid(), volume.volume().values());
            NewMatter { what, bricks, is_new: true }
        }
    })
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
struct PreviousBuffers {
    binned: Option<Binned>,
    matter: Option<(Matter, Vec<Brick>)>,
    uniform: Option<Buffer>,
    planes: Option<Buffer>,
    patch_ranges: Option<Buffer>,
    bricks: Option<Buffer>,
    starts: Option<Buffer>,
    entries: Option<Buffer>,
    gathered: Option<Buffer>,
    half_boxes: Option<Buffer>,
}

impl PreviousBuffers {
    fn of(frame: Option<TileFrame>) -> Self {
        let Some(frame) = frame else { return Self::default() };
        Self {
            binned: Some(frame.binned),
            matter: frame.matter,
            uniform: Some(frame.uniform),
            planes: Some(frame.planes),
            patch_ranges: Some(frame.patch_ranges),
            bricks: frame.bricks,
            starts: Some(frame.starts),
            entries: Some(frame.entries),
            gathered: Some(frame.gathered),
            half_boxes: Some(frame.half_boxes),
        }
    }
}
