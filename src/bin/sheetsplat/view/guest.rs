//! The renderer as a guest on the window's device. The rest of the viewer does not use the renderer.

use std::sync::Arc;
use std::time::Instant;

use eframe::egui::TextureId;
use eframe::egui_wgpu::{self, RenderState, WgpuConfiguration, WgpuSetup, WgpuSetupCreateNew};
use sheetsplat::RenderError;
use sheetsplat::headless::{Backend, device};
use sheetsplat::scoped;
use sheetsplat::settings::{Classification, TransferFunction};
use sheetsplat::stats::Stats;
use sheetsplat::volume::{Channels, Grid, Volume};
use sheetsplat::{Blend, DeviceRequirements, GpuVolume, Placement, Renderer, RendererOptions, Scene, SceneView, wgpu};

use crate::failure::Failure;

/// The format of textures that the window shows. Like sheetsplat's, its colours are display-referred.
const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;

/// A view of a volume, drawn into a texture that the window shows.
pub(super) struct Guest {
    host: RenderState,
    renderer: Renderer,
    view: SceneView,
    picture: Option<Picture>,
    stats: Stats,
}

/// The last drawn picture.
struct Picture {
    texture: wgpu::Texture,
    id: TextureId,
}

/// How the window opens its device: the adapter with `name` in its name, with what the renderer needs and can use.
pub(super) fn device_options(name: Option<String>) -> WgpuConfiguration {
    let choose = move |adapters: &[wgpu::Adapter], surface: Option<&wgpu::Surface<'_>>| {
        let shows = |adapter: &&wgpu::Adapter| surface.is_none_or(|surface| adapter.is_surface_supported(surface));
        let adapters: Vec<wgpu::Adapter> = adapters.iter().filter(shows).cloned().collect();
        device::choose_adapter(&adapters, name.as_deref()).map_err(|error| error.to_string())
    };
    let describe = |adapter: &wgpu::Adapter| {
        let mut descriptor = wgpu::DeviceDescriptor { label: Some("sheetsplat"), ..wgpu::DeviceDescriptor::default() };
        DeviceRequirements::for_adapter(adapter).merge_into(&mut descriptor);
        descriptor
    };
    let setup = WgpuSetupCreateNew {
        instance_descriptor: device::instance_descriptor(),
        native_adapter_selector: Some(Arc::new(choose)),
        device_descriptor: Arc::new(describe),
        ..WgpuSetupCreateNew::without_display_handle()
    };
    WgpuConfiguration { wgpu_setup: WgpuSetup::CreateNew(setup), ..egui_wgpu::WgpuConfiguration::default() }
}

impl Guest {
    /// Uploads the volume to the window's device.
    pub(super) fn new(host: &RenderState, volume: Volume, scene: &Scene, input: &str) -> Result<Self, Failure> {
        let RenderState { adapter, device, queue, .. } = host;
        let info = adapter.get_info();
        let options = RendererOptions::for_target(FORMAT).with_blend(Blend::Replace);
        let renderer = Renderer::new(device, queue, &options).map_err(|error| Failure::Other(error.to_string()))?;
        let volume = GpuVolume::new(device, queue, volume);
        let view = volume.and_then(|volume| SceneView::new(device, &volume, scene));
        let view = view.map_err(|error| Failure::of(error.into(), input))?;
        let mut stats = Stats::default();
        (stats.backend, stats.api) = (Backend::Gpu.name().to_owned(), info.backend.to_str().to_owned());
        stats.adapter = info.name;
        Ok(Self { host: host.clone(), renderer, view, picture: None, stats })
    }

    /// The volume.
    pub(super) fn volume(&self) -> &Volume {
        self.view.volume().volume()
    }

    /// The volume's grid.
    pub(super) fn grid(&self) -> &Grid {
        self.view.volume().grid()
    }

    /// The transfer functions of the channels.
    pub(super) fn transfer(&self) -> &Channels<TransferFunction> {
        self.view.volume().transfer()
    }

    /// Whether values are classified before or after splatting.
    pub(super) fn classification(&self) -> Classification {
        self.view.scene().splatting.classification
    }

    /// The last frame's statistics.
    pub(super) fn stats(&self) -> &Stats {
        &self.stats
    }

    /// The last frame's texture.
    pub(super) fn texture(&self) -> Option<TextureId> {
        self.picture.as_ref().map(|picture| picture.id)
    }

    /// Draws a frame and waits for it, if it differs from the last requested one. Returns whether it did.
    pub(super) fn show(&mut self, scene: &Scene, transfer: &Channels<TransferFunction>) -> Result<bool, RenderError> {
        let is_shown = self.stats.width > 0 && scene == self.view.scene() && transfer == self.transfer();
        if is_shown {
            return Ok(false);
        }
        (self.stats.width, self.stats.height) = (scene.image.width, scene.image.height);
        let device = self.host.device.clone();
        scoped(&device, || self.draw(scene, transfer))?.map(|()| true)
    }

    fn draw(&mut self, scene: &Scene, transfer: &Channels<TransferFunction>) -> Result<(), RenderError> {
        let start = Instant::now();
        let Self { view, renderer, .. } = self;
        let RenderState { device, queue, .. } = &self.host;
        if transfer != view.volume().transfer() {
            view.set_transfer_function(transfer.clone())?;
        }
        view.set_camera(scene.camera)?;
        view.set_image(scene.image)?;
        view.set_shading(scene.shading)?;
        view.set_splatting(scene.splatting)?;
        renderer.prepare(device, queue, view)?;
        self.stats.prepare_ms = start.elapsed().as_secs_f64() * 1e3;

        let start = Instant::now();
        let target = self.target([scene.image.width, scene.image.height]);
        let Self { view, renderer, host: RenderState { device, queue, .. }, .. } = self;
        let mut encoder =
            device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("sheetsplat.frame") });
        renderer.record(&mut encoder, view);
        let at = Placement::whole([scene.image.width, scene.image.height]);
        renderer.present(&mut encoder, view, &target, at)?;
        queue.submit([encoder.finish()]);
        let counts = view.counts();
        device.poll(wgpu::PollType::wait_indefinitely()).map_err(|error| RenderError::Readback(error.to_string()))?;
        if let Some(counts) = counts.and_then(|counts| counts.try_get()) {
            self.stats.counts = counts?.0;
        }
        self.stats.rasterizer = view.rasterizer().unwrap_or_default().to_owned();
        self.stats.gpu_bytes = view.gpu_bytes();
        self.stats.frame_ms = start.elapsed().as_secs_f64() * 1e3;
        Ok(())
    }

    /// The picture's texture, which is replaced if the size changes.
    fn target(&mut self, [width, height]: [u32; 2]) -> wgpu::TextureView {
        let size = wgpu::Extent3d { width, height, depth_or_array_layers: 1 };
        if let Some(Picture { texture, .. }) = &self.picture
            && texture.size() == size
        {
            return texture.create_view(&wgpu::TextureViewDescriptor::default());
        }
        let RenderState { device, renderer, .. } = &self.host;
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("sheetsplat.picture"),
            size,
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: FORMAT,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        });
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        let filter = wgpu::FilterMode::Linear;
        let mut painter = renderer.write();
        let id = match &self.picture {
            Some(Picture { id, .. }) => {
                painter.update_egui_texture_from_wgpu_texture(device, &view, filter, *id);
                *id
            }
            None => painter.register_native_texture(device, &view, filter),
        };
        drop(painter);
        self.picture = Some(Picture { texture, id });
        view
    }
}
