//! The tile rasterizer: one compute stage draws every tile front to back with its sheets in registers.

use std::ops::Range;

use bytemuck::Zeroable;
use wgpu::{Buffer, BufferUsages, CommandEncoder, Limits};

use super::carried::Carried;
use super::patch_ranges::{Dispatch, patch_ranges, range_stride};
use super::{FrameEstimate, FrameInputs, Prepared};
use crate::error::RenderError;
use crate::error::setting::SettingError;
use crate::geometry::plane_geometry::PlaneGeometry;
use crate::geometry::view_geometry::ViewGeometry;
use crate::gpu::bindings::{BufferSpec, buffer_spec, content_spec, grown, sizes, written};
use crate::gpu::brick_lists::BrickLists;
use crate::gpu::counts::GroupSlabs;
use crate::gpu::gathered_layout::GatheredLayout;
use crate::gpu::layout::{Brick, FieldPlanes, Gather as GatherUniform};
use crate::gpu::targets::BandBuffer;
use crate::gpu::timer::Timer;
use crate::gpu::uniforms;
use crate::lists::brick_union;
use crate::lists::patch_bins::{PatchBins, SHEETS, Work};
use crate::pass::gather::{
    Gather, GatherBand, GatherBuffers, GatherMode, GatheredPlanes, MOST_LAYERS, PlaneMode, drawn_order,
    min_workgroup_bytes,
};
use crate::rasterizer::request::{After, FrameRequest};
use crate::rasterizer::search_passes;
use crate::settings::splatting::Order;

/// The rasterizer's stage.
#[derive(Debug, Default)]
pub(crate) struct TileRasterizer {
    gather: Gather,
}

/// The tile rasterizer's part of a frame.
#[derive(Debug)]
pub(crate) struct TileFrame {
    binned: Binned,
    buffers: TileBuffers<Buffer>,
    results: GatheredLayout,
    dispatches: Vec<Dispatch>,
    bands: Vec<GatherBand>,
    /// If values are gathered on planes.
    carried: Option<Carried>,
}

/// The bins, which change only with the view or the bricks.
#[derive(Debug)]
struct Binned {
    bins: PatchBins,
    /// [`joined`].
    joined: Vec<Brick>,
    view: ViewGeometry,
    order: Order,
    /// The planes on which values are gathered (SPEC §9).
    planes: Option<PlaneGeometry>,
    /// [`means::covered`](crate::geometry::means::covered).
    covered: Range<f64>,
    /// The slabs that are drawn.
    drawn: Range<i32>,
    /// The radius within which kernels are drawn, which determines the footprints' boxes.
    support: f64,
    revision: u64,
}

impl TileRasterizer {
    /// Sorts bricks into bins if necessary, and allocates buffers that no longer fit. Sections need no table here.
    ///
    /// # Errors
    /// If too much lies behind a tile, or the bricks exceed a binding.
    pub(crate) fn prepare(
        &self,
        inputs: FrameInputs<'_>,
        previous: Option<TileFrame>,
    ) -> Result<(TileFrame, Prepared), RenderError> {
        let FrameInputs { device, request, .. } = inputs;
        let limits = device.limits();
        let (old_binned, old_buffers, old_carried) = match previous {
            Some(old) => (Some(old.binned), Some(old.buffers), old.carried),
            None => (None, None, None),
        };
        let layers: Vec<&[Brick]> = inputs.lists().iter().map(BrickLists::all).collect();
        let are_joined = !matches!(inputs.lists(), [only] if only.lists.len() == 1);
        let (binned, is_new) = Binned::renewed(&limits, inputs, &layers, old_binned)?;
        let bricks = binned.bricks(&layers);
        let results = GatheredLayout::new(&request.view, &binned.bins, bricks.len() as u32, layer_count(request));
        let spec = TileBuffers::specs(&limits, request, (&binned.bins, &results), are_joined)?;
        let (range_bytes, dispatches) = patch_ranges(&limits, request);
        let contents = (&binned.bins, &results, &range_bytes[..]);
        let buffers = TileBuffers::filled(inputs, spec, contents, bricks, (old_buffers, is_new))?;
        let carried = match &request.after {
            Some(after) => Some(Carried::prepare(inputs, after.numbers[0], request.sheet_records(), old_carried)?),
            None => None,
        };
        let bands = self.bind(inputs, &binned.bins, (&buffers, carried.as_ref()))?;
        let frame = TileFrame { binned, buffers, results, dispatches, bands, carried };
        Ok((frame, Prepared { bucketed: is_new, tabled: false }))
    }

    /// Binds the stage to every band of the compositing buffer.
    fn bind(
        &self,
        inputs: FrameInputs<'_>,
        bins: &PatchBins,
        (own, carried): (&TileBuffers<Buffer>, Option<&Carried>),
    ) -> Result<Vec<GatherBand>, RenderError> {
        let FrameInputs { device, volume, request, .. } = inputs;
        let FrameRequest { splatting, view, rays, .. } = request;
        let of_volume = [inputs.labels().is_some(), volume.has_holes()];
        let (coefficients, colors) = (inputs.coefficients()?, inputs.splatted_colors()?);
        let planes = plane_mode(request);
        let mode = GatherMode::of(splatting, planes, view.perspective.is_some(), of_volume, *rays, bins.workgroups)
            .with_channels(request.ramps.channels, colors)
            .with_membership(inputs.membership().is_some())
            .with_light(inputs.light.is_some())
            .with_pages(volume.pages());
        let buffers = GatherBuffers {
            frame: inputs.frame,
            gather: &own.uniform,
            planes: own.planes.as_ref().map(|planes| GatheredPlanes { planes, coefficients }),
            patch_ranges: &own.patch_ranges,
            bricks: own.bricks.as_ref().unwrap_or_else(|| &inputs.list().lists[0].buffer),
            bins: &own.bins,
            control_points: inputs.control_points,
            values: volume.values(),
            pages: volume.pages(),
            colors,
            labels: inputs.labels(),
            membership: inputs.membership(),
            light: inputs.light,
            gathered: &own.gathered,
            half_boxes: &own.half_boxes,
            cut: inputs.cut,
        };
        let carried = |band: usize| carried.map(|carried| &carried.bands[band]);
        let bind = |(at, band): (usize, &BandBuffer)| {
            self.gather.bind(device, mode, buffers, (&band.acc, carried(at)), bins.dispatches)
        };
        Ok(inputs.compositing.bands.iter().enumerate().map(bind).collect())
    }

    /// The resources that a new frame of these layers' bricks, in `lists` lists, needs.
    ///
    /// # Errors
    /// As for [`Self::prepare`].
    pub(crate) fn estimate(
        limits: &Limits,
        request: &FrameRequest,
        (layers, lists): (&[&[Brick]], usize),
        by_label: bool,
    ) -> Result<FrameEstimate, RenderError> {
        let joined = joined(layers);
        let bricks = all_bricks(layers, &joined);
        let bins = bins(limits, request, bricks, search_passes::of(request, by_label))?;
        let results = GatheredLayout::new(&request.view, &bins, bricks.len() as u32, layer_count(request));
        let are_joined = layers.len() != 1 || lists != 1;
        let mut buffers: Vec<BufferSpec> =
            TileBuffers::specs(limits, request, (&bins, &results), are_joined)?.all().collect();
        buffers.extend(request.after.iter().flat_map(|_| Carried::specs(request, request.sheet_records())));
        let bands = request.bands.len() as u64 * GatherBand::estimate(bins.dispatches);
        let groups = bins.groups as usize;
        Ok(FrameEstimate { bytes: sizes(limits, &buffers)? + bands, groups, passes: TileFrame::PASSES })
    }

    /// Draws the frame.
    pub(crate) fn record(&self, encoder: &mut CommandEncoder, timer: &mut Option<Timer>, frame: &TileFrame) {
        encoder.clear_buffer(&frame.buffers.gathered, 0, None);
        frame.carried.iter().for_each(|carried| carried.clear(encoder));
        frame.bands.iter().for_each(|band| band.clear(encoder));
        let mut pass = encoder.begin_compute_pass(&super::compute("sheetsplat.gather", timer, "gather"));
        for &Dispatch { band, offset, patches } in &frame.dispatches {
            self.gather.record(&mut pass, &frame.bands[band], offset, patches);
        }
    }
}

impl TileFrame {
    /// The number of a frame's passes.
    pub(crate) const PASSES: usize = 1;

    /// The groups' slabs.
    pub(crate) fn group_slabs(&self) -> GroupSlabs {
        let bins = &self.binned.bins;
        let firsts = (0..bins.groups as i32).map(|group| bins.first_slab + group * SHEETS as i32);
        let firsts = match self.binned.order {
            Order::FrontToBack => firsts.collect(),
            Order::BackToFront => firsts.rev().collect(),
        };
        GroupSlabs { firsts, sheets: SHEETS }
    }

    /// Copies the frame's counts to a place in `staging`.
    pub(crate) fn copy_counts(&self, encoder: &mut CommandEncoder, staging: &Buffer, at: u64) {
        encoder.copy_buffer_to_buffer(&self.buffers.gathered, 0, staging, at, self.results.count_bytes());
    }

    /// The buffer with the words of first hits, and their byte offset in it.
    pub(crate) fn first_hits(&self) -> (&Buffer, u64) {
        (&self.buffers.gathered, self.results.hits_byte())
    }

    /// What pixels carry from plane to plane, if values are gathered on planes.
    pub(crate) fn carried(&self) -> Option<&Carried> {
        self.carried.as_ref()
    }

    /// Bytes of GPU memory.
    pub(crate) fn gpu_bytes(&self) -> u64 {
        let bands: u64 = self.bands.iter().map(GatherBand::gpu_bytes).sum();
        let carried = self.carried.as_ref().map_or(0, Carried::gpu_bytes);
        bands + carried + self.buffers.each_ref().all().map(Buffer::size).sum::<u64>()
    }
}

impl Binned {
    /// The old bins if they are still valid, or else new ones; also whether they are new.
    fn renewed(
        limits: &Limits,
        inputs: FrameInputs<'_>,
        layers: &[&[Brick]],
        old: Option<Self>,
    ) -> Result<(Self, bool), RenderError> {
        let FrameInputs { volume, request, .. } = inputs;
        let FrameRequest { splatting, view, kernel, covered, .. } = request;
        let search = search_passes::of(request, inputs.labels().is_some());
        let (order, planes) = (drawn_order(splatting), request.after.as_ref().map(|after| after.planes));
        let support = splatting.drawn_radius(kernel);
        let is_current = |old: &Self| {
            old.view == *view
                && (old.order, old.revision, old.bins.passes.search) == (order, volume.revision, search)
                && (old.support, &old.covered, old.planes) == (support, covered, planes)
                && old.drawn == drawn(request)
        };
        let joined = match old {
            Some(old) if is_current(&old) => return Ok((old, false)),
            Some(old) if old.revision == volume.revision => old.joined,
            _ => joined(layers),
        };
        let binned = Self {
            bins: bins(limits, request, all_bricks(layers, &joined), search)?,
            joined,
            view: *view,
            order,
            planes,
            covered: covered.clone(),
            drawn: drawn(request),
            support,
            revision: volume.revision,
        };
        Ok((binned, true))
    }

    /// The bricks of all layers.
    fn bricks<'a>(&'a self, layers: &[&'a [Brick]]) -> &'a [Brick] {
        all_bricks(layers, &self.joined)
    }
}

/// The bricks of several layers as one list; empty if there is one layer.
fn joined(layers: &[&[Brick]]) -> Vec<Brick> {
    if layers.len() == 1 { Vec::new() } else { brick_union::of(layers) }
}

/// The bricks of all layers, given those of several [joined](joined).
fn all_bricks<'a>(layers: &[&'a [Brick]], joined: &'a [Brick]) -> &'a [Brick] {
    if let [only] = layers { only } else { joined }
}

/// The number of layers of sums: one for each channel whose values are gathered, one for all whose colours are.
fn layer_count(request: &FrameRequest) -> u32 {
    if request.after.is_some() { request.stored.len() as u32 } else { 1 }
}

/// A frame's buffers, except those of bands: their specs, or the buffers themselves.
#[derive(Debug)]
struct TileBuffers<B> {
    uniform: B,
    /// [`FieldPlanes`] of every layer, if values are gathered on planes.
    planes: Option<B>,
    patch_ranges: B,
    bins: B,
    gathered: B,
    half_boxes: B,
    /// All bricks in one buffer, if the volume's own are in several, or in none.
    bricks: Option<B>,
}

impl<B> TileBuffers<B> {
    fn all(self) -> impl Iterator<Item = B> {
        let Self { uniform, planes, patch_ranges, bins, gathered, half_boxes, bricks } = self;
        [uniform, patch_ranges, bins, gathered, half_boxes].into_iter().chain(planes).chain(bricks)
    }

    fn each_ref(&self) -> TileBuffers<&B> {
        let Self { uniform, planes, patch_ranges, bins, gathered, half_boxes, bricks } = self;
        let (planes, bricks) = (planes.as_ref(), bricks.as_ref());
        TileBuffers { uniform, planes, patch_ranges, bins, gathered, half_boxes, bricks }
    }
}

impl TileBuffers<Buffer> {
    /// Fills the buffers for a frame. Buffers that depend only on the bins are kept unless the bins are new.
    fn filled(
        inputs: FrameInputs<'_>,
        spec: TileBuffers<BufferSpec>,
        (bins, results, range_bytes): (&PatchBins, &GatheredLayout, &[u8]),
        bricks: &[Brick],
        (old, is_new): (Option<Self>, bool),
    ) -> Result<Self, RenderError> {
        let FrameInputs { device, queue, request, .. } = inputs;
        let write = |old, spec: &BufferSpec, bytes: &[u8]| written(device, queue, old, spec, bytes);
        let rewrite = |old: Option<Buffer>, spec: &BufferSpec, bytes: &[u8]| match old {
            Some(current) if !is_new => Ok(current),
            old => write(old, spec, bytes),
        };
        let uniform = uniforms::gather(&request.view, &request.kernel, &request.splatting, bins, results);
        let half_boxes: Vec<[f32; 2]> = bins.half_boxes.iter().map(|&pixels| uniforms::in_f32_pixels(pixels)).collect();
        let old = PreviousBuffers::of(old);
        Ok(Self {
            bins: rewrite(old.bins, &spec.bins, bytemuck::cast_slice(&bins.words))?,
            half_boxes: write(old.half_boxes, &spec.half_boxes, bytemuck::cast_slice(&half_boxes))?,
            bricks: match spec.bricks {
                Some(spec) => Some(rewrite(old.bricks, &spec, bytemuck::cast_slice(bricks))?),
                None => None,
            },
            gathered: grown(device, old.gathered, &spec.gathered)?,
            uniform: write(old.uniform, &spec.uniform, bytemuck::bytes_of(&uniform))?,
            planes: match (spec.planes, &request.after) {
                (Some(spec), Some(after)) => {
                    let format = inputs.volume.gpu_volume().value_format();
                    let mut planes = [FieldPlanes::zeroed(); MOST_LAYERS];
                    for (layer, planes) in planes[..request.stored.len()].iter_mut().enumerate() {
                        *planes = request.planes(after, layer, format);
                    }
                    Some(write(old.planes, &spec, bytemuck::bytes_of(&planes))?)
                }
                _ => None,
            },
            patch_ranges: write(old.patch_ranges, &spec.patch_ranges, range_bytes)?,
        })
    }
}

impl TileBuffers<BufferSpec> {
    /// The specs for a view of a volume; `are_joined` states whether bricks are in several lists, or in none, and need a buffer for all.
    fn specs(
        limits: &Limits,
        request: &FrameRequest,
        (bins, results): (&PatchBins, &GatheredLayout),
        are_joined: bool,
    ) -> Result<Self, RenderError> {
        check_workgroup_memory(request)?;
        let (binding, storage) = (binding(limits), BufferUsages::STORAGE);
        let within = |what, required: u64| {
            let (limit, actual) = ("max_storage_buffer_binding_size", binding);
            if required > actual { Err(RenderError::Limit { what, limit, required, actual }) } else { Ok(required) }
        };
        // Bindings may not be empty.
        let brick_bytes = u64::from(results.bricks.max(1)) * size_of::<Brick>() as u64;
        let within_binding = || within("the bricks of the tile rasterizer", brick_bytes);
        let brick_bytes = are_joined.then(within_binding).transpose()?;
        // The stage `join` always binds a buffer of first hits, which must not be empty even where no first hits are requested.
        let gathered = results.hits_byte() + request.hit_bytes().max(size_of::<u32>() as u64);
        let gathered = within("the tile rasterizer's counts and first hits", gathered)?;
        let words = |words: usize| words as u64 * 4;
        let range_bytes = (request.bands.len() * range_stride(limits)) as u64;
        Ok(Self {
            uniform: content_spec("sheetsplat.gather", size_of::<GatherUniform>() as u64, BufferUsages::UNIFORM),
            planes: request
                .after
                .as_ref()
                .map(|_| content_spec("sheetsplat.planes", PLANES_BYTES, BufferUsages::UNIFORM)),
            patch_ranges: content_spec("sheetsplat.patch_ranges", range_bytes, BufferUsages::UNIFORM),
            bins: content_spec("sheetsplat.bins", words(bins.words.len()), storage),
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

/// The size of what all layers are drawn onto planes by.
const PLANES_BYTES: u64 = (MOST_LAYERS * size_of::<FieldPlanes>()) as u64;

/// The maximum size of a storage binding in bytes.
fn binding(limits: &Limits) -> u64 {
    limits.max_storage_buffer_binding_size.min(limits.max_buffer_size)
}

fn bins(limits: &Limits, request: &FrameRequest, bricks: &[Brick], search: u32) -> Result<PatchBins, RenderError> {
    let FrameRequest { view, splatting, kernel, covered, after, .. } = request;
    let planes = after.as_ref().map(|after| &after.planes);
    let most_words = binding(limits) / 4;
    let (order, support) = (drawn_order(splatting), splatting.drawn_radius(kernel));
    let looks = request.rays.cut || splatting.compositing.is_by_means();
    let work = Work { search, threads: request.least_lanes, layers: layer_count(request), looks };
    let of_groups = (covered.clone(), &drawn(request));
    Ok(PatchBins::new(bricks, (view, planes), order, of_groups, support, work, most_words)?)
}

/// The slabs that are drawn: with planes also the one before the first that is composited, because a group holds its slabs' far planes.
fn drawn(request: &FrameRequest) -> Range<i32> {
    let Range { start, end } = request.window.slabs;
    if start < end && request.after.is_some() { start - 1..end } else { start..end }
}

/// What is gathered on planes, if classification comes after splatting.
fn plane_mode(request: &FrameRequest) -> Option<PlaneMode> {
    let After { gradient, needs, .. } = request.after.as_ref()?;
    Some(PlaneMode {
        gradient: *gradient,
        exact: needs.coefficients.is_some(),
        layers: layer_count(request),
        own_colors: request.colored() > 0,
        segments: request.splatting.segments(),
    })
}

/// Checks that a patch's pixels fit into a workgroup's memory, of which sums with the kernel's gradient need most.
fn check_workgroup_memory(request: &FrameRequest) -> Result<(), RenderError> {
    let (required, most) = (min_workgroup_bytes(plane_mode(request), request.lanes), request.workgroup_bytes);
    if required > most {
        let found = format!("\"tiles\" with sums of {required} bytes of workgroup memory");
        let allowed =
            format!("at most {most} (max_compute_workgroup_storage_size, on GPUs no more than 16384), or \"quads\"");
        return Err(SettingError::new("splatting.rasterizer", found, allowed).into());
    }
    Ok(())
}

/// The buffers of the previous frame, each of which may be reused.
#[derive(Default)]
struct PreviousBuffers {
    uniform: Option<Buffer>,
    planes: Option<Buffer>,
    patch_ranges: Option<Buffer>,
    bins: Option<Buffer>,
    gathered: Option<Buffer>,
    half_boxes: Option<Buffer>,
    bricks: Option<Buffer>,
}

impl PreviousBuffers {
    fn of(old: Option<TileBuffers<Buffer>>) -> Self {
        let Some(TileBuffers { uniform, planes, patch_ranges, bins, gathered, half_boxes, bricks }) = old else {
            return Self::default();
        };
        Self {
            uniform: Some(uniform),
            planes,
            patch_ranges: Some(patch_ranges),
            bins: Some(bins),
            gathered: Some(gathered),
            half_boxes: Some(half_boxes),
            bricks,
        }
    }
}
