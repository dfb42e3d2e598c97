//! Composite-every-sample (§3, Westover's first form): every voxel is a whole kernel, composited by itself, back to front. It is for comparison:
//! colours of hidden voxels bleed, as the paper says.

use glam::{DVec2, UVec3};
use wgpu::{BindGroup, Buffer, BufferUsages, CommandEncoder, Device, Limits, TextureFormat, TextureView};

use super::{Footprints, FrameEstimate, FrameInputs, Prepared, compute};
use crate::error::RenderError;
use crate::geometry::footprint::FootprintTable;
use crate::geometry::view_geometry::ViewGeometry;
use crate::gpu::bindings::{BufferSpec, buffer_spec, content_spec, grown, sizes, written};
use crate::gpu::counts::GroupSlabs;
use crate::gpu::layout::{Brick, FOLD, Indirect, QUADS, SheetGroup, Splat, Tally};
use crate::gpu::targets::Targets;
use crate::gpu::timer::Timer;
use crate::gpu::uniforms;
use crate::lists::brick::{self, BRICK_VOXELS};
use crate::lists::quad_plan::tile_grid;
use crate::parallel::prelude::*;
use crate::pass::composite::{Composite, CompositeBuffers, CompositeMode, RayMode};
use crate::pass::sample::{Sample, SampleBuffers, SampleMode};
use crate::pass::shade::{Shade, ShadeBuffers, ShadeGroup};
use crate::rasterizer::request::FrameRequest;
use crate::settings::splatting::Compositing;
use crate::volume::Grid;

/// Planes around all kernels, in the sheet depth of such views.
const PLANES: std::ops::Range<f64> = -0.5..0.5;

/// The mode that adds the single buffer, whose samples are composited already, to the compositing buffer.
const SUM: CompositeMode =
    CompositeMode { compositing: Compositing::Xray, rays: RayMode { cut: false, first_hit: false } };

/// The rasterizer's stages.
#[derive(Debug)]
pub(crate) struct SampleRasterizer {
    format: TextureFormat,
    shade: Shade,
    sample: Sample,
    composite: Composite,
}

/// The rasterizer's part of a frame.
#[derive(Debug)]
pub(crate) struct SampleFrame {
    sorted: Sorted,
    targets: Targets,
    target: TextureView,
    footprints: Footprints,
    buffers: Buffers,
    shade_group: ShadeGroup,
    mode: SampleMode,
    sample_group: BindGroup,
    composite_groups: Vec<BindGroup>,
}

/// The sorted voxels, which change only with the view or the bricks.
#[derive(Debug)]
struct Sorted {
    view: ViewGeometry,
    support: f64,
    revision: u64,
    /// The places of voxels on the screen, farthest first.
    places: Vec<u32>,
}

#[derive(Debug)]
struct Buffers {
    order: Buffer,
    args: Buffer,
    group: Buffer,
    splats: Buffer,
    tiles: Buffer,
    counts: Buffer,
    no_hits: Buffer,
}

impl SampleRasterizer {
    pub(crate) fn new(device: &Device, format: TextureFormat) -> Self {
        Self { format, shade: Shade::new(device), sample: Sample::new(device, format), composite: Composite::default() }
    }

    /// Sorts voxels if necessary.
    ///
    /// # Errors
    /// If the voxels exceed one binding.
    pub(crate) fn prepare(
        &self,
        inputs: FrameInputs<'_>,
        previous: Option<SampleFrame>,
    ) -> Result<(SampleFrame, Prepared), RenderError> {
        let FrameInputs { device, volume, request, .. } = inputs;
        let FrameRequest { view, kernel, splatting, .. } = request;
        let bricks = inputs.list().all();
        let splat_bytes = splat_bytes(&device.limits(), bricks.len())?;
        let (old_sorted, old_footprints) = match previous {
            Some(old) => (Some(old.sorted), Some(old.footprints)),
            None => (None, None),
        };
        let is_current =
            |old: &Sorted| old.view == *view && (old.support, old.revision) == (kernel.support(), volume.revision);
        let (sorted, bucketed) = match old_sorted.filter(is_current) {
            Some(sorted) => (sorted, false),
            None => (Sorted::new(request, volume.grid(), bricks, volume.revision), true),
        };
        let (footprints, tabled) = Footprints::renewed(old_footprints, inputs);
        let targets = Targets::new(device, view.size, self.format, 1)?;
        let buffers = Buffers::new(inputs, &sorted.places, splat_bytes)?;

        let shade_group = self.shade.bind(
            device,
            ShadeBuffers {
                frame: inputs.frame,
                // Without bricks nothing is shaded, and the binding takes any buffer that is only read and holds a brick.
                bricks: inputs.list().lists.first().map_or(&buffers.args, |list| &list.buffer),
                values: volume.values(),
                pages: volume.pages(),
                has_holes: volume.has_holes(),
                channels: request.ramps.channels,
                colors: inputs.colors(),
                labels: inputs.labels(),
                membership: inputs.membership(),
                light: inputs.light,
                control_points: inputs.control_points,
                places: &buffers.order,
                args: &buffers.args,
                splats: &buffers.splats,
            },
        );
        let mode = SampleMode { form: splatting.footprint, compositing: splatting.compositing };
        let sample_group = self.sample.bind(
            device,
            mode,
            SampleBuffers {
                frame: inputs.frame,
                group: &buffers.group,
                splats: &buffers.splats,
                order: &buffers.order,
                args: &buffers.args,
                footprints: &footprints.texture,
            },
        );
        let sheets = targets.sheets_view();
        let composite_buffers = CompositeBuffers {
            frame: inputs.frame,
            groups: &buffers.group,
            sheets: &sheets,
            tiles: &buffers.tiles,
            targets: &targets,
            cut: inputs.cut,
            hits: &buffers.no_hits,
        };
        let composite = |band| self.composite.bind(device, SUM, composite_buffers, band);
        let frame = SampleFrame {
            composite_groups: inputs.compositing.bands.iter().map(composite).collect(),
            target: targets.sheet_view(0),
            sorted,
            targets,
            footprints,
            buffers,
            shade_group,
            mode,
            sample_group,
        };
        Ok((frame, Prepared { bucketed, tabled }))
    }

    /// The resources that a new frame of these bricks needs.
    ///
    /// # Errors
    /// As for [`Self::prepare`].
    pub(crate) fn estimate(
        limits: &Limits,
        request: &FrameRequest,
        (grid, bricks): (&Grid, &[Brick]),
        sheet_format: TextureFormat,
    ) -> Result<FrameEstimate, RenderError> {
        let splat_bytes = splat_bytes(limits, bricks.len())?;
        let voxels = Sorted::new(request, grid, bricks, 0).places.len();
        let buffers = sizes(limits, &Buffers::buffer_specs(request.view.size, voxels, splat_bytes))?;
        let targets = Targets::estimate(limits, request.view.size, sheet_format, 1)?;
        let bytes = buffers + targets + FootprintTable::bytes(request.splatting.footprint);
        Ok(FrameEstimate { bytes, groups: 0, passes: SampleFrame::PASSES })
    }

    /// Draws the frame.
    pub(crate) fn record(&self, encoder: &mut CommandEncoder, timer: &mut Option<Timer>, frame: &SampleFrame) {
        let SampleFrame { buffers, .. } = frame;
        let mut pass = encoder.begin_compute_pass(&compute("sheetsplat.shade", timer, "shade"));
        self.shade.record(&mut pass, &frame.shade_group, &buffers.args);
        drop(pass);
        let times = timer.as_mut().map(|timer| timer.render("sample"));
        let count = frame.sorted.places.len() as u32;
        self.sample.record(encoder, times, (frame.mode, &frame.sample_group), &frame.target, count);
        let mut pass = encoder.begin_compute_pass(&compute("sheetsplat.composite", timer, "composite"));
        self.composite.record(&mut pass, SUM, &frame.composite_groups, 0, &buffers.tiles);
    }
}

impl SampleFrame {
    /// The number of a frame's passes.
    pub(crate) const PASSES: usize = 3;

    /// No groups, because there are no sheets.
    pub(crate) fn group_slabs(&self) -> GroupSlabs {
        GroupSlabs { firsts: Vec::new(), sheets: 1 }
    }

    /// Copies the frame's counts to a place in `staging`.
    pub(crate) fn copy_counts(&self, encoder: &mut CommandEncoder, staging: &Buffer, at: u64) {
        let counts = &self.buffers.counts;
        encoder.copy_buffer_to_buffer(counts, 0, staging, at, counts.size());
    }

    /// Bytes of GPU memory.
    pub(crate) fn gpu_bytes(&self) -> u64 {
        let Buffers { order, args, group, splats, tiles, counts, no_hits } = &self.buffers;
        let buffers: u64 = [order, args, group, splats, tiles, counts, no_hits].into_iter().map(Buffer::size).sum();
        self.targets.gpu_bytes() + self.footprints.texture.gpu_bytes + buffers
    }
}

impl Sorted {
    /// Sorts by depth along w, and in memory order where depths are equal.
    fn new(request: &FrameRequest, grid: &Grid, bricks: &[Brick], revision: u64) -> Self {
        let FrameRequest { view, kernel, .. } = request;
        let along_w = view.basis.w * grid.aspect();
        // Depths that differ by less than rounding errors may count as equal.
        let depth =
            |voxel: UVec3| ((voxel.as_dvec3() - grid.center()).dot(along_w) * f64::from(1 << 20)).round() as i64;
        let half_box = view.half_box(kernel.support(), PLANES);
        let size = DVec2::from(view.size.map(f64::from));
        let is_on_screen = |voxel: UVec3| {
            let px = view.project(voxel).truncate();
            !view.touched(voxel).is_empty()
                && (px + half_box).cmpge(DVec2::splat(0.5)).all()
                && (px - half_box).cmple(size - 0.5).all()
        };
        let mut voxels: Vec<(i64, u32, u32)> = (bricks.par_iter().enumerate())
            .flat_map_iter(|(number, brick)| {
                brick::voxels(brick)
                    .filter(|&(_, voxel)| is_on_screen(voxel))
                    .map(move |(slot, voxel)| (depth(voxel), grid.index_of(voxel), number as u32 * BRICK_VOXELS + slot))
            })
            .collect();
        voxels.par_sort_unstable();
        let places = voxels.into_iter().rev().map(|(_, _, place)| place).collect();
        Self { view: *view, support: kernel.support(), revision, places }
    }
}

impl Buffers {
    /// The specs for `voxels` voxels in an image, in their order.
    fn buffer_specs(size: [u32; 2], voxels: usize, splat_bytes: u64) -> [BufferSpec; 7] {
        let (storage, indirect) = (BufferUsages::STORAGE, BufferUsages::STORAGE | BufferUsages::INDIRECT);
        let [columns, rows] = tile_grid(size);
        let one = |label, bytes: usize, usage| content_spec(label, bytes as u64, usage);
        [
            one("sheetsplat.order", 4 * voxels, storage),
            one("sheetsplat.args", size_of::<Indirect>(), indirect),
            one("sheetsplat.group", size_of::<SheetGroup>(), BufferUsages::UNIFORM),
            buffer_spec("sheetsplat.splats", splat_bytes.max(size_of::<Splat>() as u64), storage),
            one("sheetsplat.tiles", size_of::<Indirect>() + 4 * (columns * rows) as usize, indirect),
            one("sheetsplat.counts", size_of::<Tally>(), BufferUsages::COPY_SRC),
            one("sheetsplat.no_hits", 4, storage),
        ]
    }

    fn new(inputs: FrameInputs<'_>, places: &[u32], splat_bytes: u64) -> Result<Self, RenderError> {
        let FrameInputs { device, queue, request, .. } = inputs;
        let FrameRequest { view, kernel, splatting, .. } = request;
        let count = places.len() as u32;
        let [columns, rows] = tile_grid(view.size);
        let mut tile_words: Vec<u8> = bytemuck::bytes_of(&workgroups(columns * rows, 1)).to_vec();
        tile_words.extend((0..columns * rows).flat_map(u32::to_ne_bytes));
        let tally =
            Tally { voxels_shaded: count, sections_rasterized: count, quads: count, ..bytemuck::Zeroable::zeroed() };
        let [order, args, group, splats, tiles, counts, no_hits] =
            Self::buffer_specs(view.size, places.len(), splat_bytes);
        let filled = |spec: BufferSpec, bytes: &[u8]| written(device, queue, None, &spec, bytes);
        Ok(Self {
            order: filled(order, bytemuck::cast_slice(places))?,
            args: filled(args, bytemuck::bytes_of(&workgroups(count, 64)))?,
            group: filled(group, bytemuck::bytes_of(&uniforms::group(view, kernel, splatting, PLANES)))?,
            splats: grown(device, None, &splats)?,
            tiles: filled(tiles, &tile_words)?,
            counts: filled(counts, bytemuck::bytes_of(&tally))?,
            no_hits: filled(no_hits, &[0; 4])?,
        })
    }
}

/// The size in bytes of the splats of `bricks` bricks.
fn splat_bytes(limits: &Limits, bricks: usize) -> Result<u64, RenderError> {
    let actual = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
    let required = bricks as u64 * u64::from(BRICK_VOXELS) * size_of::<Splat>() as u64;
    if required > actual {
        let what = "the voxels of splatting.method = \"composite-every-sample\"";
        return Err(RenderError::Limit { what, limit: "max_storage_buffer_binding_size", required, actual });
    }
    Ok(required)
}

/// Arguments for `count` items, of which a workgroup processes `each`.
fn workgroups(count: u32, each: u32) -> Indirect {
    let workgroups = count.div_ceil(each);
    Indirect {
        draw: [6 * u32::from(QUADS), count.div_ceil(QUADS.into()), 0, 0, 0],
        dispatch: [workgroups.min(FOLD), workgroups.div_ceil(FOLD), 1],
        count,
    }
}
