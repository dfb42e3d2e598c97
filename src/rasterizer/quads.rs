//! The quad rasterizer (Fig. 12): for every group of sheets the stages cull, tiles, splat, composite and occlude.

use wgpu::{BindGroup, Buffer, BufferUsages, CommandEncoder, Device, TextureFormat, TextureView};

use super::{Footprints, Given, Prepared, compute};
use crate::brick;
use crate::classified_volume::ClassifiedVolume;
use crate::error::RenderError;
use crate::gpu::bindings::{grown, uploaded};
use crate::gpu::layout::{Group, Tally};
use crate::gpu::targets::Targets;
use crate::gpu::timer::Timer;
use crate::gpu::uniforms;
use crate::pass::composite::{Composite, CompositeBuffers, RayMode};
use crate::pass::cull::{Cull, CullBuffers, CullList};
use crate::pass::occlude::Occlude;
use crate::pass::splat::{Splat, SplatMode};
use crate::pass::tiles::{TileLists, Tiles};
use crate::plan::FramePlan;
use crate::splatting::Order;
use crate::stats::GroupSlabs;
use crate::view::View;

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
    rays: RayMode,
    /// First hits, `[u32]`, one per pixel; of one, if they are not asked for.
    hits: Buffer,
    composite_groups: Vec<BindGroup>,
    occlude_groups: [BindGroup; 2],
}

/// What only changes with the view, or with the bricks: the buckets.
#[derive(Debug)]
struct Planned {
    plan: FramePlan,
    order: Order,
    /// [`ClassifiedVolume::revision`].
    revision: u64,
    /// For every list its bricks in bucket order, `[u32]`.
    orders: Vec<Buffer>,
    /// For every list the most bricks and voxels that any group can visit.
    most: Vec<(u32, u32)>,
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
        given: Given<'_>,
        previous: Option<QuadFrame>,
    ) -> Result<(QuadFrame, Prepared), RenderError> {
        let Given { device, volume, view, splatting, frame, control_points, compositing, .. } = given;
        let old = Old::of(previous);
        let targets = old.targets.filter(|old| old.size == view.size);
        let targets = match targets {
            Some(targets) => targets,
            None => Targets::new(device, view.size, self.sheet_format, self.sheets)?,
        };
        let mut other_axes = old.planned;
        other_axes.retain(|old| {
            (old.order, old.revision) == (splatting.order, volume.revision)
                && (old.plan.view.has_depths_of(view) || old.plan.view.is_by_slices())
        });
        let current = other_axes.iter().position(|old| old.plan.view.has_depths_of(view));
        let bucketed = current.is_none();
        let mut planned = match current {
            Some(at) => other_axes.swap_remove(at),
            None => Planned::new(device, volume, *view, self.sheets, splatting.order),
        };
        planned.plan.view = *view;
        let plan = &planned.plan;
        let (footprints, tabled) = Footprints::renewed(old.footprints, given);
        let alignment = device.limits().min_uniform_buffer_offset_alignment as usize;
        let group_stride = size_of::<Group>().next_multiple_of(alignment);
        let group_bytes = uniforms::groups(plan, given.kernel, splatting, group_stride);
        let groups = given.filled(old.groups, "sheetsplat.groups", &group_bytes, BufferUsages::UNIFORM)?;
        let culled_bytes = size_of::<Tally>() as u64 + targets.opaque_tiles.size();
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST | BufferUsages::COPY_SRC;
        let culled = grown(device, old.culled, "sheetsplat.culled", culled_bytes, usage)?;

        let shared = CullBuffers {
            frame,
            groups: &groups,
            values: volume.values(),
            labels: volume.labels(),
            control_points,
            occluded: &targets.occluded,
            culled: &culled,
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
        let pixels = u64::from(view.size[0]) * u64::from(view.size[1]);
        let hit_bytes = if given.rays.first_hit { 4 * pixels } else { 4 };
        let hits = grown(device, old.hits, "sheetsplat.hits", hit_bytes, usage)?;
        let buffers = CompositeBuffers {
            frame,
            groups: &groups,
            sheets: &sheets,
            tiles,
            targets: &targets,
            cut: given.cut,
            hits: &hits,
        };
        let composite = |band| self.composite.bind(device, given.rays, buffers, band);
        let splat_mode = SplatMode { form: splatting.footprint, perspective: view.perspective.is_some() };
        self.splat.prepare(device, splat_mode);
        let frame = QuadFrame {
            splat_mode,
            clear_group: self.splat.bind_clear(device, frame, tiles),
            rays: given.rays,
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

    /// Draws the frame.
    pub(crate) fn record(&self, encoder: &mut CommandEncoder, timer: &mut Option<Timer>, frame: &QuadFrame) {
        let QuadFrame { planned: Planned { plan, .. }, targets, tile_lists, .. } = frame;
        let masks = [&targets.opaque, &targets.opaque_columns, &targets.occluded, &targets.opaque_tiles, &frame.culled];
        for buffer in masks.into_iter().chain([&frame.hits]).chain(frame.lists.iter().map(|list| &list.cull.states)) {
            encoder.clear_buffer(buffer, 0, None);
        }
        let mut offsets = (0..).step_by(frame.group_stride as usize);
        for group in &plan.groups {
            // (list, offset of its group uniform) for the lists that reach into the group.
            let lists: Vec<(&PreparedList, u32)> = (frame.lists.iter().zip(&mut offsets).zip(&group.bricks))
                .filter(|(_, bricks)| !bricks.is_empty())
                .map(|(list, _)| list)
                .collect();
            let Some(&(_, any_offset)) = lists.first() else { continue };

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
            self.composite.record(&mut pass, frame.rays, bands, any_offset, &tile_lists.composited);
            self.occlude.record(&mut pass, &frame.occlude_groups, any_offset, &tile_lists.occluding);
        }
    }
}

impl QuadFrame {
    /// Passes of the frame: every group has three.
    pub(crate) fn passes(&self) -> usize {
        3 * self.planned.plan.groups.len()
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
    fn new(device: &Device, volume: &ClassifiedVolume, view: View, sheets: u32, order: Order) -> Self {
        let plan = FramePlan::new(volume.lists.bricks(), view, sheets, order);
        let most = (volume.lists.bricks().zip(&plan.orders).enumerate())
            .map(|(at, (bricks, order))| {
                let voxels = |&brick: &u32| brick::present(&bricks[brick as usize]).count_ones();
                most(plan.groups.iter().map(|group| {
                    let bricks = group.bricks[at].clone();
                    order[bricks.start as usize..bricks.end as usize].iter().map(voxels)
                }))
            })
            .collect();
        let upload = |order: &Vec<u32>| {
            let bytes: &[u8] = if order.is_empty() { &[0; 4] } else { bytemuck::cast_slice(order) };
            uploaded(device, "sheetsplat.order", bytes, bytes.len() as u64, BufferUsages::STORAGE)
        };
        Self { order, revision: volume.revision, orders: plan.orders.iter().map(upload).collect(), most, plan }
    }
}

/// What of the previous frame may be taken over.
#[derive(Default)]
struct Old {
    planned: Vec<Planned>,
    targets: Option<Targets>,
    footprints: Option<Footprints>,
    groups: Option<Buffer>,
    culled: Option<Buffer>,
    hits: Option<Buffer>,
    tile_lists: Option<TileLists>,
    lists: Vec<PreparedList>,
}

impl Old {
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

/// The most bricks and voxels that any group can visit, from the voxel counts of every group's bricks.
fn most<C: ExactSizeIterator<Item = u32>>(groups: impl Iterator<Item = C>) -> (u32, u32) {
    groups.fold((0, 0), |(bricks, voxels), counts| (bricks.max(counts.len() as u32), voxels.max(counts.sum())))
}
