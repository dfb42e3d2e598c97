//! The renderer a host embeds: it owns pipelines, never a device, and neither submits nor waits.

use wgpu::{Buffer, BufferUsages, CommandEncoder, Device, Queue, TextureFormat, TextureView};

use crate::error::RenderError;
use crate::footprint::FootprintTable;
use crate::gpu::bindings::grown;
use crate::gpu::device::{self, DeviceError};
use crate::gpu::footprint_texture::FootprintTexture;
use crate::gpu::layout::{Group, Tally};
use crate::gpu::targets::Targets;
use crate::gpu::timer::{PASS_BYTES, Timer};
use crate::gpu::uniforms::{self, Ramps};
use crate::kernel::Kernel;
use crate::pass::composite::Composite;
use crate::pass::cull::{Cull, CullBuffers};
use crate::pass::occlude::Occlude;
use crate::pass::resolve::Resolve;
use crate::pass::splat::Splat;
use crate::pass::tiles::Tiles;
use crate::plan::View;
use crate::prepared_frame::{Planned, PreparedFrame, PreparedList, Previous, Staging};
use crate::scene_view::{Prepared, SceneView};
use crate::splatting::FootprintForm;

/// What a renderer is made for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RendererOptions {
    /// Format of the sheet buffer, `Rgba32Float` or `Rgba16Float`; `None` takes the better one that the device blends.
    pub sheet_format: Option<TextureFormat>,
    /// Sheets drawn by one quad: 1, 2 or 4; `None` takes as many as the device's colour attachments allow.
    pub sheets_per_group: Option<u32>,
    /// Times every stage, where the device has timestamp queries.
    pub profile: bool,
    /// Format of the views that frames are drawn into; any renderable float or normalised format.
    pub target_format: TextureFormat,
}

impl Default for RendererOptions {
    fn default() -> Self {
        Self { sheet_format: None, sheets_per_group: None, profile: false, target_format: TextureFormat::Rgba32Float }
    }
}

/// The pipelines of every stage, for one device. Volumes and frames are separate and can be many.
#[derive(Debug)]
pub struct Renderer {
    sheet_format: TextureFormat,
    sheets: u32,
    profile: bool,
    cull: Cull,
    tiles: Tiles,
    splat: Splat,
    composite: Composite,
    occlude: Occlude,
    resolve: Resolve,
}

impl Renderer {
    /// Compiles every stage.
    ///
    /// # Errors
    /// If a limit of the device is too small or it cannot blend the sheet format asked for.
    pub fn new(device: &Device, options: &RendererOptions) -> Result<Self, DeviceError> {
        device::check(device)?;
        let sheet_format = device::sheet_format(device, options.sheet_format)?;
        let sheets = options.sheets_per_group.unwrap_or(device::sheets_per_group(device, sheet_format));
        Ok(Self {
            sheet_format,
            sheets,
            profile: options.profile,
            cull: Cull::new(device, sheets),
            tiles: Tiles::new(device),
            splat: Splat::new(device, sheet_format, sheets),
            composite: Composite::new(device),
            occlude: Occlude::new(device),
            resolve: Resolve::new(device, options.target_format),
        })
    }

    /// Format of the sheet buffer.
    pub fn sheet_format(&self) -> TextureFormat {
        self.sheet_format
    }

    /// Does what the view's changes since its last frame ask for, and no more: buckets if the camera, the slabs or the bricks
    /// changed (§5.1), buffers if they are too small. A change of colours, opacities or light writes a few hundred bytes.
    ///
    /// # Errors
    /// If the scene asks for something not implemented, or for more than the device's limits allow.
    pub fn prepare(&self, device: &Device, queue: &Queue, view: &mut SceneView) -> Result<Prepared, RenderError> {
        let SceneView { volume, scene, frame } = view;
        let splatting = &scene.splatting;
        let size = [scene.image.width, scene.image.height];
        let seen = View::new(volume.grid(), &scene.camera, splatting, size)?;
        let kernel = Kernel::new(splatting.radius, splatting.falloff);
        // What can fail comes before anything is taken from the last frame.
        let targets = match frame {
            Some(old) if old.targets.size == size && self.draws_into(&old.targets.sheets) => None,
            _ => Some(Targets::new(device, size, self.sheet_format, self.sheets)?),
        };
        let Previous {
            planned,
            targets: old_targets,
            footprints,
            uniform,
            groups,
            control_points,
            tally,
            tile_lists,
            lists,
        } = Previous::of(frame.take());

        let Some(targets) = targets.or(old_targets) else { unreachable!("made anew where there were none") };
        volume.lists.flush(device, queue);
        let current = |old: &Planned| {
            old.plan.view == seen
                && old.plan.sheets == self.sheets
                && (old.order, old.revision) == (splatting.order, volume.revision)
        };
        let mut prepared = Prepared::default();
        let planned = planned.filter(current).unwrap_or_else(|| {
            prepared.bucketed = true;
            Planned::new(device, volume, seen, self.sheets, splatting.order)
        });
        let plan = &planned.plan;

        let width = seen.slabs.width;
        // The summed-area form serves every width (§3.3.1).
        let of = (kernel, (splatting.footprint == FootprintForm::Sections).then_some(width));
        let footprints = footprints.filter(|old| (old.0.form, old.1) == (splatting.footprint, of));
        let footprints = footprints.unwrap_or_else(|| {
            let table = FootprintTable::new(splatting.footprint, &kernel, width);
            (FootprintTexture::upload(device, queue, &table), of)
        });
        let filled = |old: Option<Buffer>, label, bytes: &[u8], usage| {
            let buffer = grown(device, old, label, bytes.len() as u64, usage | BufferUsages::COPY_DST);
            queue.write_buffer(&buffer, 0, bytes);
            buffer
        };
        let ramps = Ramps::new(volume.transfer());
        let points = bytemuck::cast_slice(&ramps.points);
        let control_points = filled(control_points, "sheetsplat.control_points", points, BufferUsages::STORAGE);
        let frame_uniform = uniforms::frame(&seen, &kernel, volume.grid(), &ramps, scene);
        let bytes = bytemuck::bytes_of(&frame_uniform);
        let uniform = filled(uniform, "sheetsplat.frame", bytes, BufferUsages::UNIFORM);
        let alignment = device.limits().min_uniform_buffer_offset_alignment as usize;
        let group_stride = size_of::<Group>().next_multiple_of(alignment);
        let groups = filled(groups, "sheetsplat.groups", &uniforms::groups(plan, group_stride), BufferUsages::UNIFORM);
        let tally_bytes = size_of::<Tally>() as u64 + targets.opaque_tiles.size();
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST | BufferUsages::COPY_SRC;
        let tally = grown(device, tally, "sheetsplat.tally", tally_bytes, usage);

        let shared = CullBuffers {
            frame: &uniform,
            groups: &groups,
            values: &volume.texture.view,
            control_points: &control_points,
            occluded: &targets.occluded,
            tally: &tally,
        };
        let mut old_lists = lists.into_iter();
        let lists: Vec<PreparedList> = (volume.lists.lists.iter().zip(&planned.orders).zip(&planned.most))
            .map(|((list, order), &most)| {
                let previous = old_lists.next().map(|old| old.cull);
                let cull = self.cull.prepare(device, shared, list, order, most, previous);
                let splat_group = self.splat.bind(device, &uniform, &groups, &cull, &footprints.0);
                PreparedList { cull, splat_group }
            })
            .collect();
        let tile_lists =
            self.tiles.prepare(device, [&uniform, &groups, &tally], &targets, plan.groups.len(), tile_lists);
        // Every group has three passes.
        let passes = 3 * plan.groups.len() + 1;
        let timer = if self.profile { Timer::new(device, passes) } else { None };
        let timestamps = (size_of::<Tally>() as u64 + plan.groups.len() as u64 * 4).next_multiple_of(8);
        let staging = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("sheetsplat.counts"),
            size: timestamps + timer.as_ref().map_or(0, |_| passes as u64 * PASS_BYTES),
            usage: BufferUsages::COPY_DST | BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let period = queue.get_timestamp_period();
        let tiles = &tile_lists.composited;
        let sheets = targets.sheets_view();
        let composite = |band| self.composite.bind(device, &uniform, band, &sheets, tiles, &targets);
        let list_bytes: u64 = lists.iter().map(|list| list.cull.gpu_bytes()).sum();
        let other_bytes = uniform.size() + groups.size() + control_points.size() + tally.size();
        *frame = Some(PreparedFrame {
            gpu_bytes: volume.gpu_bytes() + targets.gpu_bytes() + footprints.0.gpu_bytes + list_bytes + other_bytes,
            clear_group: self.splat.bind_clear(device, &uniform, tiles),
            composite_groups: targets.bands.iter().map(composite).collect(),
            occlude_groups: self.occlude.bind(device, &uniform, &tile_lists.occluding, &targets),
            resolve_groups: targets.bands.iter().map(|band| self.resolve.bind(device, &uniform, band)).collect(),
            sheet_views: (0..self.sheets).map(|layer| targets.sheet_view(layer)).collect(),
            group_stride: group_stride as u32,
            planned,
            targets,
            footprints,
            uniform,
            groups,
            control_points,
            tally,
            tile_lists,
            lists,
            timer,
            staging: Some(Staging { buffer: staging, timestamps, stages: Vec::new(), period }),
        });
        Ok(prepared)
    }

    /// Whether these sheet buffers are the ones that the renderer's pipelines draw into.
    fn draws_into(&self, sheets: &wgpu::Texture) -> bool {
        sheets.format() == self.sheet_format && sheets.depth_or_array_layers() == self.sheets
    }

    /// Records the view's prepared frame; nothing, if there is none. The target must have the renderer's target format and the
    /// scene's image size.
    pub fn record(&self, encoder: &mut CommandEncoder, view: &mut SceneView, target: &TextureView) {
        let Some(frame) = &mut view.frame else { return };
        let PreparedFrame { planned: Planned { plan, .. }, targets, tile_lists, timer, .. } = frame;
        let masks = [&targets.opaque, &targets.opaque_columns, &targets.occluded, &targets.opaque_tiles, &frame.tally];
        let accs = targets.bands.iter().map(|band| &band.acc);
        for buffer in accs.chain(masks).chain(frame.lists.iter().map(|list| &list.cull.states)) {
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
            self.splat.record(encoder, times, frame.footprints.0.form, &frame.sheet_views, clear, draws);

            let mut pass = encoder.begin_compute_pass(&compute("sheetsplat.composite", timer, "composite"));
            self.composite.record(&mut pass, &frame.composite_groups, &tile_lists.composited);
            self.occlude.record(&mut pass, &frame.occlude_groups, &tile_lists.occluding);
        }
        let bands = targets.bands.iter().map(|band| band.band);
        let times = timer.as_mut().map(|timer| timer.render("resolve"));
        self.resolve.record(encoder, times, target, targets.size[0], frame.resolve_groups.iter().zip(bands));

        if let Some(staging) = &mut frame.staging {
            let (tally, tiles) = (size_of::<Tally>() as u64, plan.groups.len() as u64 * 4);
            encoder.copy_buffer_to_buffer(&frame.tally, 0, &staging.buffer, 0, tally);
            encoder.copy_buffer_to_buffer(&tile_lists.counts, 0, &staging.buffer, tally, tiles);
            if let Some(timer) = timer {
                staging.stages = timer.finish(encoder, &staging.buffer, staging.timestamps);
            }
        }
    }
}

fn compute<'a>(label: &'a str, timer: &'a mut Option<Timer>, stage: &'static str) -> wgpu::ComputePassDescriptor<'a> {
    let timestamp_writes = timer.as_mut().map(|timer| timer.compute(stage));
    wgpu::ComputePassDescriptor { label: Some(label), timestamp_writes }
}
