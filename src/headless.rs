//! Rendering without a host: an own device, and images in memory. The only part that creates devices, submits and waits.

use std::time::Instant;

use wgpu::{Adapter, Backends, Device, DeviceType, Instance, InstanceDescriptor, Queue, TextureFormat};

use crate::error::{Error, RenderError};
use crate::gpu::device::{DeviceError, DeviceRequirements};
use crate::gpu::readback;
use crate::image::Image;
use crate::renderer::{ClassifiedVolume, Renderer, RendererOptions};
use crate::scene::Scene;
use crate::stats::Stats;
use crate::volume::Volume;

/// How to choose and open a device.
#[derive(Clone, Debug, Default)]
pub struct HeadlessOptions {
    /// Part of the adapter's name, in any case; `None` prefers a GPU to a software driver.
    pub adapter: Option<String>,
    /// Features and limits to request; `None` takes what [`DeviceRequirements::for_adapter`] says.
    pub requirements: Option<DeviceRequirements>,
    /// Format of the sheet buffer; see [`RendererOptions`].
    pub sheet_format: Option<TextureFormat>,
}

/// A device of its own and a renderer on it.
#[derive(Debug)]
pub struct Headless {
    adapter: Adapter,
    device: Device,
    queue: Queue,
    renderer: Renderer,
}

/// An image and what it cost.
#[derive(Clone, Debug, PartialEq)]
pub struct Rendering {
    /// The image, over the scene's background.
    pub image: Image,
    /// Counts and times.
    pub stats: Stats,
}

impl Headless {
    /// Opens a device and compiles the renderer.
    ///
    /// # Errors
    /// If there is no such adapter, it gives no device, or the device cannot run the renderer.
    pub fn new(options: &HeadlessOptions) -> Result<Self, DeviceError> {
        let adapter = choose_adapter(options.adapter.as_deref())?;
        let requirements = options.requirements.clone().unwrap_or_else(|| DeviceRequirements::for_adapter(&adapter));
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("sheetsplat"),
            required_features: requirements.features,
            required_limits: requirements.limits,
            ..wgpu::DeviceDescriptor::default()
        }))
        .map_err(|source| DeviceError::RequestDevice { adapter: adapter.get_info().name, source })?;
        let renderer_options = RendererOptions { sheet_format: options.sheet_format, ..RendererOptions::default() };
        let renderer = Renderer::new(&device, &renderer_options)?;
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
    /// If the volume cannot be loaded, the scene asks for what the device or the renderer cannot do, or the device fails.
    pub fn render(&self, scene: &Scene) -> Result<Rendering, Error> {
        let start = Instant::now();
        let volume = scene.load_volume()?;
        let load_ms = milliseconds_since(start);
        let mut rendering = self.render_volume(&volume, scene)?;
        rendering.stats.load_ms = load_ms;
        Ok(rendering)
    }

    /// Renders a volume that is already in memory. The scene's own volume is not looked at.
    ///
    /// # Errors
    /// If the scene asks for what the device or the renderer cannot do, or the device fails.
    pub fn render_volume(&self, volume: &Volume, scene: &Scene) -> Result<Rendering, RenderError> {
        let scopes = [wgpu::ErrorFilter::Validation, wgpu::ErrorFilter::OutOfMemory, wgpu::ErrorFilter::Internal]
            .map(|filter| self.device.push_error_scope(filter));
        let rendering = self.render_unscoped(volume, scene);
        // Scopes are a stack: the last pushed is the first popped. All must be popped even after an error.
        let errors = scopes.into_iter().rev().filter_map(|scope| pollster::block_on(scope.pop())).collect::<Vec<_>>();
        match errors.into_iter().next() {
            Some(error) => Err(RenderError::Device(error.to_string())),
            None => rendering,
        }
    }

    fn render_unscoped(&self, volume: &Volume, scene: &Scene) -> Result<Rendering, RenderError> {
        let start = Instant::now();
        let transfer = scene.transfer.resolve(volume);
        let classified = ClassifiedVolume::new(&self.device, volume, &transfer);
        let frame = self.renderer.prepare(&self.device, &self.queue, &classified, scene)?;
        let prepare_ms = milliseconds_since(start);

        let start = Instant::now();
        let (width, height) = (scene.image.width, scene.image.height);
        let target = self.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("sheetsplat.target"),
            size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: TextureFormat::Rgba32Float,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        let view = target.create_view(&wgpu::TextureViewDescriptor::default());
        let mut encoder =
            self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("sheetsplat.frame") });
        self.renderer.record(&mut encoder, &frame, &view);
        self.queue.submit([encoder.finish()]);
        let bytes = readback::texture(&self.device, &self.queue, &target)?;
        let frame_ms = milliseconds_since(start);

        let info = self.adapter.get_info();
        Ok(Rendering {
            image: Image { width, height, pixels: bytemuck::pod_collect_to_vec(&bytes) },
            stats: Stats {
                adapter: info.name,
                driver: [info.driver, info.driver_info].join(" ").trim().to_owned(),
                backend: info.backend.to_str().to_owned(),
                width,
                height,
                counts: frame.counts,
                gpu_bytes: frame.gpu_bytes + target.width() as u64 * u64::from(height) * 16,
                load_ms: 0.0,
                prepare_ms,
                frame_ms,
            },
        })
    }
}

impl Drop for Headless {
    fn drop(&mut self) {
        // A software driver's threads must not outlive the process's memory.
        let _ = self.device.poll(wgpu::PollType::wait_indefinitely());
    }
}

/// The adapter with `name` in its name, or the most capable one: a GPU before a software driver.
fn choose_adapter(name: Option<&str>) -> Result<Adapter, DeviceError> {
    let mut descriptor = InstanceDescriptor::new_without_display_handle_from_env();
    descriptor.backends &= Backends::PRIMARY;
    let instance = Instance::new(descriptor);
    let adapters = pollster::block_on(instance.enumerate_adapters(Backends::PRIMARY));
    let names: Vec<String> = adapters.iter().map(|adapter| adapter.get_info().name).collect();
    let wanted = |adapter: &Adapter| {
        name.is_none_or(|name| adapter.get_info().name.to_lowercase().contains(&name.to_lowercase()))
    };
    let rank = |adapter: &Adapter| match adapter.get_info().device_type {
        DeviceType::DiscreteGpu => 0,
        DeviceType::IntegratedGpu => 1,
        DeviceType::VirtualGpu => 2,
        DeviceType::Cpu => 3,
        DeviceType::Other => 4,
    };
    adapters.into_iter().filter(wanted).min_by_key(rank).ok_or_else(|| DeviceError::NoAdapter {
        required: name.map_or("any Vulkan, Metal or DirectX 12 adapter".to_owned(), |name| format!("\"{name}\"")),
        actual: if names.is_empty() { "none".to_owned() } else { names.join(", ") },
    })
}

fn milliseconds_since(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}
