//! The quad rasterizer where classification comes after splatting (SPEC §9): for every slab plane the stages cull, values, tiles, field, classify and occlude. The
//! slab between a plane and the one before it is classified when both are drawn.

use std::ops::Range;

use wgpu::{BindGroup, Buffer, BufferUsages, CommandEncoder, Device, Limits, TextureFormat, TextureView};

use super::quads::{Planned, counts_and_hits, group_stride, most_of, order_bytes};
use super::{FrameEstimate, FrameInputs, Prepared, compute};
use crate::error::RenderError;
use crate::gpu::bindings::{BufferSpec, buffer_spec, content_spec, grown, sizes};
use crate::gpu::layout::{Brick, FieldPlanes, Tally};
use crate::gpu::targets::Targets;
use crate::gpu::timer::Timer;
use crate::gpu::uniforms;
use crate::lists::brick;
use crate::lists::quad_plan::{FramePlan, tile_grid};
use crate::pass::classify::{CARRIED_BYTES, Classify, ClassifyBuffers, ClassifyGroup, ClassifyMode};
use crate::pass::composite::{CompositeBuffers, CompositeMode};
use crate::pass::cull::{Cull, CullBuffers, CullList};
use crate::pass::field::{self, Field};
use crate::pass::occlude::Occlude;
use crate::pass::tiles::{TileLists, Tiles};
use crate::pass::values::PlaneBuffers;
use crate::rasterizer::request::{After, FrameRequest};
use crate::settings::shading::Gradient;
use crate::settings::splatting::Order;
use crate::stats::GroupSlabs;

/// The stages.
#[derive(Debug)]
pub(crate) struct FieldRasterizer {
    sheet_format: TextureFormat,
    cull: Cull,
    tiles: Tiles,
    field: Field,
    classify: Classify,
    occlude: Occlude,
}

/// A frame's part that is this rasterizer's.
#[derive(Debug)]
pub(crate) struct FieldFrame {
    planned: Planned,
    order: Order,
    targets: Targets,
    planes: Buffer,
    groups: Buffer,
    group_stride: u32,
    culled: Buffer,
    tile_lists: TileLists,
    lists: Vec<PreparedList>,
    sheet_views: Vec<TextureView>,
    gradient: Gradient,
    clear_group: BindGroup,
    /// First hits, `[u32]`, one per pixel; of one, if they are not asked for.
    hits: Buffer,
    /// By band, what pixels carry from plane to plane.
    carried: Vec<Buffer>,
    classify_groups: Vec<ClassifyGroup>,
    occlude_groups: [BindGroup; 2],
}

#[derive(Debug)]
struct PreparedList {
    cull: CullList,
    field_group: BindGroup,
}

impl FieldRasterizer {
    /// Compiles the stages for sheets of the given format.
    pub(crate) fn new(device: &Device, sheet_format: TextureFormat) -> Self {
        Self {
            sheet_format,
            cull: Cull::of_planes(device),
            tiles: Tiles::of_planes(device),
            field: Field::new(device, sheet_format),
            classify: Classify::new(device),
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
        after: &After,
        previous: Option<FieldFrame>,
    ) -> Result<(FieldFrame, Prepared), RenderError> {
        let FrameInputs { device, queue, volume, request, frame, control_points, compositing, cut } = inputs;
        let FrameRequest { splatting, rays, .. } = request;
        let (view, order) = (&after.view, splatting.order);
        let mut old = PreviousBuffers::of(previous);
        let targets = match old.targets.filter(|old| old.size == view.size) {
            Some(targets) => targets,
            None => Targets::new(device, view.size, self.sheet_format, field::SHEETS_PER_PLANE)?,
        };
        let covered = covered(volume.lists.bricks(), after);
        let (planned, _, bucketed) = Planned::renewed(inputs, (view, &covered), old.planned, 1);
        let plan = &planned.plan;
        let numbers = uniforms::planes(&after.planes, view, volume.gpu_volume().value_format(), &after.numbers);
        let bytes = bytemuck::bytes_of(&numbers);
        let planes = inputs.filled(old.planes, "sheetsplat.planes", bytes, BufferUsages::UNIFORM)?;
        let group_stride = group_stride(&device.limits());
        let group_bytes = uniforms::plane_groups(plan, &after.planes, splatting, group_stride);
        let groups = inputs.filled(old.groups, "sheetsplat.groups", &group_bytes, BufferUsages::UNIFORM)?;
        let [wanted_culled, wanted_hits] = counts_and_hits(request);
        let culled = grown(device, old.culled, &wanted_culled)?;
        let coefficients = match &after.needs.coefficients {
            Some(exact) => Some(exact.texture(device, queue)?),
            None => None,
        };

        let shared = CullBuffers {
            frame,
            groups: &groups,
            values: volume.values(),
            has_holes: volume.has_holes(),
            labels: volume.labels(),
            control_points,
            occluded: &targets.occluded,
            culled: &culled,
            planes: Some(PlaneBuffers { planes: &planes, coefficients }),
        };
        let mut old_lists = old.lists.into_iter();
        let lists: Vec<PreparedList> = (volume.lists.lists.iter().zip(&planned.orders).zip(&planned.most))
            .map(|((list, order), &most)| {
                let previous = old_lists.next().map(|old| old.cull);
                let cull = self.cull.prepare(device, shared, list, order, most, previous)?;
                let field_group = self.field.bind(device, [frame, &groups, &planes], &cull);
                Ok(PreparedList { cull, field_group })
            })
            .collect::<Result<_, RenderError>>()?;
        let buffers = [frame, &groups, &culled];
        let tile_lists = self.tiles.prepare(device, buffers, &targets, plan.groups.len(), old.tile_lists)?;
        let tiles = &tile_lists.composited;
        let sheets = targets.sheets_view();
        let hits = grown(device, old.hits, &wanted_hits)?;
        let buffers = ClassifyBuffers {
            composite: CompositeBuffers {
                frame,
                groups: &groups,
                sheets: &sheets,
                tiles,
                targets: &targets,
                cut,
                hits: &hits,
            },
            control_points,
            planes: &planes,
            values: volume.values(),
            labels: volume.labels(),
        };
        let mode = ClassifyMode {
            composite: CompositeMode { compositing: splatting.compositing, rays: *rays },
            gradient: after.gradient,
            labels: volume.shades_by_label(),
            holes: volume.has_holes(),
        };
        let mut old_carried = old.carried.drain(..);
        let carried = (compositing.bands.iter())
            .map(|band| {
                grown(device, old_carried.next(), &carried(u64::from(view.size[0]) * u64::from(band.band.rows)))
            })
            .collect::<Result<Vec<Buffer>, RenderError>>()?;
        let bands = compositing.bands.iter().zip(&carried);
        self.field.prepare(device, after.gradient);
        let frame = FieldFrame {
            clear_group: self.field.bind_clear(device, frame, tiles),
            classify_groups: bands.map(|band| self.classify.bind(device, mode, buffers, band)).collect(),
            occlude_groups: self.occlude.bind(device, [frame, &groups], &tile_lists.occluding, &targets),
            sheet_views: (0..field::SHEETS_PER_PLANE).map(|layer| targets.sheet_view(layer)).collect(),
            group_stride: group_stride as u32,
            gradient: after.gradient,
            order,
            planned,
            targets,
            planes,
            groups,
            culled,
            tile_lists,
            lists,
            hits,
            carried,
        };
        Ok((frame, Prepared { bucketed, tabled: false }))
    }

    /// What a new frame of these lists of bricks will take.
    ///
    /// # Errors
    /// Those of [`Self::prepare`].
    pub(crate) fn estimate(
        limits: &Limits,
        request: &FrameRequest,
        after: &After,
        lists: &[&[Brick]],
        sheet_format: TextureFormat,
    ) -> Result<FrameEstimate, RenderError> {
        let size = after.view.size;
        let covered = covered(lists.iter().copied(), after);
        let plan = FramePlan::new(lists.iter().copied(), after.view, 1, request.splatting.order, covered);
        let most = most_of(lists.iter().copied(), &plan);
        let group_bytes =
            uniforms::plane_groups(&plan, &after.planes, &request.splatting, group_stride(limits)).len() as u64;
        let [columns, rows] = tile_grid(size);
        let mut buffers = vec![
            content_spec("sheetsplat.groups", group_bytes, BufferUsages::UNIFORM),
            content_spec("sheetsplat.planes", size_of::<FieldPlanes>() as u64, BufferUsages::UNIFORM),
        ];
        buffers.extend(counts_and_hits(request));
        buffers.extend(Tiles::buffer_specs(columns * rows, plan.groups.len()));
        buffers.extend(request.bands.iter().map(|band| carried(u64::from(size[0]) * u64::from(band.rows))));
        for ((bricks, order), most) in lists.iter().zip(&plan.orders).zip(most) {
            buffers.push(buffer_spec("sheetsplat.order", order_bytes(order).len() as u64, BufferUsages::STORAGE));
            buffers.extend(Cull::buffer_specs(bricks.len(), most));
        }
        let targets = Targets::estimate(limits, size, sheet_format, field::SHEETS_PER_PLANE)?;
        let groups = plan.groups.len();
        Ok(FrameEstimate { bytes: sizes(limits, &buffers)? + targets, groups, passes: 3 * groups })
    }

    /// Draws the frame.
    pub(crate) fn record(&self, encoder: &mut CommandEncoder, timer: &mut Option<Timer>, frame: &FieldFrame) {
        let FieldFrame { planned: Planned { plan, .. }, targets, tile_lists, .. } = frame;
        let masks = targets.masks().into_iter().chain([&frame.culled, &frame.hits]);
        for buffer in masks.chain(frame.lists.iter().map(|list| &list.cull.states)) {
            encoder.clear_buffer(buffer, 0, None);
        }
        let mut offsets = (0..).step_by(frame.group_stride as usize);
        for group in &plan.groups {
            // (list, offset of its group uniform) for the lists that reach the plane.
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
            let draws = lists.iter().map(|(list, offset)| (&list.field_group, *offset, &list.cull.draw_args));
            let times = timer.as_mut().map(|timer| timer.render("field"));
            self.field.record(encoder, times, frame.gradient, &frame.sheet_views, clear, draws);

            let mut pass = encoder.begin_compute_pass(&compute("sheetsplat.classify", timer, "classify"));
            self.classify.record(&mut pass, &frame.classify_groups, any_offset, &tile_lists.composited);
            self.occlude.record(&mut pass, &frame.occlude_groups, any_offset, &tile_lists.occluding);
        }
    }
}

impl FieldFrame {
    /// Passes of the frame: every plane has three.
    pub(crate) fn passes(&self) -> usize {
        3 * self.planned.plan.groups.len()
    }

    /// The slabs that are classified with each plane.
    pub(crate) fn group_slabs(&self) -> GroupSlabs {
        let before = if self.order == Order::FrontToBack { 1 } else { 0 };
        let firsts = self.planned.plan.groups.iter().map(|group| group.first_slab - before).collect();
        GroupSlabs { firsts, sheets: 1 }
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
        let shared = [&self.planes, &self.groups, &self.culled, &self.hits, composited, occluding, counts];
        let buffers = shared.into_iter().chain(&self.planned.orders).chain(&self.carried);
        self.targets.gpu_bytes() + lists + buffers.map(Buffer::size).sum::<u64>()
    }
}

/// What of the previous frame may be taken over.
#[derive(Default)]
struct PreviousBuffers {
    planned: Vec<Planned>,
    targets: Option<Targets>,
    planes: Option<Buffer>,
    groups: Option<Buffer>,
    culled: Option<Buffer>,
    hits: Option<Buffer>,
    carried: Vec<Buffer>,
    tile_lists: Option<TileLists>,
    lists: Vec<PreparedList>,
}

impl PreviousBuffers {
    fn of(frame: Option<FieldFrame>) -> Self {
        let Some(frame) = frame else { return Self::default() };
        Self {
            planned: vec![frame.planned],
            targets: Some(frame.targets),
            planes: Some(frame.planes),
            groups: Some(frame.groups),
            culled: Some(frame.culled),
            hits: Some(frame.hits),
            carried: frame.carried,
            tile_lists: Some(frame.tile_lists),
            lists: frame.lists,
        }
    }
}

/// The buffer of what some pixels carry from plane to plane.
fn carried(pixels: u64) -> BufferSpec {
    buffer_spec("sheetsplat.carried", pixels * CARRIED_BYTES, BufferUsages::STORAGE)
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
