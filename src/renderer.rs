//! The renderer a host embeds: it owns pipelines, never a device, and neither submits nor waits.

use std::sync::OnceLock;

use wgpu::{BufferUsages, CommandEncoder, Device, Queue, TextureFormat, TextureView};

use crate::error::RenderError;
use crate::gpu::device::{self, DeviceError};
use crate::gpu::layout::{Frame, Tally};
use crate::gpu::targets::CompositingBuffer;
use crate::gpu::timer::{PASS_BYTES, Timer};
use crate::gpu::uniforms::{self, Ramps};
use crate::kernel::Kernel;
use crate::pass::composite::{CutBuffers, RayMode};
use crate::pass::first_hit::FirstHit;
use crate::pass::resolve::Resolve;
use crate::prepared_frame::{Drawing, FirstHits, PreparedFrame, Staging};
use crate::rasterizer::quads::QuadRasterizer;
use crate::rasterizer::samples::SampleRasterizer;
use crate::rasterizer::tiles::TileRasterizer;
use crate::rasterizer::{Given, filled};
use crate::scene_view::{Prepared, SceneView};
use crate::splatting::{Compositing, Economies, FootprintBox, Method, Order, Rasterizer, Splatting};
use crate::view::View;

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
    /// If a limit of the device is too small or it cannot blend the sheet format asked for.
    pub fn new(device: &Device, options: &RendererOptions) -> Result<Self, DeviceError> {
        device::check(device)?;
        let sheet_format = device::sheet_format(device, options.sheet_format)?;
        let sheets = options.sheets_per_group.unwrap_or(device::sheets_per_group(device, sheet_format));
        Ok(Self {
            sheet_format,
            sheets,
            profile: options.profile,
            quads: OnceLock::new(),
            samples: OnceLock::new(),
            tiles: TileRasterizer::default(),
            resolve: Resolve::new(device, options.target_format),
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
    /// If the scene asks for something not implemented, or for more than the device's limits allow.
    pub fn prepare(&self, device: &Device, queue: &Queue, view: &mut SceneView) -> Result<Prepared, RenderError> {
        let SceneView { volume, scene, surfaces, first_hit, frame } = view;
        let splatting = &scene.splatting;
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
                let PreparedFrame { compositing, uniform, control_points, cut, drawing, totals, view, .. } = old;
                let totals = totals.filter(|_| view == seen);
                (Some(compositing), Some(uniform), Some(control_points), Some(cut), Some(drawing), totals)
            });
        let Some(compositing) = compositing.or(old_compositing) else { unreachable!("made where there was none") };
        let ramps = Ramps::new(volume.transfer());
        let filled = |old, label, bytes: &[u8], usage| filled(device, queue, old, label, bytes, usage);
        let points = bytemuck::cast_slice(&ramps.points);
        let control_points = filled(control_points, "sheetsplat.control_points", points, BufferUsages::STORAGE);
        let frame_uniform = uniforms::frame(&seen, &kernel, volume.grid(), &ramps, scene);
        let bytes = bytemuck::bytes_of(&frame_uniform);
        let uniform = filled(uniform, "sheetsplat.frame", bytes, BufferUsages::UNIFORM);
        let cut_uniform = uniforms::cut(&seen, &grid, &scene.clip, depths, *first_hit);
        let cut = filled(cut, "sheetsplat.cut", bytemuck::bytes_of(&cut_uniform), BufferUsages::UNIFORM);
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
        let period = queue.get_timestamp_period();
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let hit_bytes = first_hits.as_ref().map_or(0, |_| 4 * pixels);
        let shared_bytes = compositing.gpu_bytes() + uniform.size() + control_points.size() + cut.size() + hit_bytes;
        *frame = Some(PreparedFrame {
            gpu_bytes: volume.gpu_bytes() + drawing.gpu_bytes() + shared_bytes,
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
            staging: Some(Staging { buffer: staging, timestamps, stages: Vec::new(), period }),
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
        let (frame, prepared) = self.quads(given.device).prepare(given, old_quads);
        Ok((Drawing::Quads(Box::new(frame)), prepared))
    }

    fn samples(&self, device: &Device) -> &SampleRasterizer {
        self.samples.get_or_init(|| SampleRasterizer::new(device, self.sheet_format))
    }

    fn quads(&self, device: &Device) -> &QuadRasterizer {
        self.quads.get_or_init(|| QuadRasterizer::new(device, self.sheet_format, self.sheets))
    }

    /// Records the view's prepared frame; nothing, if there is none. The target must have the renderer's target format and the
    /// scene's image size.
    pub fn record(&self, encoder: &mut CommandEncoder, view: &mut SceneView, target: &TextureView) {
        let Some(frame) = &mut view.frame else { return };
        let PreparedFrame { drawing, compositing, timer, .. } = frame;
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
        let bands = compositing.bands.iter().map(|band| band.band);
        let times = timer.as_mut().map(|timer| timer.render("resolve"));
        self.resolve.record(encoder, times, target, compositing.size[0], frame.resolve_groups.iter().zip(bands));

        if let Some(staging) = &mut frame.staging {
            drawing.copy_counts(encoder, &staging.buffer);
            if let Some(timer) = timer {
                staging.stages = timer.finish(encoder, &staging.buffer, staging.timestamps);
            }
        }
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
