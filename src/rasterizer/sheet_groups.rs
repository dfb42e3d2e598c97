//! What both rasterizers that draw quads keep of a frame: the plan of its sheet groups, and the buffers that do not depend on what is splatted.

use std::ops::Range;

use wgpu::{Buffer, BufferUsages, CommandEncoder, Limits, TextureFormat, TextureView};

use super::FrameInputs;
use crate::error::RenderError;
use crate::geometry::view_geometry::ViewGeometry;
use crate::gpu::bindings::{BufferSpec, buffer_spec, content_spec, grown, uploaded};
use crate::gpu::classified_volume::ClassifiedVolume;
use crate::gpu::counts::GroupSlabs;
use crate::gpu::layout::{Brick, SheetGroup, Tally};
use crate::gpu::targets::Targets;
use crate::lists::brick;
use crate::lists::quad_plan::{FramePlan, tile_grid};
use crate::pass::composite::CompositeBuffers;
use crate::pass::cull::{Cull, CullBuffers, CullList};
use crate::pass::tiles::{TileLists, Tiles};
use crate::pass::values::PlaneBuffers;
use crate::rasterizer::request::FrameRequest;
use crate::settings::splatting::Order;

/// A frame's sheet groups.
#[derive(Debug)]
pub(super) struct SheetGroups {
    pub(super) planned: Planned,
    /// For axis-aligned sheets, one for each other axis that views have looked along (§3.1), so that turning back needs no sorting.
    other_axes: Vec<Planned>,
    pub(super) targets: Targets,
    /// One [`SheetGroup`] every `stride` bytes: group after group, and for every group list after list.
    pub(super) groups: Buffer,
    stride: usize,
    pub(super) culled: Buffer,
    pub(super) tile_lists: TileLists,
    /// First hits, `[u32]`, one per pixel, or a single one if they are not requested.
    pub(super) hits: Buffer,
}

/// What decides about a frame's groups.
#[derive(Clone, Copy, Debug)]
pub(super) struct GroupSettings<'a> {
    pub(super) view: &'a ViewGeometry,
    /// The sheet depths whose slabs count even if they are empty.
    pub(super) covered: &'a Range<f64>,
    /// The slabs, or planes, that are drawn.
    pub(super) drawn: &'a Range<i32>,
    /// The slabs or planes of a group.
    pub(super) sheets: u32,
    /// The sheet buffers' format and number.
    pub(super) format: TextureFormat,
    pub(super) layers: u32,
}

/// The buckets, which change only with the view or the bricks.
#[derive(Debug)]
pub(super) struct Planned {
    pub(super) plan: FramePlan,
    order: Order,
    /// [`means::covered`](crate::geometry::means::covered).
    covered: Range<f64>,
    /// The slabs, or planes, that are drawn.
    drawn: Range<i32>,
    /// [`ClassifiedVolume::revision`].
    revision: u64,
    /// For every list its bricks in bucket order, `[u32]`.
    pub(super) orders: Vec<Buffer>,
    /// For every list the maximum number of bricks and voxels that a group visits.
    pub(super) most: Vec<(u32, u32)>,
}

impl SheetGroups {
    /// Sorts bricks into buckets if necessary, and allocates buffers that no longer fit. `group_bytes` are the groups' uniforms for a plan and a
    /// stride. Also returns whether bricks were sorted.
    ///
    /// # Errors
    /// If buffers exceed the device's maximum size.
    pub(super) fn prepare(
        inputs: FrameInputs<'_>,
        settings: GroupSettings<'_>,
        tiles: &Tiles,
        group_bytes: impl FnOnce(&FramePlan, usize) -> Vec<u8>,
        previous: Option<Self>,
    ) -> Result<(Self, bool), RenderError> {
        let FrameInputs { device, request, frame, .. } = inputs;
        let GroupSettings { view, format, layers, .. } = settings;
        let (old_plans, old_targets, old_buffers, old_lists) = match previous {
            None => (Vec::new(), None, [None, None, None], None),
            Some(Self { planned, mut other_axes, targets, groups, culled, tile_lists, hits, .. }) => {
                other_axes.push(planned);
                (other_axes, Some(targets), [groups, culled, hits].map(Some), Some(tile_lists))
            }
        };
        let [old_groups, old_culled, old_hits] = old_buffers;
        let targets = match old_targets.filter(|old| old.size == view.size && old.layers() == layers) {
            Some(targets) => targets,
            None => Targets::new(device, view.size, format, layers)?,
        };
        let (planned, other_axes, bucketed) = Planned::renewed(inputs, settings, old_plans);
        let stride = group_stride(&device.limits());
        let bytes = group_bytes(&planned.plan, stride);
        let groups = inputs.filled(old_groups, "sheetsplat.groups", &bytes, BufferUsages::UNIFORM)?;
        let [culled_spec, hits_spec] = counts_and_hits(request);
        let culled = grown(device, old_culled, &culled_spec)?;
        let hits = grown(device, old_hits, &hits_spec)?;
        let buffers = [frame, &groups, &culled];
        let tile_lists = tiles.prepare(device, buffers, &targets, planned.plan.groups.len(), old_lists)?;
        Ok((Self { planned, other_axes, targets, groups, stride, culled, tile_lists, hits }, bucketed))
    }

    /// The buffers that a new frame of this plan needs for these lists of bricks, without targets.
    pub(super) fn buffer_specs(
        request: &FrameRequest,
        plan: &FramePlan,
        group_bytes: &[u8],
        lists: &[&[Brick]],
    ) -> Vec<BufferSpec> {
        let [columns, rows] = tile_grid(plan.view.size);
        let mut buffers = vec![content_spec("sheetsplat.groups", group_bytes.len() as u64, BufferUsages::UNIFORM)];
        buffers.extend(counts_and_hits(request));
        buffers.extend(Tiles::buffer_specs(columns * rows, plan.groups.len()));
        for ((bricks, order), most) in lists.iter().zip(&plan.orders).zip(most_of(lists.iter().copied(), plan)) {
            buffers.push(buffer_spec("sheetsplat.order", order_bytes(order).len() as u64, BufferUsages::STORAGE));
            buffers.extend(Cull::buffer_specs(bricks.len(), most));
        }
        buffers
    }

    /// The buffers that culling reads and writes; with slab planes what voxels are drawn onto them by.
    pub(super) fn cull_buffers<'a>(
        &'a self,
        inputs: FrameInputs<'a>,
        planes: Option<PlaneBuffers<'a>>,
    ) -> CullBuffers<'a> {
        let FrameInputs { volume, frame, control_points, request, .. } = inputs;
        let (colors, labels) = (inputs.colors(), inputs.labels());
        CullBuffers {
            frame,
            groups: &self.groups,
            values: volume.values(),
            pages: volume.pages(),
            has_holes: volume.has_holes(),
            channels: request.ramps.channels,
            colors,
            labels,
            membership: inputs.membership(),
            light: inputs.light,
            control_points,
            occluded: &self.targets.occluded,
            culled: &self.culled,
            planes,
        }
    }

    /// The buffers that sheets, seen through this view of theirs, are composited with.
    pub(super) fn composite_buffers<'a>(
        &'a self,
        inputs: FrameInputs<'a>,
        sheets: &'a TextureView,
    ) -> CompositeBuffers<'a> {
        let FrameInputs { frame, cut, .. } = inputs;
        let Self { groups, targets, tile_lists, hits, .. } = self;
        CompositeBuffers { frame, groups, sheets, tiles: &tile_lists.composited, targets, cut, hits }
    }

    /// Clears what a frame's groups exchange.
    pub(super) fn clear<'a>(&self, encoder: &mut CommandEncoder, lists: impl Iterator<Item = &'a CullList>) {
        let masks = self.targets.masks().into_iter().chain([&self.culled, &self.hits]);
        for buffer in masks.chain(lists.map(|list| &list.states)) {
            encoder.clear_buffer(buffer, 0, None);
        }
    }

    /// For every group the lists that reach into it, with the offsets of their uniforms; and the offset of any list's uniform, for stages that
    /// need only the group.
    pub(super) fn with_lists<'a, L>(&'a self, lists: &'a [L]) -> impl Iterator<Item = (Vec<(&'a L, u32)>, u32)> {
        let groups = self.planned.plan.groups.iter().filter(move |_| !lists.is_empty());
        groups.enumerate().map(move |(at, group)| {
            let first = at * lists.len() * self.stride;
            let offsets = (first as u32..).step_by(self.stride);
            let reaching = lists.iter().zip(offsets).zip(&group.bricks).filter(|(_, bricks)| !bricks.is_empty());
            (reaching.map(|(list, _)| list).collect(), first as u32)
        })
    }

    /// The number of timed passes: for each group one of culling, one of compositing, and those that draw quads between them.
    pub(super) fn passes(plan: &FramePlan, draws: usize) -> usize {
        (2 + draws) * plan.groups.len()
    }

    /// The groups' slabs, or planes.
    pub(super) fn slabs(&self) -> GroupSlabs {
        let FramePlan { groups, sheets, .. } = &self.planned.plan;
        GroupSlabs { firsts: groups.iter().map(|group| group.first_slab).collect(), sheets: *sheets }
    }

    /// Copies the frame's counts to a place in `staging`.
    pub(super) fn copy_counts(&self, encoder: &mut CommandEncoder, staging: &Buffer, at: u64) {
        let (tally, tiles) = (size_of::<Tally>() as u64, self.planned.plan.groups.len() as u64 * 4);
        encoder.copy_buffer_to_buffer(&self.culled, 0, staging, at, tally);
        encoder.copy_buffer_to_buffer(&self.tile_lists.counts, 0, staging, at + tally, tiles);
    }

    /// Bytes of GPU memory.
    pub(super) fn gpu_bytes(&self) -> u64 {
        let TileLists { composited, occluding, counts, .. } = &self.tile_lists;
        let orders = self.other_axes.iter().chain([&self.planned]).flat_map(|planned| &planned.orders);
        let own = [&self.groups, &self.culled, &self.hits, composited, occluding, counts];
        self.targets.gpu_bytes() + own.into_iter().chain(orders).map(Buffer::size).sum::<u64>()
    }
}

impl Planned {
    /// The plan for a view in which these sheet depths count, taken from `old` if one is still valid there; the plans that stay valid for
    /// other axes; and whether the plan is new.
    fn renewed(inputs: FrameInputs<'_>, settings: GroupSettings<'_>, old: Vec<Self>) -> (Self, Vec<Self>, bool) {
        let FrameInputs { volume, request, .. } = inputs;
        let GroupSettings { view, .. } = settings;
        let order = request.splatting.order;
        let mut usable = old;
        usable.retain(|old| {
            old.is_of(volume, order, settings) && (old.plan.view.has_depths_of(view) || old.plan.view.is_by_slices())
        });
        let current = usable.iter().position(|old| old.plan.view.has_depths_of(view));
        let mut planned = match current {
            Some(at) => usable.swap_remove(at),
            None => Self::new(inputs, order, settings),
        };
        planned.plan.view = *view;
        (planned, usable, current.is_none())
    }

    fn new(
        inputs: FrameInputs<'_>,
        order: Order,
        GroupSettings { view, covered, drawn, sheets, .. }: GroupSettings<'_>,
    ) -> Self {
        let plan = FramePlan::new(inputs.bricks(), *view, sheets, order, covered.clone(), drawn);
        let (most, revision) = (most_of(inputs.bricks(), &plan), inputs.volume.revision);
        let upload = |order: &Vec<u32>| {
            let bytes = order_bytes(order);
            uploaded(inputs.device, "sheetsplat.order", bytes, bytes.len() as u64, BufferUsages::STORAGE)
        };
        let orders = plan.orders.iter().map(upload).collect();
        Self { order, covered: covered.clone(), drawn: drawn.clone(), revision, orders, most, plan }
    }

    /// Whether another frame of a volume can go by it.
    fn is_of(&self, volume: &ClassifiedVolume, order: Order, settings: GroupSettings<'_>) -> bool {
        let GroupSettings { covered, drawn, .. } = settings;
        (self.order, self.revision, &self.covered, &self.drawn) == (order, volume.revision, covered, drawn)
    }
}

/// The stride between groups in bytes.
pub(super) fn group_stride(limits: &Limits) -> usize {
    size_of::<SheetGroup>().next_multiple_of(limits.min_uniform_buffer_offset_alignment as usize)
}

/// The buffers for culling's counts and for first hits.
fn counts_and_hits(request: &FrameRequest) -> [BufferSpec; 2] {
    let [columns, rows] = tile_grid(request.view.size);
    let culled_bytes = size_of::<Tally>() as u64 + u64::from(columns * rows) * 4;
    let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST | BufferUsages::COPY_SRC;
    [
        buffer_spec("sheetsplat.culled", culled_bytes, usage),
        buffer_spec("sheetsplat.hits", request.hit_bytes().max(4), usage),
    ]
}

/// A list's bricks in bucket order. Bindings may not be empty.
fn order_bytes(order: &[u32]) -> &[u8] {
    if order.is_empty() { &[0; 4] } else { bytemuck::cast_slice(order) }
}

/// For every list the maximum number of bricks and voxels that a group visits.
fn most_of<'a>(lists: impl Iterator<Item = &'a [Brick]>, plan: &FramePlan) -> Vec<(u32, u32)> {
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
