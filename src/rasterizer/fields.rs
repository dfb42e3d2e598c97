//! The quad rasterizer with classification after splatting (SPEC §9): for every slab plane the stages cull, values, tiles, field, classify and
//! occlude. Once two neighbouring planes are drawn, the slab between them is classified. Channels that share sheets (SPEC §10) have lists and sums of
//! their own; classify adds up their sheets.

use std::ops::Range;
use std::sync::OnceLock;

use wgpu::{BindGroup, Buffer, BufferUsages, CommandEncoder, Device, Limits, TextureFormat, TextureView};

use super::carried::Carried;
use super::sheet_groups::{GroupSettings, SheetGroups, group_stride};
use super::{FrameEstimate, FrameInputs, Prepared, compute};
use crate::error::RenderError;
use crate::gpu::bindings::{content_spec, sizes};
use crate::gpu::counts::GroupSlabs;
use crate::gpu::layout::{Brick, FieldPlanes};
use crate::gpu::ramps::Stored;
use crate::gpu::targets::Targets;
use crate::gpu::timer::Timer;
use crate::gpu::uniforms;
use crate::gpu::volume_texture::page_bits;
use crate::lists::brick;
use crate::lists::quad_plan::FramePlan;
use crate::pass::classify::{Classify, ClassifyBuffers, ClassifyGroup, ClassifyMode};
use crate::pass::composite::CompositeMode;
use crate::pass::cull::{Cull, CullList};
use crate::pass::field::{self, Field};
use crate::pass::field_colors::{ColorMode, FieldColors, FieldColorsBuffers, FieldColorsGroup};
use crate::pass::occlude::Occlude;
use crate::pass::tiles::Tiles;
use crate::pass::values::PlaneBuffers;
use crate::rasterizer::request::{After, FrameRequest};
use crate::settings::shading::Gradient;
use crate::settings::splatting::Order;

/// The stages.
#[derive(Debug)]
pub(crate) struct FieldRasterizer {
    sheet_format: TextureFormat,
    cull: Cull,
    tiles: Tiles,
    field: Field,
    /// For colours of voxels' own, compiled when first needed.
    colors: OnceLock<FieldColors>,
    classify: Classify,
    occlude: Occlude,
}

/// This rasterizer's part of a frame.
#[derive(Debug)]
pub(crate) struct FieldFrame {
    groups: SheetGroups,
    order: Order,
    channels: Vec<PreparedChannel>,
    /// The lists of all channels, one channel after the other.
    lists: Vec<PreparedList>,
    gradient: Gradient,
    clear_group: BindGroup,
    /// For colours, if there are any.
    clear_color: Option<BindGroup>,
    carried: Carried,
    classify_groups: Vec<ClassifyGroup>,
    occlude_groups: [BindGroup; 2],
}

/// A channel, which has sums of its own.
#[derive(Debug)]
struct PreparedChannel {
    /// One [`FieldPlanes`].
    planes: Buffer,
    /// The layers of its sums.
    sheets: Vec<TextureView>,
    /// That of its colours, if voxels have their own.
    colors: Option<TextureView>,
}

#[derive(Debug)]
struct PreparedList {
    /// The channel's number among those that share sheets.
    channel: usize,
    cull: CullList,
    field_group: BindGroup,
    color_group: Option<FieldColorsGroup>,
}

impl FieldRasterizer {
    /// Compiles the stages for sheets of the given format.
    pub(crate) fn new(device: &Device, sheet_format: TextureFormat) -> Self {
        Self {
            sheet_format,
            cull: Cull::of_planes(device),
            tiles: Tiles::of_planes(device),
            field: Field::new(device, sheet_format),
            colors: OnceLock::new(),
            classify: Classify::new(device),
            occlude: Occlude::new(device),
        }
    }

    /// Sorts bricks into buckets if necessary, and allocates buffers that no longer fit.
    ///
    /// # Errors
    /// If they exceed the device's maximum size of buffers.
    pub(crate) fn prepare(
        &self,
        inputs: FrameInputs<'_>,
        after: &After,
        previous: Option<FieldFrame>,
    ) -> Result<(FieldFrame, Prepared), RenderError> {
        let FrameInputs { device, request, frame, .. } = inputs;
        let (view, splatting) = (&after.view, &request.splatting);
        let (old_groups, old_channels, old_carried, old_lists) = match previous {
            Some(FieldFrame { groups, channels, carried, lists, .. }) => (Some(groups), channels, Some(carried), lists),
            None => (None, Vec::new(), None, Vec::new()),
        };
        let covered = &covered(inputs.bricks(), after);
        let (format, layers) = (self.sheet_format, layers(request));
        let settings = GroupSettings { view, covered, drawn: &drawn(request), sheets: 1, format, layers };
        let group_bytes = |plan: &FramePlan, stride| uniforms::plane_groups(plan, &after.planes, splatting, stride);
        let (groups, bucketed) = SheetGroups::prepare(inputs, settings, &self.tiles, group_bytes, old_groups)?;
        let channels = Self::prepare_channels(inputs, after, &groups, old_channels)?;
        let lists = self.prepare_lists(inputs, (&groups, &channels), old_lists)?;
        let carried = Carried::prepare(inputs, after.numbers[0], 0, old_carried)?;
        self.field.prepare(device, after.gradient);
        let SheetGroups { targets, tile_lists, .. } = &groups;
        let colors = self.colors.get().filter(|_| request.colored() > 0);
        let frame = FieldFrame {
            clear_group: self.field.bind_clear(device, frame, &tile_lists.composited),
            clear_color: colors.map(|colors| colors.bind_clear(device, frame, &tile_lists.composited)),
            classify_groups: self.bind_bands(inputs, after, (&groups, &channels), &carried.bands),
            occlude_groups: self.occlude.bind(device, [frame, &groups.groups], &tile_lists.occluding, targets),
            gradient: after.gradient,
            order: splatting.order,
            groups,
            channels,
            lists,
            carried,
        };
        Ok((frame, Prepared { bucketed, tabled: false }))
    }

    /// Prepares what each channel is drawn by.
    fn prepare_channels(
        inputs: FrameInputs<'_>,
        after: &After,
        groups: &SheetGroups,
        old: Vec<PreparedChannel>,
    ) -> Result<Vec<PreparedChannel>, RenderError> {
        let FrameInputs { volume, request, .. } = inputs;
        let mut old = old.into_iter().map(|old| old.planes);
        let per_plane = field::SHEETS_PER_PLANE;
        let mut color_layers = request.stored.len() as u32 * per_plane..;
        let prepare = |(channel, stored): (usize, &Stored)| -> Result<PreparedChannel, RenderError> {
            let planes = request.planes(after, channel, volume.gpu_volume().value_format());
            let bytes = bytemuck::bytes_of(&planes);
            let layers = channel as u32 * per_plane..(channel as u32 + 1) * per_plane;
            let color_layer = if stored.colors > 0 { color_layers.next() } else { None };
            Ok(PreparedChannel {
                planes: inputs.filled(old.next(), "sheetsplat.planes", bytes, BufferUsages::UNIFORM)?,
                sheets: layers.map(|layer| groups.targets.sheet_view(layer)).collect(),
                colors: color_layer.map(|layer| groups.targets.sheet_view(layer)),
            })
        };
        request.stored.iter().enumerate().map(prepare).collect()
    }

    /// Prepares culling and drawing for every list of bricks.
    fn prepare_lists(
        &self,
        inputs: FrameInputs<'_>,
        (groups, channels): (&SheetGroups, &[PreparedChannel]),
        old: Vec<PreparedList>,
    ) -> Result<Vec<PreparedList>, RenderError> {
        let FrameInputs { device, frame, .. } = inputs;
        let mut old = old.into_iter().map(|old| old.cull);
        let mut planned = groups.planned.orders.iter().zip(&groups.planned.most);
        let mut prepared = Vec::new();
        let (coefficients, colors) = (inputs.coefficients()?, inputs.splatted_colors()?);
        for (channel, (of, bricks)) in channels.iter().zip(inputs.lists()).enumerate() {
            let colors = colors.filter(|_| of.colors.is_some());
            let planes = &of.planes;
            let buffers = groups.cull_buffers(inputs, Some(PlaneBuffers { planes, coefficients }));
            for (list, (order, &most)) in bricks.lists.iter().zip(&mut planned) {
                let cull = self.cull.prepare(device, buffers, list, order, most, old.next())?;
                let field_group = self.field.bind(device, [frame, &groups.groups, planes], &cull);
                let color_group = colors.map(|colors| {
                    let stage = self.colors.get_or_init(|| FieldColors::new(device, self.sheet_format));
                    let (groups, bricks) = (&groups.groups, &list.buffer);
                    let (colors, full, pages) = (colors.view, colors.full, inputs.volume.pages());
                    let mode = ColorMode { full, is_exact: coefficients.is_some(), page_bits: page_bits(pages) };
                    let buffers = FieldColorsBuffers { frame, groups, planes, bricks, colors, pages };
                    stage.bind(device, mode, buffers, &cull)
                });
                prepared.push(PreparedList { channel, cull, field_group, color_group });
            }
        }
        Ok(prepared)
    }

    /// Binds the stage classify to every band of the compositing buffer.
    fn bind_bands(
        &self,
        inputs: FrameInputs<'_>,
        after: &After,
        (groups, channels): (&SheetGroups, &[PreparedChannel]),
        carried: &[Buffer],
    ) -> Vec<ClassifyGroup> {
        let FrameInputs { device, volume, request, control_points, compositing, .. } = inputs;
        let sheets = &groups.targets.sheets_view();
        let buffers = ClassifyBuffers {
            composite: groups.composite_buffers(inputs, sheets),
            control_points,
            planes: &channels[0].planes,
            values: volume.values(),
            pages: volume.pages(),
            labels: inputs.labels(),
            light: inputs.light,
        };
        let mode = ClassifyMode {
            composite: CompositeMode { compositing: request.splatting.compositing, rays: request.rays },
            gradient: after.gradient,
            labels: volume.shades_by_label(&request.layer),
            holes: volume.has_holes(),
            page_bits: page_bits(volume.pages()),
            channels: channels.len() as u32,
            own_colors: request.colored() > 0,
            segments: request.splatting.segments(),
            light: inputs.light.is_some(),
        };
        let bands = compositing.bands.iter().zip(carried);
        bands.map(|band| self.classify.bind(device, mode, buffers, band)).collect()
    }

    /// The resources that a new frame of these lists of bricks needs.
    ///
    /// # Errors
    /// As for [`Self::prepare`].
    pub(crate) fn estimate(
        limits: &Limits,
        request: &FrameRequest,
        after: &After,
        lists: &[&[Brick]],
        sheet_format: TextureFormat,
    ) -> Result<FrameEstimate, RenderError> {
        let size = after.view.size;
        let covered = covered(lists.iter().copied(), after);
        let (order, drawn) = (request.splatting.order, drawn(request));
        let plan = FramePlan::new(lists.iter().copied(), after.view, 1, order, covered, &drawn);
        let group_bytes = uniforms::plane_groups(&plan, &after.planes, &request.splatting, group_stride(limits));
        let mut buffers = SheetGroups::buffer_specs(request, &plan, &group_bytes, lists);
        let planes = || content_spec("sheetsplat.planes", size_of::<FieldPlanes>() as u64, BufferUsages::UNIFORM);
        buffers.extend(request.stored.iter().map(|_| planes()));
        buffers.extend(Carried::specs(request, 0));
        let targets = Targets::estimate(limits, size, sheet_format, layers(request))?;
        Ok(FrameEstimate {
            bytes: sizes(limits, &buffers)? + targets,
            groups: plan.groups.len(),
            passes: SheetGroups::passes(&plan, request.records() as usize),
        })
    }

    /// Draws the frame.
    pub(crate) fn record(&self, encoder: &mut CommandEncoder, timer: &mut Option<Timer>, frame: &FieldFrame) {
        let tile_lists = &frame.groups.tile_lists;
        frame.groups.clear(encoder, frame.lists.iter().map(|list| &list.cull));
        frame.carried.clear(encoder);
        for (lists, any_offset) in frame.groups.with_lists(&frame.lists) {
            let mut pass = encoder.begin_compute_pass(&compute("sheetsplat.cull", timer, "cull"));
            for &(list, offset) in &lists {
                self.cull.record(&mut pass, &list.cull, offset);
            }
            self.tiles.record(&mut pass, tile_lists, any_offset);
            drop(pass);

            for (number, channel) in frame.channels.iter().enumerate() {
                let clear = (&frame.clear_group, &tile_lists.composited);
                let of_channel = || lists.iter().filter(move |(list, _)| list.channel == number);
                let draws = of_channel().map(|(list, offset)| (&list.field_group, *offset, &list.cull.draw_args));
                let times = timer.as_mut().map(|timer| timer.render("field"));
                self.field.record(encoder, times, frame.gradient, &channel.sheets, clear, draws);
                let (Some(stage), Some(sheet), Some(clear)) = (self.colors.get(), &channel.colors, &frame.clear_color)
                else {
                    continue;
                };
                let draws = of_channel().filter_map(|(list, offset)| {
                    list.color_group.as_ref().map(|group| (group, *offset, &list.cull.draw_args))
                });
                let times = timer.as_mut().map(|timer| timer.render("field_colors"));
                stage.record(encoder, times, sheet, (clear, &tile_lists.composited), draws);
            }

            let mut pass = encoder.begin_compute_pass(&compute("sheetsplat.classify", timer, "classify"));
            self.classify.record(&mut pass, &frame.classify_groups, any_offset, &tile_lists.composited);
            self.occlude.record(&mut pass, &frame.occlude_groups, any_offset, &tile_lists.occluding);
        }
    }
}

impl FieldFrame {
    /// The number of the frame's passes.
    pub(crate) fn passes(&self) -> usize {
        let colored = self.channels.iter().filter(|channel| channel.colors.is_some()).count();
        SheetGroups::passes(&self.groups.planned.plan, self.channels.len() + colored)
    }

    /// The slabs that are classified with each plane.
    pub(crate) fn group_slabs(&self) -> GroupSlabs {
        let mut slabs = self.groups.slabs();
        if self.order == Order::FrontToBack {
            slabs.firsts.iter_mut().for_each(|first| *first -= 1);
        }
        slabs
    }

    /// Copies the frame's counts to a place in `staging`.
    pub(crate) fn copy_counts(&self, encoder: &mut CommandEncoder, staging: &Buffer, at: u64) {
        self.groups.copy_counts(encoder, staging, at);
    }

    /// The buffer with the words of first hits, and their byte offset in it.
    pub(crate) fn first_hits(&self) -> (&Buffer, u64) {
        (&self.groups.hits, 0)
    }

    /// What pixels carry from plane to plane.
    pub(crate) fn carried(&self) -> &Carried {
        &self.carried
    }

    /// Bytes of GPU memory.
    pub(crate) fn gpu_bytes(&self) -> u64 {
        let lists: u64 = self.lists.iter().map(|list| list.cull.gpu_bytes()).sum();
        let planes = self.channels.iter().map(|channel| &channel.planes);
        self.groups.gpu_bytes() + lists + self.carried.gpu_bytes() + planes.map(Buffer::size).sum::<u64>()
    }
}

/// The planes that are drawn: one more than slabs.
fn drawn(request: &FrameRequest) -> Range<i32> {
    let Range { start, end } = request.window.slabs;
    start..if start < end { end + 1 } else { end }
}

/// The layers of sheets that hold a plane's sums.
fn layers(request: &FrameRequest) -> u32 {
    request.stored.len() as u32 * field::SHEETS_PER_PLANE + request.colored()
}

/// The sheet depths of the planes that any brick's kernels reach, and one more before and behind: where one of a slab's planes has no value, the other stands
/// for both. Empty if there are no bricks.
fn covered<'a>(lists: impl Iterator<Item = &'a [Brick]>, after: &After) -> Range<f64> {
    let depths = |brick: &Brick| {
        let (middle, half) = brick::bounds(brick);
        after.view.depths(middle, half)
    };
    let all = lists.flatten().map(depths).filter(|depths| depths.start < depths.end);
    let hull = all.reduce(|a, b| a.start.min(b.start)..a.end.max(b.end));
    let margin = after.view.slabs.width;
    let nearest = after.view.perspective.map_or(f64::NEG_INFINITY, |seen| after.view.slabs.origin + seen.eye.near);
    hull.map_or(0.0..0.0, |hull| (hull.start - margin).max(nearest)..hull.end + margin)
}
