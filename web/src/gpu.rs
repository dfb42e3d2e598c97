//! The browser's WebGPU: a device of our own that draws onto a worker's canvas.

use std::sync::Arc;

use js_sys::{Map, Promise, Uint8ClampedArray};
use sheetsplat::headless::Backend;
use sheetsplat::{
    Blend, DeviceRequirements, GpuVolume, Pick, Placement, Renderer, RendererOptions, Scene, SceneView, Stats, Volume,
};
use wasm_bindgen::prelude::wasm_bindgen;
use wasm_bindgen::{JsCast, JsValue};
use wasm_bindgen_futures::JsFuture;
use wgpu::{
    CommandEncoderDescriptor, CompositeAlphaMode, CurrentSurfaceTexture, Device, DeviceDescriptor, ErrorFilter,
    Instance, InstanceDescriptor, PresentMode, Queue, RequestAdapterOptions, Surface, SurfaceConfiguration,
    SurfaceTarget, TextureFormat, TextureUsages, TextureViewDescriptor,
};

use crate::session::{Session, plain};
use crate::{PICKED, error, nothing};

/// The format of the canvas. Like sheetsplat's, its colours are display-referred.
const FORMAT: TextureFormat = TextureFormat::Rgba8Unorm;

/// A device, the canvas, and a view of a volume.
pub(crate) struct Gpu {
    instance: Instance,
    surface: Surface<'static>,
    device: Device,
    queue: Queue,
    renderer: Renderer,
    adapter: String,
    view: Option<SceneView>,
    /// The canvas's size and whether it shows the page behind it, as configured.
    configured: Option<([u32; 2], bool)>,
}

impl Gpu {
    /// Opens a device, compiles what every frame needs, and prepares the canvas.
    pub(crate) async fn open(canvas: web_sys::OffscreenCanvas) -> Result<Self, JsValue> {
        let instance = Instance::new(InstanceDescriptor::new_without_display_handle());
        let (device, queue, renderer, adapter) = open_device(&instance).await?;
        // A canvas with a context for WebGPU cannot get one for the CPU's pictures, so this comes last.
        let surface = instance.create_surface(SurfaceTarget::OffscreenCanvas(canvas)).map_err(error)?;
        Ok(Self { instance, surface, device, queue, renderer, adapter, view: None, configured: None })
    }

    /// Opens another device, which has no volume yet. After an error the old one stays.
    async fn reopen(&mut self) -> Result<(), JsValue> {
        (self.device, self.queue, self.renderer, self.adapter) = open_device(&self.instance).await?;
        (self.view, self.configured) = (None, None);
        Ok(())
    }

    /// Shows a volume; one that is shown already is not uploaded again.
    pub(crate) async fn set_volume(&mut self, volume: &Arc<Volume>, scene: &Scene) -> Result<(), JsValue> {
        let Self { device, queue, view, .. } = self;
        let shown = view.as_ref().map(|view| view.volume().gpu_volume().clone());
        let shown = shown.filter(|shown| Arc::ptr_eq(shown.volume(), volume));
        *view = Some(
            scoped(device, async || {
                let volume = match shown {
                    Some(volume) => volume,
                    None => GpuVolume::new(device, queue, Arc::clone(volume)).map_err(error)?,
                };
                SceneView::new(device, &volume, scene).map_err(error)
            })
            .await?,
        );
        Ok(())
    }

    /// Draws a scene of the volume onto the canvas, and waits for it.
    pub(crate) async fn present(&mut self, scene: &Scene) -> Result<Stats, JsValue> {
        let start = now();
        let size = [scene.image.width, scene.image.height];
        self.configure(size, scene.image.background[3] < 1.0);
        self.prepare(scene, None)?;
        let Self { device, queue, surface, renderer, view, .. } = self;
        let view = view.as_mut().ok_or_else(nothing)?;
        let prepared = now();
        scoped(device, async || {
            let texture = match surface.get_current_texture() {
                CurrentSurfaceTexture::Success(texture) | CurrentSurfaceTexture::Suboptimal(texture) => texture,
                other => return Err(error(format!("the canvas has no texture: {other:?}"))),
            };
            let target = texture.texture.create_view(&TextureViewDescriptor::default());
            let mut encoder =
                device.create_command_encoder(&CommandEncoderDescriptor { label: Some("sheetsplat.frame") });
            renderer.record(&mut encoder, view);
            renderer.present(&mut encoder, view, &target, Placement::whole(size)).map_err(error)?;
            queue.submit([encoder.finish()]);
            queue.present(texture);
            Ok(())
        })
        .await?;
        let pending = view.counts();
        let mut stats = Stats::default();
        if let Some(pending) = pending {
            stats.counts = arrival(|| pending.try_get()).await?.map_err(error)?.0;
        }
        let backend = Backend::Gpu.name();
        (stats.adapter, stats.backend, stats.api) = (self.adapter.clone(), backend.to_owned(), "webgpu".to_owned());
        stats.rasterizer = view.rasterizer().unwrap_or_default().to_owned();
        (stats.width, stats.height, stats.gpu_bytes) = (size[0], size[1], view.gpu_bytes());
        (stats.prepare_ms, stats.frame_ms) = (prepared - start, now() - prepared);
        Ok(stats)
    }

    /// Draws a scene of the volume into memory: premultiplied bytes, row by row.
    pub(crate) async fn capture(&mut self, scene: &Scene) -> Result<Vec<u8>, JsValue> {
        let size = [scene.image.width, scene.image.height];
        self.prepare(scene, None)?;
        let Self { device, queue, renderer, view, .. } = self;
        let view = view.as_mut().ok_or_else(nothing)?;
        let row = (4 * size[0]).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let buffer = scoped(device, async || {
            let extent = wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 };
            let texture = device.create_texture(&wgpu::TextureDescriptor {
                label: Some("sheetsplat.capture"),
                size: extent,
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: FORMAT,
                usage: TextureUsages::RENDER_ATTACHMENT | TextureUsages::COPY_SRC,
                view_formats: &[],
            });
            let buffer = device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("sheetsplat.capture"),
                size: u64::from(row) * u64::from(size[1]),
                usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
                mapped_at_creation: false,
            });
            let descriptor = CommandEncoderDescriptor { label: Some("sheetsplat.capture") };
            let mut encoder = device.create_command_encoder(&descriptor);
            renderer.record(&mut encoder, view);
            let target = texture.create_view(&TextureViewDescriptor::default());
            renderer.present(&mut encoder, view, &target, Placement::whole(size)).map_err(error)?;
            let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None };
            let into = wgpu::TexelCopyBufferInfo { buffer: &buffer, layout };
            encoder.copy_texture_to_buffer(texture.as_image_copy(), into, extent);
            queue.submit([encoder.finish()]);
            Ok(buffer)
        })
        .await?;
        let (sender, arrived) = std::sync::mpsc::channel();
        buffer.map_async(wgpu::MapMode::Read, .., move |result| {
            // The receiver may have been dropped.
            let _ = sender.send(result);
        });
        arrival(|| arrived.try_recv().ok()).await?.map_err(error)?;
        let bytes = buffer.get_mapped_range(..).map_err(error)?;
        Ok(bytes.chunks(row as usize).flat_map(|line| &line[..4 * size[0] as usize]).copied().collect())
    }

    /// The first hit of a scene of the volume at a pixel.
    pub(crate) async fn pick(&mut self, scene: &Scene, pixel: [u32; 2]) -> Result<Option<Pick>, JsValue> {
        self.prepare(scene, Some(PICKED))?;
        let Self { device, queue, renderer, view, .. } = self;
        let view = view.as_mut().ok_or_else(nothing)?;
        let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor { label: Some("sheetsplat.pick") });
        renderer.record(&mut encoder, view);
        let pending = view.pick(device, &mut encoder, pixel);
        queue.submit([encoder.finish()]);
        let Some(mut pending) = pending else {
            let [width, height] = [scene.image.width, scene.image.height];
            return Err(error(format!("pick: found {pixel:?}, allowed: a pixel of {width}×{height}")));
        };
        arrival(|| pending.try_get()).await?.map_err(error)
    }

    fn prepare(&mut self, scene: &Scene, first_hit: Option<f64>) -> Result<(), JsValue> {
        let view = self.view.as_mut().ok_or_else(nothing)?;
        view.set_camera(scene.camera).map_err(error)?;
        view.set_image(scene.image).map_err(error)?;
        view.set_first_hit(first_hit).map_err(error)?;
        self.renderer.prepare(&self.device, &self.queue, view).map(drop).map_err(error)
    }

    fn configure(&mut self, size: [u32; 2], is_transparent: bool) {
        if self.configured == Some((size, is_transparent)) {
            return;
        }
        let alpha_mode = if is_transparent { CompositeAlphaMode::PreMultiplied } else { CompositeAlphaMode::Opaque };
        self.surface.configure(
            &self.device,
            &SurfaceConfiguration {
                usage: TextureUsages::RENDER_ATTACHMENT,
                format: FORMAT,
                width: size[0],
                height: size[1],
                present_mode: PresentMode::Fifo,
                desired_maximum_frame_latency: 2,
                alpha_mode,
                view_formats: Vec::new(),
                color_space: Default::default(),
            },
        );
        self.configured = Some((size, is_transparent));
    }
}

#[wasm_bindgen]
impl Session {
    /// Opens the browser's GPU for a canvas, without a volume; `all_around` as for the CPU. The promise is rejected where it cannot run the renderer.
    pub async fn open(all_around: bool, canvas: web_sys::OffscreenCanvas) -> Result<Self, JsValue> {
        Ok(Self::with(all_around, Gpu::open(canvas).await?))
    }

    /// Draws onto the canvas, and returns the statistics.
    pub async fn present(&mut self) -> Result<JsValue, JsValue> {
        let drawn = self.drawn()?;
        plain(&self.drawer.present(&drawn).await?)
    }

    /// Draws into memory: bytes with straight alpha.
    pub async fn capture(&mut self) -> Result<Uint8ClampedArray, JsValue> {
        let drawn = self.drawn()?;
        let mut bytes = self.drawer.capture(&drawn).await?;
        for pixel in bytes.chunks_exact_mut(4) {
            let alpha = u32::from(pixel[3].max(1));
            pixel[..3].iter_mut().for_each(|channel| *channel = (u32::from(*channel) * 255 / alpha).min(255) as u8);
        }
        Ok(Uint8ClampedArray::from(&bytes[..]))
    }

    /// Opens another device in place of a lost one, with the volume, the scene and the camera of before.
    pub async fn reopen(&mut self) -> Result<(), JsValue> {
        self.drawer.reopen().await?;
        self.show_again().await
    }

    /// Loses the device, for tests.
    pub fn lose(&self) {
        self.drawer.device.destroy();
    }
}

/// Opens a device whose loss the worker learns, and compiles what every frame needs. The last result is the adapter's name.
async fn open_device(instance: &Instance) -> Result<(Device, Queue, Renderer, String), JsValue> {
    let adapter = instance.request_adapter(&RequestAdapterOptions::default()).await.map_err(error)?;
    let mut descriptor = DeviceDescriptor { label: Some("sheetsplat"), ..DeviceDescriptor::default() };
    DeviceRequirements::for_adapter(&adapter).merge_into(&mut descriptor);
    let (device, queue) = adapter.request_device(&descriptor).await.map_err(error)?;
    device.set_device_lost_callback(|_, message| {
        let lost = js_sys::Reflect::get(&js_sys::global(), &"sheetsplatLost".into());
        if let Ok(Ok(lost)) = lost.map(JsCast::dyn_into::<js_sys::Function>) {
            let _ = lost.call1(&JsValue::NULL, &message.into());
        }
    });
    let options = RendererOptions::for_target(FORMAT).with_blend(Blend::Replace);
    let renderer = scoped(&device, async || Renderer::new(&device, &queue, &options).map_err(error)).await?;
    Ok((device, queue, renderer, adapter.get_info().name))
}

/// Every shader's stage and WGSL, for tests that compile them in a browser.
#[wasm_bindgen]
pub fn shaders() -> Map {
    let all = Map::new();
    for shader in sheetsplat::internals::gpu::shaders::ALL {
        all.set(&shader.stage.into(), &shader.source().into());
    }
    all
}

/// Does some work with a device, and waits for the errors that it reports, which in a browser arrive later.
async fn scoped<T>(device: &Device, work: impl AsyncFnOnce() -> Result<T, JsValue>) -> Result<T, JsValue> {
    let scopes = [ErrorFilter::Validation, ErrorFilter::Internal, ErrorFilter::OutOfMemory]
        .map(|filter| device.push_error_scope(filter));
    let result = work().await;
    let mut reported = None;
    for scope in scopes.into_iter().rev() {
        let found = scope.pop().await;
        reported = reported.or(found);
    }
    match reported {
        Some(fault) => Err(error(sheetsplat::DeviceFault::from(fault))),
        None => result,
    }
}

/// Waits for what arrives from the GPU.
async fn arrival<T>(mut try_get: impl FnMut() -> Option<T>) -> Result<T, JsValue> {
    /// Milliseconds, after which the device is lost.
    const PATIENCE: f64 = 120_000.0;
    let start = now();
    loop {
        if let Some(arrived) = try_get() {
            return Ok(arrived);
        }
        if now() - start > PATIENCE {
            return Err(error("the GPU does not answer"));
        }
        pause().await?;
    }
}

/// Lets the browser work.
async fn pause() -> Result<(), JsValue> {
    let set_timeout = js_sys::Reflect::get(&js_sys::global(), &"setTimeout".into())?;
    let set_timeout: js_sys::Function = set_timeout.dyn_into()?;
    let promise = Promise::new(&mut |resolve, _| {
        let _ = set_timeout.call2(&JsValue::NULL, &resolve, &1.into());
    });
    JsFuture::from(promise).await.map(drop)
}

/// Milliseconds.
fn now() -> f64 {
    js_sys::Date::now()
}
