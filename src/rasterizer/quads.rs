//! The quad rasterizer (Fig. 12): for every group of sheets the stages cull, tiles, splat, composite and occlude.

use std::ops::Range;

use wgpu::{BindGroup, Buffer, BufferUsages, CommandEncoder, Device, Limits, TextureFormat, TextureView};

use super::{Footprints, FrameEstimate, FrameInputs, Prepared, compute};
use crate::error::RenderError;
use crate::geometry::footprint::FootprintTable;
use crate::geometry::view_geometry::ViewGeometry;
use crate::gpu::bindings::{BufferSpec, buffer_spec, content_spec, grown, sizes, uploaded};
use crate::gpu::classified_volume::ClassifiedVolume;
use crate::gpu::layout::{Brick, SheetGroup, Tally};
use crate::gpu::targets::Targets;
use crate::gpu::timer::Timer;
use crate::gpu::uniforms;
use crate::lists::brick;
use crate::lists::quad_plan::{FramePlan, tile_grid};
use crate::pass::composite::{Composite, CompositeBuffers, CompositeMode};
use crate::pass::cull::{Cull, CullBuffers, CullList};
use crate::pass::occlude::Occlude;
use crate::pass::splat::{Splat, SplatMode};
use crate::pass::tiles::{TileLists, Tiles};
use crate::rasterizer::request::FrameRequest;
use crate::settings::splatting::Order;
use crate::stats::GroupSlabs;

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
    planned: Planned,
    /// For axis-aligned sheets, one for each other axis that views have looked along (§3.1), so that turning back needs no sorting.
    other_axes: Vec<Planned>,
    targets: Targets,
    footprints: Footprints,
    groups: Buffer,
    group_stride: u32,
    culled: Buffer,
    tile_lists: TileLists,
    lists: Vec<PreparedList>,
    sheet_views: Vec<TextureView>,
    splat_mode: SplatMode,
    clear_group: BindGroup,
    composite_mode: CompositeMode,
    /// First hits, `[u32]`, one per pixel, or a single one if they are not requested.
    hits: Buffer,
    composite_groups: Vec<BindGroup>,
    occlude_groups: [BindGroup; 2],
}

/// The buckets, which change only with the view or the bricks.
#[derive(Debug)]
pub(super) struct Planned {
    pub(super) plan: FramePlan,
    order: Order,
    /// [`means::covered`](crate::geometry::means::covered).
    covered: Range<f64>,
    /// [`ClassifiedVolume::revision`].
    revision: u64,
    /// For every list its bricks in bucket order, `[u32]`.
    pub(super) orders: Vec<Buffer>,
    /// For every list the maximum number of bricks and voxels that a group visits.
    pub(super) most: Vec<(u32, u32)>,
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
        let FrameRequest { view, splatting, kernel, rays, .. } = request;
        let old = PreviousBuffers::of(previous);
        let targets = match old.targets.filter(|old| old.size == view.size) {
            Some(targets) => targets,
            None => Targets::new(device, view.size, self.sheet_format, self.sheets)?,
        };
        let shown = (view, &request.covered);
        let (planned, other_axes, bucketed) = Planned::renewed(inputs, shown, old.planned, self.sheets);
        let (footprints, tabled) = Footprints::renewed(old.footprints, inputs);
        let group_stride = group_stride(&device.limits());
        let group_bytes = uniforms::groups(&planned.plan, kernel, splatting, group_stride);
        let groups = inputs.filled(old.groups, "sheetsplat.groups", &group_bytes, BufferUsages::UNIFORM)?;
        let [culled_spec, hits_spec] = counts_and_hits(request);
        let culled = grown(device, old.culled, &culled_spec)?;
        let hits = grown(device, old.hits, &hits_spec)?;
        let lists =
            self.prepare_lists(inputs, &planned, [&groups, &targets.occluded, &culled], &footprints, old.lists)?;
        let group_count = planned.plan.groups.len();
        let tile_lists =
            self.tiles.prepare(device, [frame, &groups, &culled], &targets, group_count, old.tile_lists)?;
        let composite_mode = CompositeMode { compositing: splatting.compositing, rays: *rays };
        let splat_mode = SplatMode { form: splatting.footprint, perspective: view.perspective.is_some() };
        self.splat.prepare(device, splat_mode);
        let frame = QuadFrame {
            splat_mode,
            clear_group: self.splat.bind_clear(device, frame, &tile_lists.composited),
            composite_mode,
            composite_groups: self.bind_bands(
                inputs,
                composite_mode,
                [&groups, &tile_lists.composited, &hits],
                &targets,
            ),
            occlude_groups: self.occlude.bind(device, [frame, &groups], &tile_lists.occluding, &targets),
            sheet_views: (0..self.sheets).map(|layer| targets.sheet_view(layer)).collect(),
            group_stride: group_stride as u32,
            planned,
            other_axes,
            targets,
            footprints,
            groups,
            culled,
            tile_lists,
            lists,
            hits,
        };
        Ok((frame, Prepared { bucketed, tabled }))
    }

    /// Prepares culling and splatting for every list of bricks.
    fn prepare_lists(
        &self,
        inputs: FrameInputs<'_>,
        planned: &Planned,
        [groups, occluded, culled]: [&Buffer; 3],
        footprints: &Footprints,
        old: Vec<PreparedList>,
    ) -> Result<Vec<PreparedList>, RenderError> {
        let FrameInputs { device, volume, frame, control_points, .. } = inputs;
        let buffers = CullBuffers {
            frame,
            groups,
            values: volume.values(),
            has_holes: volume.has_holes(),
            labels: volume.labels(),
            control_points,
            occluded,
            culled,
            planes: None,
        };
        let mut old = old.into_iter();
        (volume.lists.lists.iter().zip(&planned.orders).zip(&planned.most))
            .map(|((list, order), &most)| {
                let previous = old.next().map(|old| old.cull);
                let cull = self.cull.prepare(device, buffers, list, order, most, previous)?;
                let splat_group = self.splat.bind(device, frame, groups, &cull, &footprints.texture);
                Ok(PreparedList { cull, splat_group })
            })
            .collect()
    }

    /// Binds the stage composite to every band of the compositing buffer.
    fn bind_bands(
        &self,
        inputs: FrameInputs<'_>,
        mode: CompositeMode,
        [groups, tiles, hits]: [&Buffer; 3],
        targets: &Targets,
    ) -> Vec<BindGroup> {
        let FrameInputs { device, frame, compositing, cut, .. } = inputs;
        let sheets = &targets.sheets_view();
        let buffers = CompositeBuffers { frame, groups, sheets, tiles, targets, cut, hits };
        compositing.bands.iter().map(|band| self.composite.bind(device, mode, buffers, band)).collect()
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
        let FrameRequest { view, kernel, splatting, covered, .. } = request;
        let plan = FramePlan::new(lists.iter().copied(), *view, sheets, splatting.order, covered.clone());
        let most = most_of(lists.iter().copied(), &plan);
        let group_bytes = uniforms::groups(&plan, kernel, splatting, group_stride(limits)).len() as u64;
        let [columns, rows] = tile_grid(view.size);
        let mut buffers = vec![content_spec("sheetsplat.groups", group_bytes, BufferUsages::UNIFORM)];
        buffers.extend(counts_and_hits(request));
        buffers.extend(Tiles::buffer_specs(columns * rows, plan.groups.len()));
        for ((bricks, order), most) in lists.iter().zip(&plan.orders).zip(most) {
            buffers.push(buffer_spec("sheetsplat.order", order_bytes(order).len() as u64, BufferUsages::STORAGE));
            buffers.extend(Cull::buffer_specs(bricks.len(), most));
        }
        let targets = Targets::estimate(limits, view.size, sheet_format, sheets)?;
        Ok(FrameEstimate {
            bytes: sizes(limits, &buffers)? + targets + FootprintTable::bytes(splatting.footprint),
            groups: plan.groups.len(),
            passes: passes(&plan),
        })
    }

    /// Draws the frame.
    pub(crate) fn record(&self, encoder: &mut CommandEncoder, timer: &mut Option<Timer>, frame: &QuadFrame) {
        let QuadFrame { planned: Planned { plan, .. }, targets, tile_lists, .. } = frame;
        let masks = targets.masks().into_iter().chain([&frame.culled, &frame.hits]);
        for buffer in masks.chain(frame.lists.iter().map(|list| &list.cull.states)) {
            encoder.clear_buffer(buffer, 0, None);
        }
        let mut offsets = (0..).step_by(frame.group_stride as usize);
        for group in &plan.groups {
            // (list, offset of its group uniform) for the lists that reach into the group.
            let all: Vec<(&PreparedList, u32)> = frame.lists.iter().zip(&mut offsets).collect();
            let Some(&(_, any_offset)) = all.first() else { continue };
            let reaches = |(list, bricks): (_, &Range<u32>)| (!bricks.is_empty()).then_some(list);
            let lists: Vec<(&PreparedList, u32)> = all.into_iter().zip(&group.bricks).filter_map(reaches).collect();

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
    /// The number of the frame's passes: three per group.
    pub(crate) fn passes(&self) -> usize {
        passes(&self.planned.plan)
    }

    /// The groups' slabs.
    pub(crate) fn group_slabs(&self) -> GroupSlabs {
        let FramePlan { groups, sheets, .. } = &self.planned.plan;
        GroupSlabs { firsts: groups.iter().map(|group| group.first_slab).collect(), sheets: *sheets }
    }

    /// Copies the frame's counts to the start of `staging`.
    pub(crate) fn copy_counts(&self, encoder: &mut CommandEncoder, staging: &Buffer) {
        let (tally, tiles) = (size_of::<Tally>() as u64, self.planned.plan.groups.len() as u64 * 4);
        encoder.copy_buffer_to_buffer(&self.culled, 0, staging, 0, tally);
        encoder.copy_buffer_to_buffer(&self.tile_lists.counts, 0, staging, tally, tiles);
    }

    /// The buffer with the words of first hits, and their byte offset in it.
    pub(crate) fn first_hits(&self) -> (&Buffer, u64) {
        (&self.hits, 0)
    }

    /// Bytes of GPU memory.
    pub(crate) fn gpu_bytes(&self) -> u64 {
        let lists: u64 = self.lists.iter().map(|list| list.cull.gpu_bytes()).sum();
        let TileLists { composited, occluding, counts, .. } = &self.tile_lists;
        let orders = self.other_axes.iter().chain([&self.planned]).flat_map(|planned| &planned.orders);
        let buffers: u64 = [&self.groups, &self.culled, &self.hits, composited, occluding, counts]
            .into_iter()
            .chain(orders)
            .map(Buffer::size)
            .sum();
        self.targets.gpu_bytes() + self.footprints.texture.gpu_bytes + lists + buffers
    }
}

impl Planned {
    /// The plan for a view in which these sheet depths count, taken from `old` if one is still valid there; the plans that stay valid for
    /// other axes; and whether the plan is new.
    pub(super) fn renewed(
        inputs: FrameInputs<'_>,
        (view, covered): (&ViewGeometry, &Range<f64>),
        old: Vec<Self>,
        sheets: u32,
    ) -> (Self, Vec<Self>, bool) {
        let FrameInputs { device, volume, request, .. } = inputs;
        let order = request.splatting.order;
        let mut usable = old;
        usable.retain(|old| {
            old.is_of(volume, order, covered) && (old.plan.view.has_depths_of(view) || old.plan.view.is_by_slices())
        });
        let current = usable.iter().position(|old| old.plan.view.has_depths_of(view));
        let mut planned = match current {
            Some(at) => usable.swap_remove(at),
            None => Self::new(device, volume, (view, order, covered), sheets),
        };
        planned.plan.view = *view;
        (planned, usable, current.is_none())
    }

    fn new(
        device: &Device,
        volume: &ClassifiedVolume,
        (view, order, covered): (&ViewGeometry, Order, &Range<f64>),
        sheets: u32,
    ) -> Self {
        let plan = FramePlan::new(volume.lists.bricks(), *view, sheets, order, covered.clone());
        let most = most_of(volume.lists.bricks(), &plan);
        let upload = |order: &Vec<u32>| {
            let bytes = order_bytes(order);
            uploaded(device, "sheetsplat.order", bytes, bytes.len() as u64, BufferUsages::STORAGE)
        };
        let orders = plan.orders.iter().map(upload).collect();
        Self { order, covered: covered.clone(), revision: volume.revision, orders, most, plan }
    }

    /// Whether another frame of a volume can go by it.
    fn is_of(&self, volume: &ClassifiedVolume, order: Order, covered: &Range<f64>) -> bool {
        (self.order, self.revision, &self.covered) == (order, volume.revision, covered)
    }
}

/// The buffers of the previous frame that may be reused.
#[derive(Default)]
struct PreviousBuffers {
    planned: Vec<Planned>,
    targets: Option<Targets>,
    footprints: Option<Footprints>,
    groups: Option<Buffer>,
    culled: Option<Buffer>,
    hits: Option<Buffer>,
    tile_lists: Option<TileLists>,
    lists: Vec<PreparedList>,
}

impl PreviousBuffers {
    fn of(frame: Option<QuadFrame>) -> Self {
        let Some(frame) = frame else { return Self::default() };
        Self {
            planned: frame.other_axes.into_iter().chain([frame.planned]).collect(),
            targets: Some(frame.targets),
            footprints: Some(frame.footprints),
            groups: Some(frame.groups),
            culled: Some(frame.culled),
            hits: Some(frame.hits),
            tile_lists: Some(frame.tile_lists),
            lists: frame.lists,
        }
    }
}

/// The number of timed passes: three per group.
fn passes(plan: &FramePlan) -> usize {
    3 * plan.groups.len()
}

/// The stride between groups in bytes.
pub(super) fn group_stride(limits: &Limits) -> usize {
    size_of::<SheetGroup>().next_multiple_of(limits.min_uniform_buffer_offset_alignment as usize)
}

/// The buffers for culling's counts and for first hits.
pub(super) fn counts_and_hits(request: &FrameRequest) -> [BufferSpec; 2] {
    let [columns, rows] = tile_grid(request.view.size);
    let culled_bytes = size_of::<Tally>() as u64 + u64::from(columns * rows) * 4;
    let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST | BufferUsages::COPY_SRC;
    [
        buffer_spec("sheetsplat.culled", culled_bytes, usage),
        buffer_spec("sheetsplat.hits", request.hit_bytes().max(4), usage),
    ]
}

/// A list's bricks in bucket order. Bindings may not be empty.
pub(super) fn order_bytes(order: &[u32]) -> &[u8] {
    if order.is_empty() { &[0; 4] } else { bytemuck::cast_slice(order) }
}

/// For every list the maximum number of bricks and voxels that a group visits.
pub(super) fn most_of<'a>(lists: impl Iterator<Item = &'a [Brick]>, plan: &FramePlan) -> Vec<(u32, u32)> {
    let of_list = |(at, (bricks, order)): (usize, (&[Brick], &Vec<u32>))| {
        let voxels = |&brick: &u32| brick::present(&bricks[brick as usize]).count_ones();
        most(plan.groups.iter().map(|group| {
            let bricks = group.bricks[at].clone();
            order[bricks.start as usize..bricks.end as usize].iter().map(voxels)
        }))
    };
    lists.zip(&plan.orders).enumerate().map(of_list).collect()
}

/// The maximum number of bricks and voxels that a group visits, from the voxel counts of every group's bricks.
fn most<C: ExactSizeIterator<Item = u32>>(groups: impl Iterator<Item = C>) -> (u32, u32) {
    groups.fold((0, 0), |(bricks, voxels), counts| (bricks.max(counts.len() as u32), voxels.max(counts.sum())))
}
