//! Composite-every-sample (§3, Westover's first form): every voxel is a whole kernel, composited by itself, back to front. For
//! comparison; it bleeds colours of what is hidden, as the paper says.

use glam::{DVec2, UVec3};
use rayon::prelude::*;
use wgpu::{BindGroup, Buffer, BufferUsages, CommandEncoder, Device, TextureFormat, TextureView};

use super::{Footprints, Given, Prepared, compute};
use crate::brick::{self, BRICK_VOXELS};
use crate::error::RenderError;
use crate::gpu::bindings::grown;
use crate::gpu::layout::{FOLD, Frame, Indirect, QUADS, Splat, Tally, TileList};
use crate::gpu::targets::Targets;
use crate::gpu::timer::Timer;
use crate::gpu::uniforms;
use crate::pass::composite::{Composite, CompositeBuffers, RayMode};
use crate::pass::sample::{Sample, SampleBuffers, SampleMode};
use crate::pass::shade::{Shade, ShadeBuffers, ShadeGroup};
use crate::plan::tile_grid;
use crate::splatting::Compositing;
use crate::stats::GroupSlabs;
use crate::view::View;

/// Planes around all kernels, in the sheet depth of such views.
const PLANES: std::ops::Range<f64> = -0.5..0.5;

/// The stages.
#[derive(Debug)]
pub(crate) struct SampleRasterizer {
    format: TextureFormat,
    shade: Shade,
    sample: Sample,
    composite: Composite,
}

/// A frame's part.
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

/// What only changes with the view, or with the bricks.
#[derive(Debug)]
struct Sorted {
    view: View,
    support: f64,
    revision: u64,
    /// Places of the voxels on the screen, farthest first.
    places: Vec<u32>,
}

#[derive(Debug)]
struct Buffers {
    order: Buffer,
    args: Buffer,
    group: Buffer,
    splats: Buffer,
    tiles: Buffer,
    /// The frame, for the composite stage: samples are composited already.
    sum: Buffer,
    counts: Buffer,
    no_hits: Buffer,
}

impl SampleRasterizer {
    pub(crate) fn new(device: &Device, format: TextureFormat) -> Self {
        Self { format, shade: Shade::new(device), sample: Sample::new(device, format), composite: Composite::default() }
    }

    /// Sorts voxels if need be.
    ///
    /// # Errors
    /// If the voxels need more than one binding.
    pub(crate) fn prepare(
        &self,
        given: Given<'_>,
        frame: &Frame,
        previous: Option<SampleFrame>,
    ) -> Result<(SampleFrame, Prepared), RenderError> {
        let Given { device, volume, view, kernel, splatting, .. } = given;
        let limits = device.limits();
        let actual = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        let places = volume.lists.all().len() as u64 * u64::from(BRICK_VOXELS);
        let required = places * size_of::<Splat>() as u64;
        if required > actual {
            let what = "the voxels of splatting.method = \"composite-every-sample\"";
            return Err(RenderError::Limit { what, limit: "max_storage_buffer_binding_size", required, actual });
        }
        let (old_sorted, old_footprints) = match previous {
            Some(old) => (Some(old.sorted), Some(old.footprints)),
            None => (None, None),
        };
        let is_current =
            |old: &Sorted| old.view == *view && (old.support, old.revision) == (kernel.support(), volume.revision);
        let (sorted, bucketed) = match old_sorted.filter(is_current) {
            Some(sorted) => (sorted, false),
            None => (Sorted::new(given), true),
        };
        let (footprints, tabled) = Footprints::renewed(old_footprints, given);
        let targets = Targets::new(device, view.size, self.format, 1)?;
        let buffers = Buffers::new(given, frame, &sorted.places, required)?;

        let shade_group = self.shade.bind(
            device,
            ShadeBuffers {
                frame: given.frame,
                bricks: volume.lists.lists.first().map_or(&buffers.splats, |list| &list.buffer),
                values: volume.values(),
                labels: volume.labels(),
                control_points: given.control_points,
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
                frame: given.frame,
                group: &buffers.group,
                splats: &buffers.splats,
                order: &buffers.order,
                args: &buffers.args,
                footprints: &footprints.texture,
            },
        );
        let sheets = targets.sheets_view();
        let composite_buffers = CompositeBuffers {
            frame: &buffers.sum,
            groups: &buffers.group,
            sheets: &sheets,
            tiles: &buffers.tiles,
            targets: &targets,
            cut: given.cut,
            hits: &buffers.no_hits,
        };
        let composite = |band| self.composite.bind(device, RayMode::default(), composite_buffers, band);
        let frame = SampleFrame {
            composite_groups: given.compositing.bands.iter().map(composite).collect(),
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
        self.composite.record(&mut pass, RayMode::default(), &frame.composite_groups, 0, &buffers.tiles);
    }
}

impl SampleFrame {
    /// Passes of a frame.
    pub(crate) const PASSES: usize = 3;

    /// None: there are no sheets.
    pub(crate) fn group_slabs(&self) -> GroupSlabs {
        GroupSlabs { firsts: Vec::new(), sheets: 1 }
    }

    /// Copies the frame's counts to the start of `staging`.
    pub(crate) fn copy_counts(&self, encoder: &mut CommandEncoder, staging: &Buffer) {
        let counts = &self.buffers.counts;
        encoder.copy_buffer_to_buffer(counts, 0, staging, 0, counts.size());
    }

    /// Bytes of GPU memory.
    pub(crate) fn gpu_bytes(&self) -> u64 {
        let Buffers { order, args, group, splats, tiles, sum, counts, no_hits } = &self.buffers;
        let buffers: u64 =
            [order, args, group, splats, tiles, sum, counts, no_hits].into_iter().map(Buffer::size).sum();
        self.targets.gpu_bytes() + self.footprints.texture.gpu_bytes + buffers
    }
}

impl Sorted {
    /// Sorts by depth along w, equal ones in memory order.
    fn new(given: Given<'_>) -> Self {
        let Given { volume, view, kernel, .. } = given;
        let grid = volume.grid();
        let along_w = view.basis.w * grid.aspect();
        // Depths that differ by less than rounding errors may are equal.
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
        let mut voxels: Vec<(i64, u32, u32)> = (volume.lists.all().par_iter().enumerate())
            .flat_map_iter(|(number, brick)| {
                brick::voxels(brick)
                    .filter(|&(_, voxel)| is_on_screen(voxel))
                    .map(move |(slot, voxel)| (depth(voxel), grid.index_of(voxel), number as u32 * BRICK_VOXELS + slot))
            })
            .collect();
        voxels.par_sort_unstable();
        let places = voxels.into_iter().rev().map(|(_, _, place)| place).collect();
        Self { view: *view, support: kernel.support(), revision: volume.revision, places }
    }
}

impl Buffers {
    fn new(given: Given<'_>, frame: &Frame, places: &[u32], splat_bytes: u64) -> Result<Self, RenderError> {
        let Given { device, view, kernel, splatting, .. } = given;
        let count = places.len() as u32;
        let (storage, indirect) = (BufferUsages::STORAGE, BufferUsages::STORAGE | BufferUsages::INDIRECT);
        let filled = |label, bytes: &[u8], usage| given.filled(None, label, bytes, usage);
        let [columns, rows] = tile_grid(view.size);
        let tiles = columns * rows;
        let list = TileList { args: workgroups(tiles, 1), tiles: [0] };
        let mut tile_words: Vec<u8> = bytemuck::bytes_of(&list.args).to_vec();
        tile_words.extend((0..tiles).flat_map(u32::to_ne_bytes));
        let group = uniforms::group(view, kernel, splatting, PLANES);
        let counts =
            Tally { voxels_shaded: count, sections_rasterized: count, quads: count, ..bytemuck::Zeroable::zeroed() };
        let sum = Frame { compositing: Compositing::Xray as u32, ..*frame };
        Ok(Self {
            order: filled("sheetsplat.order", bytemuck::cast_slice(places), storage)?,
            args: filled("sheetsplat.args", bytemuck::bytes_of(&workgroups(count, 64)), indirect)?,
            group: filled("sheetsplat.group", bytemuck::bytes_of(&group), BufferUsages::UNIFORM)?,
            splats: grown(device, None, "sheetsplat.splats", splat_bytes.max(size_of::<Splat>() as u64), storage)?,
            tiles: filled("sheetsplat.tiles", &tile_words, indirect)?,
            sum: filled("sheetsplat.sum", bytemuck::bytes_of(&sum), BufferUsages::UNIFORM)?,
            counts: filled("sheetsplat.counts", bytemuck::bytes_of(&counts), BufferUsages::COPY_SRC)?,
            no_hits: filled("sheetsplat.no_hits", &[0; 4], storage)?,
        })
    }
}

/// Arguments for `count` things, of which a workgroup takes `each`.
fn workgroups(count: u32, each: u32) -> Indirect {
    let workgroups = count.div_ceil(each);
    Indirect {
        draw: [6 * u32::from(QUADS), count.div_ceil(QUADS.into()), 0, 0, 0],
        dispatch: [workgroups.min(FOLD), workgroups.div_ceil(FOLD), 1],
        count,
    }
}
