//! The renderer that a host embeds. It owns pipelines, but no device, and neither submits nor waits. It prepares every frame, which can fail,
//! records it, and presents it, which fails only for a scissor outside the target.

mod buffers;
pub(crate) mod pick;
mod prepare;
pub(crate) mod prepared_frame;
pub(crate) mod scene_view;

use std::sync::{Once, OnceLock};

use wgpu::{CommandEncoder, Device, Queue, RenderPass, TextureFormat, TextureView};

use crate::error::setting::SettingError;
use crate::error::{RenderError, check_device};
use crate::gpu::bindings::sizes;
use crate::gpu::brick_lists::SettledBricks;
use crate::gpu::counts;
use crate::gpu::device::{self, DeviceError, DeviceRequirements};
use crate::gpu::fault::scoped;
use crate::gpu::layout::Brick;
use crate::gpu::light_texture::LightTexture;
use crate::gpu::options::RendererOptions;
use crate::gpu::placement::Placement;
use crate::gpu::targets::CompositingBuffer;
use crate::gpu::timer::Timer;
use crate::light::KeptLight;
use crate::pass::first_hit::FirstHit;
use crate::pass::join::Join;
use crate::pass::resolve::Resolve;
use crate::rasterizer::compute;
use crate::rasterizer::fields::FieldRasterizer;
use crate::rasterizer::kind::{HAS_TILES, RasterizerKind};
use crate::rasterizer::quads::QuadRasterizer;
use crate::rasterizer::samples::SampleRasterizer;
use crate::rasterizer::tiles::TileRasterizer;
use crate::renderer::buffers::{
    control_points, cut_uniform, frame_uniform, joined_hits, needs_of, staging, timestamps_at,
};
use crate::renderer::prepared_frame::{Drawing, FirstHits, Joined, PreparedFrame, PreparedLayer};
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
    /// For channels with images of their own.
    join: Join,
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
            join: Join::default(),
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
            view.volume.forget();
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
        let (layers, joining) = view.volume.layers();
        let requests = self.requests(view, &layers, joining)?;
        let limits = self.device.limits();
        let (first, format) = (&requests[0], self.sheet_format);
        let needs = needs_of(first);
        let settled = view.volume.settled_for(&limits, needs);
        let (mut drawn, mut count_bytes, mut passes) = (0, 0, 1);
        let mut buffers = vec![cut_uniform()];
        for request in &requests {
            let settled = &settled[request.layer.lists.clone()];
            let lists: Vec<&[Brick]> = settled.iter().flat_map(SettledBricks::lists).collect();
            let all = settled[0].all();
            let by_label = view.volume.shades_by_label(&request.layer);
            let tiles = match request.kind {
                RasterizerKind::Tiles { insisted } if HAS_TILES => {
                    let layers: Vec<&[Brick]> = settled.iter().map(SettledBricks::all).collect();
                    match TileRasterizer::estimate(&limits, request, (&layers, lists.len()), by_label) {
                        Err(error) if insisted => return Err(error),
                        needs => needs.ok(),
                    }
                }
                _ => None,
            };
            let needs = match (tiles, request.kind, &request.after) {
                (Some(needs), ..) => needs,
                (None, RasterizerKind::Samples, _) => {
                    SampleRasterizer::estimate(&limits, request, (view.volume.grid(), all), format)?
                }
                (None, _, Some(after)) => FieldRasterizer::estimate(&limits, request, after, &lists, format)?,
                (None, _, None) => QuadRasterizer::estimate(&limits, request, &lists, (format, self.sheets))?,
            };
            drawn += needs.bytes;
            count_bytes += counts::count_bytes(needs.groups);
            passes += needs.passes + usize::from(joining.is_some());
            buffers.extend([frame_uniform(), control_points(request)]);
        }
        let timer = if self.profile { Timer::estimate(&self.device, passes) } else { None };
        buffers.push(staging(timestamps_at(count_bytes), timer.is_some(), passes));
        let coefficients = match needs.and_then(|needs| needs.coefficients.as_ref()) {
            Some(exact) => exact.estimate(&limits)?,
            None => 0,
        };
        let lists: u64 = settled.iter().map(SettledBricks::gpu_bytes).sum();
        let mut compositing = CompositingBuffer::estimate(first.view.size, first.bands.len());
        if joining.is_some() {
            compositing *= 2;
            buffers.extend([frame_uniform(), joined_hits(first)]);
        }
        let hits = if view.first_hit.is_some() { first.hit_bytes() } else { 0 };
        let buffers = timer.unwrap_or(0) + sizes(&limits, &buffers)?;
        let light = KeptLight::extent((view.volume.volume(), view.volume.transfer()), &view.scene, &view.camera())?;
        let light = LightTexture::estimate(&limits, light)?;
        Ok(view.volume.estimate()? + lists + coefficients + compositing + drawn + hits + buffers + light)
    }

    /// Records the drawing of the view's prepared frame into the view's own buffers, which [`Self::present`] and [`Self::draw`] read in this
    /// encoder or later ones. Does nothing if the view was never prepared. The renderer must be the one that prepared the view, and the
    /// commands must be submitted before the view is prepared again.
    pub fn record(&self, encoder: &mut CommandEncoder, view: &mut SceneView) {
        let Some(frame) = &mut view.frame else { return };
        let PreparedFrame { layers, compositing, joined, timer, .. } = frame;
        if let Some(timer) = timer {
            timer.restart();
        }
        if let Some(joined) = joined {
            joined.compositing.clear(encoder);
            encoder.clear_buffer(&joined.hits, 0, None);
        }
        for (number, layer) in layers.iter().enumerate() {
            compositing.clear(encoder);
            self.record_layer(encoder, timer, &layer.drawing);
            if let Some(Joined { mode, groups, .. }) = joined {
                let mut pass = encoder.begin_compute_pass(&compute("sheetsplat.join", timer, "join"));
                let pixels = compositing.bands.iter().map(|band| compositing.size[0] * band.band.rows);
                self.join.record(&mut pass, *mode, groups[number].iter().zip(pixels));
            }
        }
        if let (Some(stage), Some(FirstHits { view, group, .. })) = (self.first_hit.get(), &frame.first_hits) {
            stage.record(encoder, group, view);
        }
        if let Some(staging) = &mut frame.staging {
            let mut at = 0;
            for PreparedLayer { drawing, .. } in layers {
                drawing.copy_counts(encoder, &staging.buffer, at);
                at += counts::count_bytes(drawing.group_slabs().firsts.len());
            }
            if let Some(timer) = timer {
                staging.stages = timer.copy(encoder, &staging.buffer, staging.timestamps);
            }
        }
    }

    fn record_layer(&self, encoder: &mut CommandEncoder, timer: &mut Option<Timer>, drawing: &Drawing) {
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
