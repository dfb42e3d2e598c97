//! Rendering on a GPU without a host. Only this module creates devices, submits and waits.

use std::sync::Arc;

use web_time::Instant;
use wgpu::{Adapter, Device, Queue, TextureFormat};

use super::device::{self, driver_name};
use super::given_light::GivenLight;
use super::readback::{self, wait};
use super::timed::{load_and_render, milliseconds_since, view_and_draw};
use super::{Backend, Error, HeadlessOptions, Rendering, content};
use crate::error::RenderError;
use crate::error::setting::SettingError;
use crate::gpu::counts::PendingCounts;
use crate::gpu::device::{DeviceError, DeviceRequirements};
use crate::gpu::fault::scoped;
use crate::gpu::gpu_volume::GpuVolume;
use crate::gpu::hiding::{ClosedPixels, Hiding};
use crate::gpu::options::{Blend, RendererOptions};
use crate::gpu::placement::Placement;
use crate::image::Image;
use crate::part::{self, Content, Part};
use crate::pick::Pick;
use crate::renderer::Renderer;
use crate::renderer::scene_view::SceneView;
use crate::scene::{ImageSettings, Scene};
use crate::settings::splatting::Splatting;
use crate::settings::window::Window;
use crate::stats::Stats;
use crate::volume::Volume;

/// The target's format.
pub(super) const FORMAT: TextureFormat = TextureFormat::Rgba32Float;

/// Owns a wgpu device and a renderer on it. Unlike [`Headless`](super::Headless) it gives access to the device and to every setter of a
/// [`SceneView`].
#[derive(Debug)]
pub struct GpuHeadless {
    adapter: Adapter,
    device: Device,
    queue: Queue,
    renderer: Renderer,
}

impl GpuHeadless {
    /// Opens a device and compiles the renderer, whatever backend the options name.
    ///
    /// # Errors
    /// If there is no such adapter, it cannot open a device, or the device cannot run the renderer.
    pub fn new(options: &HeadlessOptions) -> Result<Self, DeviceError> {
        let adapter = device::choose_adapter(&device::adapters(), options.adapter.as_deref())?;
        let requirements = options.requirements.clone().unwrap_or_else(|| DeviceRequirements::for_adapter(&adapter));
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("sheetsplat"),
            required_features: requirements.features,
            required_limits: requirements.limits,
            ..wgpu::DeviceDescriptor::default()
        }))
        .map_err(|source| DeviceError::RequestDevice { adapter: adapter.get_info().name, source })?;
        let renderer_options = RendererOptions {
            sheet_format: options.sheet_format,
            sheets_per_group: options.sheets_per_group,
            rasterizer: options.rasterizer,
            profile: options.profile,
            blend: Blend::Replace,
            ..RendererOptions::for_target(FORMAT)
        };
        let renderer = Renderer::new(&device, &queue, &renderer_options)?;
        Ok(Self { adapter, device, queue, renderer })
    }

    /// The device.
    pub fn device(&self) -> &Device {
        &self.device
    }

    /// The device's queue.
    pub fn queue(&self) -> &Queue {
        &self.queue
    }

    /// The renderer; its target format is `Rgba32Float`.
    pub fn renderer(&self) -> &Renderer {
        &self.renderer
    }

    /// Loads the scene's volume and renders it.
    ///
    /// # Errors
    /// If the volume cannot be loaded, the scene needs more than the device or the renderer can do, or the device fails.
    pub fn render(&self, scene: &Scene) -> Result<Rendering, Error> {
        load_and_render(scene, Scene::load_volume, |volume| self.render_volume(volume, scene))
    }

    /// Renders a volume that is already in memory. The scene's own volume is ignored.
    ///
    /// # Errors
    /// If the scene needs more than the device or the renderer can do, or the device fails.
    pub fn render_volume(&self, volume: impl Into<Arc<Volume>>, scene: &Scene) -> Result<Rendering, RenderError> {
        view_and_draw(|| self.view(volume, scene), |view| self.draw(view))
    }

    /// A view of a volume with a scene's settings, for any number of frames and changes. The scene's own volume is ignored.
    ///
    /// # Errors
    /// If the volume is larger than the device's textures, or the device fails.
    pub fn view(&self, volume: impl Into<Arc<Volume>>, scene: &Scene) -> Result<SceneView, RenderError> {
        // Without a submission wgpu would keep its copies of the volume until the first frame.
        let submit = || {
            self.queue.submit([]);
        };
        let volume = GpuVolume::new_in_chunks(&self.device, &self.queue, volume, &submit)?;
        SceneView::new(&self.device, &volume, scene)
    }

    /// Draws one frame of a view and reads it back.
    ///
    /// # Errors
    /// If the view needs more than the device or the renderer can do, or the device fails.
    pub fn draw(&self, view: &mut SceneView) -> Result<Rendering, RenderError> {
        scoped(&self.device, || self.draw_unscoped(view))?
    }

    /// Draws a part of a view's image (SPEC §11), without first hits, and returns it with its statistics.
    ///
    /// # Errors
    /// As for [`Self::draw`], if the scene has no parts, a host has set surfaces, or the window does not lie in the image.
    pub fn draw_part(&self, view: &mut SceneView, window: &Window) -> Result<(Part, Stats), RenderError> {
        part::check_sheets(view.volume.volume(), &view.scene)?;
        part::check(view.volume.volume(), &view.scene, window)?;
        if view.hiding.is_some() {
            return Err(SettingError::new("surfaces", "a host's surfaces for a part of an image", "none").into());
        }
        let (content, stats) = self.draw_content(view, window)?;
        let of = (&view.volume.volume().clone().into(), &view.scene);
        let frame = view.frame.as_ref().ok_or_else(no_frame)?;
        Ok((Part::new(of, &frame.view, window, content)?, stats))
    }

    /// Draws a window of a box of voxels to those pixels, row by row, that are not closed.
    ///
    /// # Errors
    /// As for [`Self::view`] and [`Self::draw`].
    pub(super) fn draw_box(
        &self,
        volume: Volume,
        scene: &Scene,
        (window, closed): (&Window, Option<&[bool]>),
        light: Option<&GivenLight>,
    ) -> Result<(Content, Stats), RenderError> {
        self.draw_behind(self.view(volume, scene)?, (window, closed), light)
    }

    fn draw_behind(
        &self,
        mut view: SceneView,
        (window, closed): (&Window, Option<&[bool]>),
        light: Option<&GivenLight>,
    ) -> Result<(Content, Stats), RenderError> {
        let upload = |closed| ClosedPixels::upload(&self.device, &self.queue, &window.region, closed);
        view.hiding = closed.map(upload).map(Hiding::Closed);
        view.light = GivenLight::kept(light);
        view.light_texture = light.and_then(|light| light.texture().take());
        let drawn = self.draw_content(&mut view, window);
        if let Some(light) = light {
            *light.texture() = view.light_texture.take();
        }
        drawn
    }

    /// Draws a window of a volume in pages to those pixels, row by row, that are not closed.
    ///
    /// # Errors
    /// As for [`Self::view`] and [`Self::draw`].
    #[cfg(not(target_arch = "wasm32"))]
    pub(super) fn draw_pages(
        &self,
        volume: &GpuVolume,
        scene: &Scene,
        (window, closed): (&Window, Option<&[bool]>),
        light: Option<&GivenLight>,
    ) -> Result<(Content, Stats), RenderError> {
        self.draw_behind(SceneView::new(&self.device, volume, scene)?, (window, closed), light)
    }

    /// Draws the pixels of a part, without first hits, and returns them with statistics.
    ///
    /// # Errors
    /// As for [`Self::draw`].
    fn draw_content(&self, view: &mut SceneView, window: &Window) -> Result<(Content, Stats), RenderError> {
        let first_hit = view.first_hit.take();
        view.window = Some(window.clone());
        let drawn = scoped(&self.device, || self.draw_content_unscoped(view, window));
        (view.window, view.first_hit) = (None, first_hit);
        drawn?
    }

    fn draw_content_unscoped(&self, view: &mut SceneView, window: &Window) -> Result<(Content, Stats), RenderError> {
        let prepare_ms = self.prepare(view)?;
        let start = Instant::now();
        let mut encoder = self.encoder("sheetsplat.part");
        self.renderer.record(&mut encoder, view);
        self.queue.submit([encoder.finish()]);
        let counts = view.counts();
        let frame = view.frame.as_ref().ok_or_else(no_frame)?;
        let Splatting { compositing, classification, .. } = view.scene.splatting;
        let chosen = compositing.chooses_values(classification).then_some(compositing);
        let content = content::content((&self.device, &self.queue), frame, &window.region, chosen)?;
        let stats = self.stats(view, counts, 0, [prepare_ms, milliseconds_since(start)])?;
        Ok((content, stats))
    }

    /// The first hit at a pixel of the last frame drawn, with pixels counted from the upper left; `None` where the ray does not reach the
    /// opacity of [`SceneView::set_first_hit`].
    ///
    /// # Errors
    /// If the frame has no first hits, the pixel lies outside the image, or the device fails.
    pub fn pick(&self, view: &SceneView, pixel: [u32; 2]) -> Result<Option<Pick>, RenderError> {
        scoped(&self.device, || {
            let mut encoder = self.encoder("sheetsplat.pick");
            let Some(mut pending) = view.pick(&self.device, &mut encoder, pixel) else {
                return Err(Pick::missing(pixel, &view.scene().image).into());
            };
            self.queue.submit([encoder.finish()]);
            pending.request();
            wait(&self.device)?;
            let missing = |_| RenderError::Readback("the pick did not arrive".to_owned());
            let news = pending.request().recv().map_err(missing)?;
            pending.arrived(news)
        })?
    }

    fn draw_unscoped(&self, scene_view: &mut SceneView) -> Result<Rendering, RenderError> {
        let prepare_ms = self.prepare(scene_view)?;
        let start = Instant::now();
        let ImageSettings { width, height, .. } = scene_view.scene().image;
        let target = self.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("sheetsplat.target"),
            size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: FORMAT,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        let view = target.create_view(&wgpu::TextureViewDescriptor::default());
        let mut encoder = self.encoder("sheetsplat.frame");
        self.renderer.record(&mut encoder, scene_view);
        self.renderer.present(&mut encoder, scene_view, &view, Placement::whole([width, height]))?;
        self.queue.submit([encoder.finish()]);
        let counts = scene_view.counts();
        let bytes = readback::texture(&self.device, &self.queue, &target)?;
        let target_bytes = u64::from(width) * u64::from(height) * 16;
        let stats = self.stats(scene_view, counts, target_bytes, [prepare_ms, milliseconds_since(start)])?;
        let image = Image { width, height, pixels: bytemuck::pod_collect_to_vec(&bytes) };
        Ok(Rendering { image, stats })
    }

    /// Prepares a frame, and returns the milliseconds that this took.
    fn prepare(&self, view: &mut SceneView) -> Result<f64, RenderError> {
        let start = Instant::now();
        self.renderer.prepare(&self.device, &self.queue, view)?;
        Ok(milliseconds_since(start))
    }

    fn encoder(&self, label: &str) -> wgpu::CommandEncoder {
        self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some(label) })
    }

    /// The statistics of a frame whose content has arrived, and with it the counts.
    fn stats(
        &self,
        view: &SceneView,
        counts: Option<PendingCounts>,
        target_bytes: u64,
        [prepare_ms, frame_ms]: [f64; 2],
    ) -> Result<Stats, RenderError> {
        let counts = counts.ok_or_else(no_frame)?;
        let missing = |_| RenderError::Readback("the frame's counts did not arrive".to_owned());
        let (counts, stages_ms) = counts.arrived(counts.arrival().recv().map_err(missing)?)?;
        let info = self.adapter.get_info();
        let ImageSettings { width, height, .. } = view.scene().image;
        Ok(view.light.noted_in(Stats {
            driver: driver_name(&info),
            adapter: info.name,
            backend: Backend::Gpu.name().to_owned(),
            api: info.backend.to_str().to_owned(),
            width,
            height,
            counts,
            store: None,
            peak_rss_mib: None,
            rasterizer: view.rasterizer().unwrap_or_default().to_owned(),
            stages_ms,
            gpu_bytes: view.gpu_bytes() + target_bytes,
            load_ms: 0.0,
            prepare_ms,
            frame_ms,
            light_ms: None,
            light_bytes: None,
            light_level: None,
            light_stride: None,
        }))
    }
}

impl Drop for GpuHeadless {
    fn drop(&mut self) {
        // A software driver's threads must end before the process's memory is freed.
        let _ = wait(&self.device);
    }
}

fn no_frame() -> RenderError {
    RenderError::Readback("there is no frame".to_owned())
}
