//! The renderer a host embeds: it owns pipelines, never a device, and neither submits nor waits. Every frame it prepares, which can
//! fail, records, and presents, which cannot.

use std::sync::OnceLock;

use wgpu::{BufferUsages, CommandEncoder, Device, Queue, RenderPass, TextureFormat, TextureView};

use crate::error::{RenderError, check_device};
use crate::fault::scoped;
use crate::gpu::device::{self, DeviceError, DeviceRequirements};
use crate::gpu::layout::{Frame, Tally};
use crate::gpu::targets::CompositingBuffer;
use crate::gpu::timer::{PASS_BYTES, Timer};
use crate::gpu::uniforms::{self, Ramps};
use crate::kernel::Kernel;
use crate::pass::composite::{CutBuffers, RayMode};
use crate::pass::first_hit::FirstHit;
use crate::pass::resolve::Resolve;
use crate::placement::Placement;
use crate::prepared_frame::{Drawing, FirstHits, PreparedFrame};
use crate::rasterizer::quads::QuadRasterizer;
use crate::rasterizer::samples::SampleRasterizer;
use crate::rasterizer::tiles::TileRasterizer;
use crate::rasterizer::{Given, filled};
use crate::renderer_options::RendererOptions;
use crate::scene_view::{Prepared, SceneView};
use crate::splatting::{Compositing, Economies, FootprintBox, Method, Order, Rasterizer, Splatting};
use crate::stats::Staging;
use crate::view::View;

/// The pipelines of every stage, for one device. Volumes and frames are separate and can be many.
#[derive(Debug)]
pub struct Renderer {
    device: Device,
    sheet_format: TextureFormat,
    sheets: u32,
    rasterizer: Rasterizer,
    profile: bool,
    /// Nanoseconds of a timestamp's tick.
    period: f32,
    /// Compiled when first needed.
    quads: OnceLock<QuadRasterizer>,
    samples: OnceLock<SampleRasterizer>,
    tiles: TileRasterizer,
    resolve: Resolve,
    first_hit: OnceLock<FirstHit>,
    /// Stands for a host's depth where there is none.
    no_surfaces: OnceLock<TextureView>,
}

impl Renderer {
    /// Compiles what every frame needs; a rasterizer's stages are compiled with the first frame that it draws.
    ///
    /// # Errors
    /// If limits of the device are not enough, or it cannot do what the options ask for, or fails.
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
            samples: OnceLock::new(),
            tiles: TileRasterizer::default(),
            resolve,
            first_hit: OnceLock::new(),
            no_surfaces: OnceLock::new(),
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
    /// If the scene asks for something not implemented, or for more than the device's limits allow, or the device fails. What is found
    /// before anything is allocated leaves the view's last frame. After anything else, and a failure of the device always, the view has no
    /// frame, and is not drawn until it is prepared again: after
    /// [`OutOfMemory`](crate::fault::DeviceFault::OutOfMemory) with less, after any other by a new renderer.
    pub fn prepare(&self, device: &Device, queue: &Queue, view: &mut SceneView) -> Result<Prepared, RenderError> {
        check_device(device, &self.device, "the renderer")?;
        check_device(device, view.volume.gpu_volume().device(), "the view")?;
        scoped(device, || self.prepare_unscoped(device, queue, view)).unwrap_or_else(|fault| {
            // What there was no memory for is not valid.
            view.frame = None;
            view.volume.lists.forget();
            Err(fault.into())
        })
    }

    fn prepare_unscoped(&self, device: &Device, queue: &Queue, view: &mut SceneView) -> Result<Prepared, RenderError> {
        let SceneView { volume, scene, surfaces, first_hit, frame } = view;
        let splatting = &self.settled(scene.splatting);
        let size = [scene.image.width, scene.image.height];
        let seen = View::new(volume.grid(), &scene.camera, splatting, size)?;
        let kernel = Kernel::new(splatting.radius, splatting.falloff);
        // What can fail comes before anything is taken from the last frame.
        let compositing = match frame {
            Some(old) if old.compositing.size == size => None,
            _ => Some(CompositingBuffer::new(device, size)?),
        };
        let rays = RayMode { cut: surfaces.is_some() || !scene.clip.is_empty(), first_hit: first_hit.is_some() };
        check_rays(device, splatting, rays, *first_hit, size)?;
        let grid = *volume.grid();
        let depths = match surfaces {
            Some(surfaces) => Some((surfaces.depths(&seen, &grid)?, surfaces.origin)),
            None => None,
        };
        let way = way(device, splatting)?;
        volume.flush(device, queue)?;
        let old = frame.take();
        let (old_compositing, uniform, control_points, cut, drawing, totals) =
            old.map_or_else(Default::default, |old| {
                let PreparedFrame { sheets, compositing, uniform, control_points, cut, drawing, totals, view, .. } =
                    old;
                // That of another renderer may have other sheets.
                let drawing = (sheets == (self.sheet_format, self.sheets)).then_some(drawing);
                let totals = totals.filter(|_| view == seen);
                (Some(compositing), Some(uniform), Some(control_points), Some(cut), drawing, totals)
            });
        let Some(compositing) = compositing.or(old_compositing) else { unreachable!("made where there was none") };
        let ramps = Ramps::new(volume.transfer());
        let filled = |old, label: &'static str, bytes: &[u8], usage| filled(device, queue, old, label, bytes, usage);
        let points = bytemuck::cast_slice(&ramps.points);
        let control_points = filled(control_points, "sheetsplat.control_points", points, BufferUsages::STORAGE)?;
        let frame_uniform = uniforms::frame(&seen, &kernel, volume.grid(), &ramps, scene);
        let bytes = bytemuck::bytes_of(&frame_uniform);
        let uniform = filled(uniform, "sheetsplat.frame", bytes, BufferUsages::UNIFORM)?;
        let cut_uniform = uniforms::cut(&seen, &grid, &scene.clip, depths, *first_hit);
        let cut = filled(cut, "sheetsplat.cut", bytemuck::bytes_of(&cut_uniform), BufferUsages::UNIFORM)?;
        let cut_buffers = CutBuffers {
            uniform: &cut,
            surfaces: match surfaces {
                Some(surfaces) => &surfaces.depth,
                None => self.no_surfaces.get_or_init(|| no_surfaces(device)),
            },
        };

        let given = Given {
            device,
            queue,
            volume,
            view: &seen,
            kernel: &kernel,
            splatting,
            frame: &uniform,
            control_points: &control_points,
            ramp_lengths: ramps.lengths(),
            compositing: &compositing,
            rays,
            cut: cut_buffers,
        };
        let was = drawing.as_ref().map(Drawing::rasterizer);
        let (drawing, prepared) = self.draw_with(given, way, &frame_uniform, drawing)?;
        let totals = totals.filter(|_| !prepared.bucketed && was == Some(drawing.rasterizer()));

        let first_hits = drawing.first_hits().filter(|_| rays.first_hit).map(|words| {
            let stage = self.first_hit.get_or_init(|| FirstHit::new(device));
            let texture = FirstHit::texture(device, size);
            let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
            FirstHits { group: stage.bind(device, &uniform, cut_buffers, words), texture, view }
        });

        // The rasterizer's passes, and resolve.
        let passes = drawing.passes() + 1;
        let timer = if self.profile { Timer::new(device, passes) } else { None };
        let timestamps =
            (size_of::<Tally>() as u64 + drawing.group_slabs().firsts.len() as u64 * 4).next_multiple_of(8);
        let staging = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("sheetsplat.counts"),
            size: timestamps + timer.as_ref().map_or(0, |_| passes as u64 * PASS_BYTES),
            usage: BufferUsages::COPY_DST | BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let timer_bytes = timer.as_ref().map_or(0, Timer::gpu_bytes);
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let hit_bytes = first_hits.as_ref().map_or(0, |_| 4 * pixels);
        let shared_bytes = compositing.gpu_bytes() + uniform.size() + control_points.size() + cut.size() + hit_bytes;
        let count_bytes = staging.size() + timer_bytes;
        *frame = Some(PreparedFrame {
            gpu_bytes: volume.gpu_bytes() + drawing.gpu_bytes() + shared_bytes + count_bytes,
            sheets: (self.sheet_format, self.sheets),
            resolve_groups: compositing.bands.iter().map(|band| self.resolve.bind(device, &uniform, band)).collect(),
            view: seen,
            drawing,
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

    /// Prepares a rasterizer's part: by tiles, unless the view does not fit them and the scene does not insist.
    fn draw_with(
        &self,
        given: Given<'_>,
        way: Way,
        frame: &Frame,
        previous: Option<Drawing>,
    ) -> Result<(Drawing, Prepared), RenderError> {
        let (mut old_quads, mut old_tiles, mut old_samples) = (None, None, None);
        match previous {
            Some(Drawing::Quads(frame)) => old_quads = Some(*frame),
            Some(Drawing::Tiles(frame)) => old_tiles = Some(*frame),
            Some(Drawing::Samples(frame)) => old_samples = Some(*frame),
            None => {}
        }
        if way == Way::Samples {
            let (frame, prepared) = self.samples(given.device).prepare(given, frame, old_samples)?;
            return Ok((Drawing::Samples(Box::new(frame)), prepared));
        }
        if way == Way::Tiles {
            match self.tiles.prepare(given, old_tiles) {
                Ok((frame, prepared)) => return Ok((Drawing::Tiles(Box::new(frame)), prepared)),
                Err(error) if insists_on_tiles(given.splatting) => return Err(error),
                Err(_) => {}
            }
        }
        let (frame, prepared) = self.quads(given.device).prepare(given, old_quads)?;
        Ok((Drawing::Quads(Box::new(frame)), prepared))
    }

    /// The settings, with the renderer's rasterizer where they leave the choice.
    fn settled(&self, splatting: Splatting) -> Splatting {
        let is_open = splatting.rasterizer == Rasterizer::Auto && !insists_on_tiles(&splatting);
        Splatting { rasterizer: if is_open { self.rasterizer } else { splatting.rasterizer }, ..splatting }
    }

    fn samples(&self, device: &Device) -> &SampleRasterizer {
        self.samples.get_or_init(|| SampleRasterizer::new(device, self.sheet_format))
    }

    fn quads(&self, device: &Device) -> &QuadRasterizer {
        self.quads.get_or_init(|| QuadRasterizer::new(device, self.sheet_format, self.sheets))
    }

    /// Records the drawing of the view's prepared frame into the view's own buffers, from where [`Self::present`] and [`Self::draw`]
    /// take it, in this encoder or later ones; nothing, if the view was never prepared. The renderer must be the one that prepared it, and
    /// what is recorded must be submitted before the view is prepared again.
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

    /// Records a pass of its own that draws the view's image into a target, which keeps what the image does not cover; nothing, if
    /// the view was never prepared. The renderer must have been made for the target's format and sample count and for no depth
    /// attachment, and the scissor must lie in the target; what is wrong with them, wgpu reports.
    pub fn present(&self, encoder: &mut CommandEncoder, view: &mut SceneView, target: &TextureView, at: Placement) {
        let Some(frame) = &mut view.frame else { return };
        // Whoever waits for the counts has them, and their buffer.
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
    }

    /// Draws the view's image in a pass of the host's, whose attachments must be of the formats and the sample count that the
    /// renderer was made for; what is wrong with them, wgpu reports. Draws nothing, if the view was never prepared. Changes the pass's
    /// pipeline, bind group 0, viewport and scissor rectangle. A view may also be drawn by other renderers of its device than the
    /// one that recorded it, and as often as the host likes.
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

/// How to draw.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Way {
    Quads,
    /// If the view fits.
    Tiles,
    Samples,
}

/// Checks that the settings allow what of rays is looked at.
fn check_rays(
    device: &Device,
    splatting: &Splatting,
    rays: RayMode,
    first_hit: Option<f64>,
    [width, height]: [u32; 2],
) -> Result<(), RenderError> {
    let refused = |key, found: String, allowed: String| Err(RenderError::OutOfRange { key, found, allowed });
    if splatting.method == Method::CompositeEverySample && rays != RayMode::default() {
        let found = "\"composite-every-sample\" with clip planes, surfaces or first hits".to_owned();
        return refused("splatting.method", found, "a method with sheets".to_owned());
    }
    let Some(opacity) = first_hit else { return Ok(()) };
    let hides = splatting.culling && splatting.compositing != Compositing::Xray;
    let most = if hides { splatting.opacity_threshold } else { 1.0 };
    if !(opacity > 0.0 && opacity <= most) {
        let allowed = format!("above 0, at most {most}{}", if hides { ", the opacity_threshold" } else { "" });
        return refused("first_hit", opacity.to_string(), allowed);
    }
    if splatting.order != Order::FrontToBack {
        return refused(
            "splatting.order",
            "\"back-to-front\" with first hits".to_owned(),
            "\"front-to-back\"".to_owned(),
        );
    }
    let limits = device.limits();
    let actual = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
    let required = 4 * u64::from(width) * u64::from(height);
    if required > actual {
        let (what, limit) = ("the image's first hits", "max_storage_buffer_binding_size");
        return Err(RenderError::Limit { what, limit, required, actual });
    }
    Ok(())
}

/// A depth texture that nobody reads.
fn no_surfaces(device: &Device) -> TextureView {
    let texture = device.create_texture(&wgpu::TextureDescriptor {
        label: Some("sheetsplat.no_surfaces"),
        size: wgpu::Extent3d { width: 1, height: 1, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: TextureFormat::Depth32Float,
        usage: wgpu::TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    });
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}

/// How to draw.
///
/// # Errors
/// If the settings insist on what the device or the other settings do not allow.
fn way(device: &Device, splatting: &Splatting) -> Result<Way, RenderError> {
    let insists = insists_on_tiles(splatting);
    match (splatting.rasterizer, TileRasterizer::obstacle(device, splatting)) {
        (Rasterizer::Quads, _) if insists => Err(RenderError::OutOfRange {
            key: "splatting.rasterizer",
            found: "\"quads\" with splatting.footprint_box = \"parallelogram\", whole_below, beta or resolution"
                .to_owned(),
            allowed: "\"tiles\" or \"auto\" with them".to_owned(),
        }),
        (Rasterizer::Tiles | Rasterizer::Auto, Some(obstacle)) if insists => Err(obstacle),
        _ if splatting.method == Method::CompositeEverySample => Ok(Way::Samples),
        (Rasterizer::Tiles | Rasterizer::Auto, None) => Ok(Way::Tiles),
        _ => Ok(Way::Quads),
    }
}

/// Whether quads will not do.
fn insists_on_tiles(splatting: &Splatting) -> bool {
    splatting.rasterizer == Rasterizer::Tiles
        || splatting.footprint_box == FootprintBox::Parallelogram
        || splatting.economies != Economies::default()
}
