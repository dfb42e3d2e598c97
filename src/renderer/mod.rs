//! The renderer that a host embeds. It owns pipelines, but no device, and neither submits nor waits. It prepares every frame, which can fail,
//! records it, and presents it, which fails only for a scissor outside the target.

pub(crate) mod pick;
pub(crate) mod prepared_frame;
pub(crate) mod scene_view;

use std::sync::{Once, OnceLock};

use wgpu::{Buffer, BufferUsages, CommandEncoder, Device, Queue, RenderPass, TextureFormat, TextureView};

use crate::error::setting::SettingError;
use crate::error::{RenderError, check_device};
use crate::gpu::bindings::{BufferSpec, buffer_spec, content_spec, grown, sizes, written};
use crate::gpu::classified_volume::BrickNeeds;
use crate::gpu::counts::Staging;
use crate::gpu::device::{self, DeviceError, DeviceRequirements};
use crate::gpu::fault::scoped;
use crate::gpu::layout::{Cut, Frame, Tally};
use crate::gpu::options::RendererOptions;
use crate::gpu::placement::Placement;
use crate::gpu::targets::{CompositingBuffer, no_surfaces};
use crate::gpu::timer::{PASS_BYTES, Timer};
use crate::gpu::uniforms;
use crate::pass::composite::CutBuffers;
use crate::pass::first_hit::FirstHit;
use crate::pass::resolve::Resolve;
use crate::rasterizer::FrameInputs;
use crate::rasterizer::fields::FieldRasterizer;
use crate::rasterizer::kind::{HAS_TILES, RasterizerKind};
use crate::rasterizer::quads::QuadRasterizer;
use crate::rasterizer::request::FrameRequest;
use crate::rasterizer::samples::SampleRasterizer;
use crate::rasterizer::tiles::TileRasterizer;
use crate::renderer::prepared_frame::{Drawing, FirstHits, PreparedFrame, PreviousFrame};
use crate::renderer::scene_view::{Prepared, SceneView};
use crate::settings::splatting::Rasterizer;

/// The pipelines of every stage, for one device. Any number of volumes and frames can share it.
#[derive(Debug)]
pub struct Renderer {
    device: Device,
    sheet_format: TextureFormat,
    sheets: u32,
    rasterizer: Rasterizer,
    profile: bool,
    /// Nanoseconds per timestamp tick.
    period: f32,
    /// The quad rasterizer, compiled when first needed.
    quads: OnceLock<QuadRasterizer>,
    fields: OnceLock<FieldRasterizer>,
    samples: OnceLock<SampleRasterizer>,
    tiles: TileRasterizer,
    resolve: Resolve,
    first_hit: OnceLock<FirstHit>,
    /// A depth texture of one texel, bound where the host gives no surfaces.
    no_surfaces: OnceLock<TextureView>,
    /// Whether the fallback from tiles was logged.
    fell_back: Once,
}

impl Renderer {
    /// Compiles what every frame needs. A rasterizer's stages are compiled with the first frame that it draws.
    ///
    /// # Errors
    /// If the device's limits are insufficient, the device does not support the options, or it fails.
    pub fn new(device: &Device, queue: &Queue, options: &RendererOptions) -> Result<Self, DeviceError> {
        DeviceRequirements::check(device)?;
        let sheet_format = device::sheet_format(device, options.sheet_format)?;
        let sheets = device::sheets_per_group(device, sheet_format, options.sheets_per_group)?;
        options.check_target(device)?;
        let adapter = || device.adapter_info().name;
        let resolve = scoped(device, || Resolve::new(device, options))
            .map_err(|fault| DeviceError::Pipelines { adapter: adapter(), fault })?;
        Ok(Self {
            device: device.clone(),
            sheet_format,
            sheets,
            rasterizer: options.rasterizer,
            profile: options.profile,
            period: queue.get_timestamp_period(),
            quads: OnceLock::new(),
            fields: OnceLock::new(),
            samples: OnceLock::new(),
            tiles: TileRasterizer::default(),
            resolve,
            first_hit: OnceLock::new(),
            no_surfaces: OnceLock::new(),
            fell_back: Once::new(),
        })
    }

    /// The format of the sheet buffer.
    pub fn sheet_format(&self) -> TextureFormat {
        self.sheet_format
    }

    /// Prepares the view's next frame, recomputing only what changed since the last one: buckets if the camera, the slabs or the bricks changed
    /// (§5.1), buffers if they are too small. A change of colours, opacities or light writes a few hundred bytes.
    ///
    /// # Errors
    /// If the scene needs something that is not implemented or that exceeds the device's limits, or if the device fails. An error found before
    /// anything is allocated leaves the view's last frame. After any other error, and after every failure of the device, the view has no
    /// frame and is not drawn until it is prepared again: after
    /// [`OutOfMemory`](crate::DeviceFault::OutOfMemory) with smaller settings, after any other failure by a new renderer.
    pub fn prepare(&self, device: &Device, queue: &Queue, view: &mut SceneView) -> Result<Prepared, RenderError> {
        check_device(device, &self.device, "the renderer")?;
        check_device(device, view.volume.gpu_volume().device(), "the view")?;
        scoped(device, || self.prepare_unscoped(device, queue, view)).unwrap_or_else(|fault| {
            // Objects allocated without memory are invalid.
            view.frame = None;
            view.volume.lists.forget();
            Err(fault.into())
        })
    }

    /// The exact number of bytes of GPU memory that a new view with these settings will use once prepared ([`SceneView::gpu_bytes`]). Nothing is
    /// allocated; bricks are sorted into buckets as for a first frame. [`Self::prepare`] refuses for limits' sake exactly what this refuses.
    /// [`GpuVolume::estimate`](crate::gpu::gpu_volume::GpuVolume::estimate) states the volume's own memory before it is uploaded.
    ///
    /// # Errors
    /// If the scene needs something that is not implemented or that exceeds the device's limits.
    pub fn estimate(&self, view: &SceneView) -> Result<u64, RenderError> {
        check_device(view.volume.gpu_volume().device(), &self.device, "the renderer")?;
        let request = self.request(view)?;
        let limits = self.device.limits();
        let settled = view.volume.settled_for(&limits, needs_of(&request));
        let lists = settled.lists();
        let by_label = view.volume.shades_by_label();
        let tiles = match request.kind {
            RasterizerKind::Tiles { insisted } if HAS_TILES => {
                let bricks = (settled.all(), lists.len());
                match TileRasterizer::estimate(&limits, &request, bricks, by_label) {
                    Err(error) if insisted => return Err(error),
                    needs => needs.ok(),
                }
            }
            _ => None,
        };
        let needs = match (tiles, request.kind, &request.after) {
            (Some(needs), ..) => needs,
            (None, RasterizerKind::Samples, _) => {
                let bricks = (view.volume.grid(), settled.all());
                SampleRasterizer::estimate(&limits, &request, bricks, self.sheet_format)?
            }
            (None, _, Some(after)) => FieldRasterizer::estimate(&limits, &request, after, &lists, self.sheet_format)?,
            (None, _, None) => QuadRasterizer::estimate(&limits, &request, &lists, (self.sheet_format, self.sheets))?,
        };
        let passes = needs.passes + 1;
        let timer = if self.profile { Timer::estimate(&self.device, passes) } else { None };
        let buffers = [
            frame_uniform(),
            control_points(&request),
            cut_uniform(),
            staging(timestamps_at(needs.groups), timer.is_some(), passes),
        ];
        let coefficients = match needs_of(&request) {
            Some(BrickNeeds { coefficients: Some(exact), .. }) => exact.estimate(&limits)?,
            _ => 0,
        };
        let volume = view.volume.estimate()? + settled.gpu_bytes() + coefficients;
        let compositing = CompositingBuffer::estimate(request.view.size, request.bands.len());
        let counts = timer.unwrap_or(0) + sizes(&limits, &buffers)?;
        Ok(volume + compositing + needs.bytes + request.hit_bytes() + counts)
    }

    fn request(&self, view: &SceneView) -> Result<FrameRequest, RenderError> {
        let SceneView { volume, scene, surfaces, first_hit, window, .. } = view;
        FrameRequest::new(
            &self.device,
            volume,
            (scene, &view.camera()),
            (surfaces.as_ref(), *first_hit, window.as_ref()),
            self.rasterizer,
        )
    }

    fn prepare_unscoped(&self, device: &Device, queue: &Queue, view: &mut SceneView) -> Result<Prepared, RenderError> {
        // Everything that can fail comes before anything is taken from the last frame.
        let mut request = self.request(view)?;
        let SceneView { volume, scene, surfaces, frame, .. } = view;
        let fallback = request.fallback.take();
        if let Some(after) = &request.after {
            volume.show(&after.needs);
        }
        volume.flush(device, queue)?;
        let sheets = (self.sheet_format, self.sheets);
        let kept = PreviousFrame::of(frame.take(), sheets, &request.view);
        let FrameRequest { view: seen, kernel, ramps, rays, .. } = &request;
        let size = seen.size;
        let grid = *volume.grid();
        let compositing = kept.compositing.unwrap_or_else(|| CompositingBuffer::new(device, size, &request.bands));
        let write = |old, spec: &BufferSpec, bytes: &[u8]| written(device, queue, old, spec, bytes);
        let points = bytemuck::cast_slice(&ramps.points);
        let control_points = write(kept.control_points, &control_points(&request), points)?;
        let frame_values =
            uniforms::frame(request.stage_view(), kernel, (&grid, volume.gpu_volume().value_format()), ramps, scene);
        let uniform = write(kept.uniform, &frame_uniform(), bytemuck::bytes_of(&frame_values))?;
        let cut_values = uniforms::cut(seen, &grid, scene, request.surfaces, request.first_hit, &request.window);
        let cut = write(kept.cut, &cut_uniform(), bytemuck::bytes_of(&cut_values))?;
        let cut_buffers = CutBuffers {
            uniform: &cut,
            surfaces: match surfaces {
                Some(surfaces) => &surfaces.depth,
                None => self.no_surfaces.get_or_init(|| no_surfaces(device)),
            },
        };

        let inputs = FrameInputs {
            device,
            queue,
            volume,
            request: &request,
            frame: &uniform,
            control_points: &control_points,
            compositing: &compositing,
            cut: cut_buffers,
        };
        let was = kept.drawing.as_ref().map(Drawing::rasterizer);
        let (drawing, prepared, too_much) = self.draw_with(inputs, kept.drawing)?;
        let fallback = fallback.or(too_much);
        if let Some(reason) = &fallback {
            self.fell_back.call_once(|| {
                log::warn!("drawn by quads, which may take longer than by tiles: {reason}");
            });
        }
        let totals = kept.totals.filter(|_| !prepared.bucketed && was == Some(drawing.rasterizer()));

        let first_hits = drawing.first_hits().filter(|_| rays.first_hit).map(|words| {
            let stage = self.first_hit.get_or_init(|| FirstHit::new(device));
            let texture = kept.first_hits.unwrap_or_else(|| FirstHit::texture(device, size));
            let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
            FirstHits { group: stage.bind(device, &uniform, cut_buffers, words), texture, view }
        });

        // The rasterizer's passes, plus resolve.
        let passes = drawing.passes() + 1;
        let timer = if self.profile { Timer::new(device, passes) } else { None };
        let timestamps = timestamps_at(drawing.group_slabs().firsts.len());
        let staging = grown(device, kept.staging, &staging(timestamps, timer.is_some(), passes))?;
        let timer_bytes = timer.as_ref().map_or(0, Timer::gpu_bytes);
        let buffers: u64 = [&uniform, &control_points, &cut, &staging].map(Buffer::size).iter().sum();
        let shared_bytes = compositing.gpu_bytes() + buffers + request.hit_bytes() + timer_bytes;
        *frame = Some(PreparedFrame {
            gpu_bytes: volume.gpu_bytes() + drawing.gpu_bytes() + shared_bytes,
            sheets,
            resolve_groups: compositing.bands.iter().map(|band| self.resolve.bind(device, &uniform, band)).collect(),
            view: *seen,
            drawing,
            fallback,
            compositing,
            uniform,
            control_points,
            cut,
            first_hits,
            timer,
            totals,
            staging: Some(Staging { buffer: staging, timestamps, stages: Vec::new(), period: self.period }),
        });
        Ok(prepared)
    }

    /// Prepares a rasterizer's part: tiles, or quads if the view does not fit tiles and the scene does not require them. The error then says
    /// why.
    fn draw_with(
        &self,
        inputs: FrameInputs<'_>,
        previous: Option<Drawing>,
    ) -> Result<(Drawing, Prepared, Option<RenderError>), RenderError> {
        let (mut old_quads, mut old_tiles, mut old_samples, mut old_fields) = (None, None, None, None);
        match previous {
            Some(Drawing::Quads(frame)) => old_quads = Some(*frame),
            Some(Drawing::Fields(frame)) => old_fields = Some(*frame),
            Some(Drawing::Tiles(frame)) => old_tiles = Some(*frame),
            Some(Drawing::Samples(frame)) => old_samples = Some(*frame),
            None => {}
        }
        let kind = inputs.request.kind;
        if kind == RasterizerKind::Samples {
            let (frame, prepared) = self.samples(inputs.device).prepare(inputs, old_samples)?;
            return Ok((Drawing::Samples(Box::new(frame)), prepared, None));
        }
        let mut fallback = None;
        if let RasterizerKind::Tiles { insisted } = kind
            && HAS_TILES
        {
            match self.tiles.prepare(inputs, old_tiles) {
                Ok((frame, prepared)) => return Ok((Drawing::Tiles(Box::new(frame)), prepared, None)),
                Err(error) if insisted => return Err(error),
                Err(error) => fallback = Some(error),
            }
        }
        if let Some(after) = &inputs.request.after {
            let (frame, prepared) = self.fields(inputs.device).prepare(inputs, after, old_fields)?;
            return Ok((Drawing::Fields(Box::new(frame)), prepared, fallback));
        }
        let (frame, prepared) = self.quads(inputs.device).prepare(inputs, old_quads)?;
        Ok((Drawing::Quads(Box::new(frame)), prepared, fallback))
    }

    fn samples(&self, device: &Device) -> &SampleRasterizer {
        self.samples.get_or_init(|| SampleRasterizer::new(device, self.sheet_format))
    }

    fn fields(&self, device: &Device) -> &FieldRasterizer {
        self.fields.get_or_init(|| FieldRasterizer::new(device, self.sheet_format))
    }

    fn quads(&self, device: &Device) -> &QuadRasterizer {
        self.quads.get_or_init(|| QuadRasterizer::new(device, self.sheet_format, self.sheets))
    }

    /// Records the drawing of the view's prepared frame into the view's own buffers, which [`Self::present`] and [`Self::draw`] read in this
    /// encoder or later ones. Does nothing if the view was never prepared. The renderer must be the one that prepared the view, and the
    /// commands must be submitted before the view is prepared again.
    pub fn record(&self, encoder: &mut CommandEncoder, view: &mut SceneView) {
        let Some(frame) = &mut view.frame else { return };
        let PreparedFrame { drawing, compositing, timer, .. } = frame;
        if let Some(timer) = timer {
            timer.restart();
        }
        for band in &compositing.bands {
            encoder.clear_buffer(&band.acc, 0, None);
        }
        match drawing {
            Drawing::Tiles(tiles) => self.tiles.record(encoder, timer, tiles),
            Drawing::Fields(fields) => {
                if let Some(rasterizer) = self.fields.get() {
                    rasterizer.record(encoder, timer, fields);
                }
            }
            Drawing::Samples(samples) => {
                if let Some(rasterizer) = self.samples.get() {
                    rasterizer.record(encoder, timer, samples);
                }
            }
            Drawing::Quads(quads) => {
                if let Some(rasterizer) = self.quads.get() {
                    rasterizer.record(encoder, timer, quads);
                }
            }
        }
        if let (Some(stage), Some(FirstHits { view, group, .. })) = (self.first_hit.get(), &frame.first_hits) {
            stage.record(encoder, group, view);
        }
        if let Some(staging) = &mut frame.staging {
            drawing.copy_counts(encoder, &staging.buffer);
            if let Some(timer) = timer {
                staging.stages = timer.copy(encoder, &staging.buffer, staging.timestamps);
            }
        }
    }

    /// Records a pass that draws the view's image into a target, which is kept where the image does not cover it. Does nothing if the view was
    /// never prepared. The renderer must have been made for the target's format and sample count and for no depth attachment; wgpu
    /// reports a mismatch.
    ///
    /// # Errors
    /// If the scissor does not lie in the target. Nothing is recorded then.
    pub fn present(
        &self,
        encoder: &mut CommandEncoder,
        view: &mut SceneView,
        target: &TextureView,
        at: Placement,
    ) -> Result<(), SettingError> {
        let texture = target.texture();
        at.check([texture.width(), texture.height()])?;
        let Some(frame) = &mut view.frame else { return Ok(()) };
        // Once the counts have been requested, their buffer must not be written.
        let timer = frame.timer.as_mut().filter(|timer| frame.staging.is_some() && timer.has_room());
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("sheetsplat.resolve"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: target,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations { load: wgpu::LoadOp::Load, store: wgpu::StoreOp::Store },
            })],
            timestamp_writes: timer.map(|timer| timer.render("resolve")),
            ..wgpu::RenderPassDescriptor::default()
        });
        self.draw_frame(&mut pass, frame, at);
        drop(pass);
        if let (Some(timer), Some(staging)) = (&frame.timer, &mut frame.staging) {
            staging.stages = timer.copy(encoder, &staging.buffer, staging.timestamps);
        }
        Ok(())
    }

    /// Draws the view's image in a host's pass. Its attachments must have the formats and the sample count that the renderer was made for, and
    /// must contain the scissor ([`Placement::check`]); wgpu reports a mismatch. Does nothing if the view was never prepared. Changes the
    /// pass's pipeline, bind group 0, viewport and scissor rectangle. Other renderers on the same device may also draw the view, any number
    /// of times.
    pub fn draw(&self, pass: &mut RenderPass<'_>, view: &SceneView, at: Placement) {
        if let Some(frame) = &view.frame {
            self.draw_frame(pass, frame, at);
        }
    }

    fn draw_frame(&self, pass: &mut RenderPass<'_>, frame: &PreparedFrame, at: Placement) {
        let PreparedFrame { compositing, resolve_groups, .. } = frame;
        let bands = compositing.bands.iter().map(|band| band.band);
        self.resolve.draw(pass, compositing.size, resolve_groups.iter().zip(bands), at);
    }
}

/// What decides which bricks a frame draws whose values are classified after splatting.
fn needs_of(request: &FrameRequest) -> Option<&BrickNeeds> {
    request.after.as_ref().map(|after| &after.needs)
}

fn frame_uniform() -> BufferSpec {
    content_spec("sheetsplat.frame", size_of::<Frame>() as u64, BufferUsages::UNIFORM)
}

fn cut_uniform() -> BufferSpec {
    content_spec("sheetsplat.cut", size_of::<Cut>() as u64, BufferUsages::UNIFORM)
}

fn control_points(request: &FrameRequest) -> BufferSpec {
    let bytes = size_of_val(&request.ramps.points[..]) as u64;
    content_spec("sheetsplat.control_points", bytes, BufferUsages::STORAGE)
}

/// The byte offset of the timestamps behind the counts of `groups` sheet groups.
fn timestamps_at(groups: usize) -> u64 {
    (size_of::<Tally>() as u64 + groups as u64 * 4).next_multiple_of(8)
}

/// The buffer for counts, followed by the timestamps of `passes` passes if they are timed.
fn staging(timestamps: u64, timed: bool, passes: usize) -> BufferSpec {
    let bytes = timestamps + if timed { passes as u64 * PASS_BYTES } else { 0 };
    buffer_spec("sheetsplat.counts", bytes, BufferUsages::COPY_DST | BufferUsages::MAP_READ)
}
