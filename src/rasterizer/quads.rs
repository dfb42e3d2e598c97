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

/// The stages.
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

/// A frame's part that is the quad rasterizer's.
#[derive(Debug)]
pub(crate) struct QuadFrame {
    planned: Planned,
    /// Axis-aligned, one for each of the other axes that views have looked along (§3.1): turning back sorts nothing.
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
    /// First hits, `[u32]`, one per pixel; of one, if they are not asked for.
    hits: Buffer,
    composite_groups: Vec<BindGroup>,
    occlude_groups: [BindGroup; 2],
}

/// What only changes with the view, or with the bricks: the buckets.
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
    /// For every list the most bricks and voxels that any group can visit.
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

    /// Buckets bricks if need be, and allocates what does not fit any more.
    ///
    /// # Errors
    /// If the device's buffers may not be that large.
    pub(crate) fn prepare(
        &self,
        inputs: FrameInputs<'_>,
        previous: Option<QuadFrame>,
    ) -> Result<(QuadFrame, Prepared), RenderError> {
        let FrameInputs { device, volume, request, frame, control_points, compositing, .. } = inputs;
        let FrameRequest { view, splatting, kernel, covered, rays, .. } = request;
        let old = PreviousBuffers::of(previous);
        let targets = old.targets.filter(|old| old.size == view.size);
        let targets = match targets {
            Some(targets) => targets,
            None => Targets::new(device, view.size, self.sheet_format, self.sheets)?,
        };
        let mut other_axes = old.planned;
        other_axes.retain(|old| {
            old.is_of(volume, splatting.order, covered)
                && (old.plan.view.has_depths_of(view) || old.plan.view.is_by_slices())
        });
        let current = other_axes.iter().position(|old| old.plan.view.has_depths_of(view));
        let bucketed = current.is_none();
        let mut planned = match current {
            Some(at) => other_axes.swap_remove(at),
            None => Planned::new(device, volume, (view, splatting.order, covered), self.sheets),
        };
        planned.plan.view = *view;
        let plan = &planned.plan;
        let (footprints, tabled) = Footprints::renewed(old.footprints, inputs);
        let group_stride = group_stride(&device.limits());
        let group_bytes = uniforms::groups(plan, kernel, splatting, group_stride);
        let groups = inputs.filled(old.groups, "sheetsplat.groups", &group_bytes, BufferUsages::UNIFORM)?;
        let [wanted_culled, wanted_hits] = counts_and_hits(request);
        let culled = grown(device, old.culled, &wanted_culled)?;

        let shared = CullBuffers {
            frame,
            groups: &groups,
            values: volume.values(),
            has_holes: volume.has_holes(),
            labels: volume.labels(),
            control_points,
            occluded: &targets.occluded,
            culled: &culled,
            planes: None,
        };
        let mut old_lists = old.lists.into_iter();
        let lists: Vec<PreparedList> = (volume.lists.lists.iter().zip(&planned.orders).zip(&planned.most))
            .map(|((list, order), &most)| {
                let previous = old_lists.next().map(|old| old.cull);
                let cull = self.cull.prepare(device, shared, list, order, most, previous)?;
                let splat_group = self.splat.bind(device, frame, &groups, &cull, &footprints.texture);
                Ok(PreparedList { cull, splat_group })
            })
            .collect::<Result<_, RenderError>>()?;
        let buffers = [frame, &groups, &culled];
        let tile_lists = self.tiles.prepare(device, buffers, &targets, plan.groups.len(), old.tile_lists)?;
        let tiles = &tile_lists.composited;
        let sheets = targets.sheets_view();
        let hits = grown(device, old.hits, &wanted_hits)?;
        let buffers = CompositeBuffers {
            frame,
            groups: &groups,
            sheets: &sheets,
            tiles,
            targets: &targets,
            cut: inputs.cut,
            hits: &hits,
        };
        let composite_mode = CompositeMode { compositing: splatting.compositing, rays: *rays };
        let composite = |band| self.composite.bind(device, composite_mode, buffers, band);
        let splat_mode = SplatMode { form: splatting.footprint, perspective: view.perspective.is_some() };
        self.splat.prepare(device, splat_mode);
        let frame = QuadFrame {
            splat_mode,
            clear_group: self.splat.bind_clear(device, frame, tiles),
            composite_mode,
            composite_groups: compositing.bands.iter().map(composite).collect(),
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

    /// What a new frame of these lists of bricks will take, with groups of `sheets` sheets.
    ///
    /// # Errors
    /// Those of [`Self::prepare`].
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
    /// Passes of the frame: every group has three.
    pub(crate) fn passes(&self) -> usize {
        passes(&self.planned.plan)
    }

    /// Its groups' slabs.
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

    /// The words of first hits, and where in their buffer they start, bytes.
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
    pub(super) fn new(
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
    pub(super) fn is_of(&self, volume: &ClassifiedVolume, order: Order, covered: &Range<f64>) -> bool {
        (self.order, self.revision, &self.covered) == (order, volume.revision, covered)
    }
}

/// What of the previous frame may be taken over.
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

/// Timed ones: every group has three.
fn passes(plan: &FramePlan) -> usize {
    3 * plan.groups.len()
}

/// Bytes from one group to the next.
pub(super) fn group_stride(limits: &Limits) -> usize {
    size_of::<SheetGroup>().next_multiple_of(limits.min_uniform_buffer_offset_alignment as usize)
}

/// The buffers of what culling counts, and of first hits.
pub(super) fn counts_and_hits(request: &FrameRequest) -> [BufferSpec; 2] {
    let [columns, rows] = tile_grid(request.view.size);
    let culled_bytes = size_of::<Tally>() as u64 + u64::from(columns * rows) * 4;
    let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST | BufferUsages::COPY_SRC;
    [
        buffer_spec("sheetsplat.culled", culled_bytes, usage),
        buffer_spec("sheetsplat.hits", request.hit_bytes().max(4), usage),
    ]
}

/// A list's bricks in bucket order; bindings may not be empty.
pub(super) fn order_bytes(order: &[u32]) -> &[u8] {
    if order.is_empty() { &[0; 4] } else { bytemuck::cast_slice(order) }
}

/// For every list the most bricks and voxels that any group can visit.
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

/// The most bricks and voxels that any group can visit, from the voxel counts of every group's bricks.
fn most<C: ExactSizeIterator<Item = u32>>(groups: impl Iterator<Item = C>) -> (u32, u32) {
    groups.fold((0, 0), |(bricks, voxels), counts| (bricks.max(counts.len() as u32), voxels.max(counts.sum())))
}
