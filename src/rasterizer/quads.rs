//! The quad rasterizer (Fig. 12): for every group of sheets the stages cull, tiles, splat, composite and occlude.

use wgpu::{BindGroup, Buffer, CommandEncoder, Device, Limits, TextureFormat, TextureView};

use super::sheet_groups::{GroupSettings, SheetGroups, group_stride};
use super::{Footprints, FrameEstimate, FrameInputs, Prepared, compute};
use crate::error::RenderError;
use crate::geometry::footprint::FootprintTable;
use crate::gpu::bindings::sizes;
use crate::gpu::counts::GroupSlabs;
use crate::gpu::layout::Brick;
use crate::gpu::targets::Targets;
use crate::gpu::timer::Timer;
use crate::gpu::uniforms;
use crate::lists::quad_plan::FramePlan;
use crate::pass::composite::{Composite, CompositeMode};
use crate::pass::cull::{Cull, CullList};
use crate::pass::occlude::Occlude;
use crate::pass::splat::{Splat, SplatMode};
use crate::pass::tiles::Tiles;
use crate::rasterizer::request::FrameRequest;

/// The rasterizer's stages.
#[derive(Debug)]
pub(crate) struct QuadRasterizer {
    sheet_format: TextureFormat,
    sheets: u32,
    cull: Cull,
    tiles: Tiles,
    splat: Splat,
    composite: Composite,
    occlude: Occlude,
}

/// The quad rasterizer's part of a frame.
#[derive(Debug)]
pub(crate) struct QuadFrame {
    groups: SheetGroups,
    footprints: Footprints,
    lists: Vec<PreparedList>,
    sheet_views: Vec<TextureView>,
    splat_mode: SplatMode,
    clear_group: BindGroup,
    composite_mode: CompositeMode,
    composite_groups: Vec<BindGroup>,
    occlude_groups: [BindGroup; 2],
}

#[derive(Debug)]
struct PreparedList {
    cull: CullList,
    splat_group: BindGroup,
}

impl QuadRasterizer {
    /// Compiles the stages for groups of `sheets` sheets of the given format.
    pub(crate) fn new(device: &Device, sheet_format: TextureFormat, sheets: u32) -> Self {
        Self {
            sheet_format,
            sheets,
            cull: Cull::new(device, sheets),
            tiles: Tiles::new(device),
            splat: Splat::new(device, sheet_format, sheets),
            composite: Composite::default(),
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
        previous: Option<QuadFrame>,
    ) -> Result<(QuadFrame, Prepared), RenderError> {
        let FrameInputs { device, request, frame, .. } = inputs;
        let FrameRequest { view, splatting, kernel, rays, covered, window, .. } = request;
        let (old_groups, old_footprints, old_lists) = match previous {
            Some(QuadFrame { groups, footprints, lists, .. }) => (Some(groups), Some(footprints), lists),
            None => (None, None, Vec::new()),
        };
        let (format, sheets) = (self.sheet_format, self.sheets);
        let settings = GroupSettings { view, covered, drawn: &window.slabs, sheets, format, layers: sheets };
        let group_bytes = |plan: &FramePlan, stride| uniforms::groups(plan, kernel, splatting, stride);
        let (groups, bucketed) = SheetGroups::prepare(inputs, settings, &self.tiles, group_bytes, old_groups)?;
        let (footprints, tabled) = Footprints::renewed(old_footprints, inputs);
        let lists = self.prepare_lists(inputs, &groups, &footprints, old_lists)?;
        let composite_mode = CompositeMode { compositing: splatting.compositing, rays: *rays };
        let splat_mode = SplatMode { form: splatting.footprint, perspective: view.perspective.is_some() };
        self.splat.prepare(device, splat_mode);
        let SheetGroups { targets, tile_lists, .. } = &groups;
        let frame = QuadFrame {
            splat_mode,
            clear_group: self.splat.bind_clear(device, frame, &tile_lists.composited),
            composite_mode,
            composite_groups: self.bind_bands(inputs, composite_mode, &groups),
            occlude_groups: self.occlude.bind(device, [frame, &groups.groups], &tile_lists.occluding, targets),
            sheet_views: (0..self.sheets).map(|layer| targets.sheet_view(layer)).collect(),
            groups,
            footprints,
            lists,
        };
        Ok((frame, Prepared { bucketed, tabled }))
    }

    /// Prepares culling and splatting for every list of bricks.
    fn prepare_lists(
        &self,
        inputs: FrameInputs<'_>,
        groups: &SheetGroups,
        footprints: &Footprints,
        old: Vec<PreparedList>,
    ) -> Result<Vec<PreparedList>, RenderError> {
        let FrameInputs { device, frame, .. } = inputs;
        let buffers = groups.cull_buffers(inputs, None);
        let mut old = old.into_iter().map(|old| old.cull);
        (inputs.list().lists.iter().zip(&groups.planned.orders).zip(&groups.planned.most))
            .map(|((list, order), &most)| {
                let cull = self.cull.prepare(device, buffers, list, order, most, old.next())?;
                let splat_group = self.splat.bind(device, frame, &groups.groups, &cull, &footprints.texture);
                Ok(PreparedList { cull, splat_group })
            })
            .collect()
    }

    /// Binds the stage composite to every band of the compositing buffer.
    fn bind_bands(&self, inputs: FrameInputs<'_>, mode: CompositeMode, groups: &SheetGroups) -> Vec<BindGroup> {
        let sheets = &groups.targets.sheets_view();
        let buffers = groups.composite_buffers(inputs, sheets);
        let bands = inputs.compositing.bands.iter();
        bands.map(|band| self.composite.bind(inputs.device, mode, buffers, band)).collect()
    }

    /// The resources that a new frame of these lists of bricks needs, with groups of `sheets` sheets.
    ///
    /// # Errors
    /// As for [`Self::prepare`].
    pub(crate) fn estimate(
        limits: &Limits,
        request: &FrameRequest,
        lists: &[&[Brick]],
        (sheet_format, sheets): (TextureFormat, u32),
    ) -> Result<FrameEstimate, RenderError> {
        let FrameRequest { view, kernel, splatting, covered, window, .. } = request;
        let lists_of_bricks = lists.iter().copied();
        let plan = FramePlan::new(lists_of_bricks, *view, sheets, splatting.order, covered.clone(), &window.slabs);
        let group_bytes = uniforms::groups(&plan, kernel, splatting, group_stride(limits));
        let buffers = SheetGroups::buffer_specs(request, &plan, &group_bytes, lists);
        let targets = Targets::estimate(limits, view.size, sheet_format, sheets)?;
        Ok(FrameEstimate {
            bytes: sizes(limits, &buffers)? + targets + FootprintTable::bytes(splatting.footprint),
            groups: plan.groups.len(),
            passes: SheetGroups::passes(&plan, 1),
        })
    }

    /// Draws the frame.
    pub(crate) fn record(&self, encoder: &mut CommandEncoder, timer: &mut Option<Timer>, frame: &QuadFrame) {
        let tile_lists = &frame.groups.tile_lists;
        frame.groups.clear(encoder, frame.lists.iter().map(|list| &list.cull));
        for (lists, any_offset) in frame.groups.with_lists(&frame.lists) {
            let mut pass = encoder.begin_compute_pass(&compute("sheetsplat.cull", timer, "cull"));
            for &(list, offset) in &lists {
                self.cull.record(&mut pass, &list.cull, offset);
            }
            self.tiles.record(&mut pass, tile_lists, any_offset);
            drop(pass);

            let clear = (&frame.clear_group, &tile_lists.composited);
            let draws = lists.iter().map(|(list, offset)| (&list.splat_group, *offset, &list.cull.draw_args));
            let times = timer.as_mut().map(|timer| timer.render("splat"));
            self.splat.record(encoder, times, frame.splat_mode, &frame.sheet_views, clear, draws);

            let mut pass = encoder.begin_compute_pass(&compute("sheetsplat.composite", timer, "composite"));
            let bands = &frame.composite_groups;
            self.composite.record(&mut pass, frame.composite_mode, bands, any_offset, &tile_lists.composited);
            self.occlude.record(&mut pass, &frame.occlude_groups, any_offset, &tile_lists.occluding);
        }
    }
}

impl QuadFrame {
    /// The number of the frame's passes.
    pub(crate) fn passes(&self) -> usize {
        SheetGroups::passes(&self.groups.planned.plan, 1)
    }

    /// The groups' slabs.
    pub(crate) fn group_slabs(&self) -> GroupSlabs {
        self.groups.slabs()
    }

    /// Copies the frame's counts to a place in `staging`.
    pub(crate) fn copy_counts(&self, encoder: &mut CommandEncoder, staging: &Buffer, at: u64) {
        self.groups.copy_counts(encoder, staging, at);
    }

    /// The buffer with the words of first hits, and their byte offset in it.
    pub(crate) fn first_hits(&self) -> (&Buffer, u64) {
        (&self.groups.hits, 0)
    }

    /// Bytes of GPU memory.
    pub(crate) fn gpu_bytes(&self) -> u64 {
        let lists: u64 = self.lists.iter().map(|list| list.cull.gpu_bytes()).sum();
        self.groups.gpu_bytes() + self.footprints.texture.gpu_bytes + lists
    }
}
