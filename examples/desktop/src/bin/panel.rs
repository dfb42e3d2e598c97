//! A volume in a panel of egui, with a plane that cuts it. The renderer is a guest on the window's device: it draws into a texture, which egui shows.

use std::error::Error;
use std::path::Path;
use std::sync::Arc;

use eframe::egui::{self, CentralPanel, Color32, Panel, Rect, Sense, Slider, TextureId, Ui, pos2};
use eframe::egui_wgpu::{RenderState, WgpuConfiguration, WgpuSetup, WgpuSetupCreateNew};
use glam::DVec2;
use sheetsplat::settings::{Clip, navigation};
use sheetsplat::{Blend, DeviceRequirements, GpuVolume, Placement, Renderer, RendererOptions, Scene, SceneView, wgpu};

/// The format of egui's own textures.
const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;

/// Degrees that the camera turns for a drag over the panel's whole height.
const TURN: f64 = 180.0;

fn main() -> Result<(), Box<dyn Error>> {
    // The window's device gets the features and limits that the renderer needs and can use.
    let describe = |adapter: &wgpu::Adapter| {
        let mut descriptor = wgpu::DeviceDescriptor::default();
        DeviceRequirements::for_adapter(adapter).merge_into(&mut descriptor);
        descriptor
    };
    let setup =
        WgpuSetupCreateNew { device_descriptor: Arc::new(describe), ..WgpuSetupCreateNew::without_display_handle() };
    let options = eframe::NativeOptions {
        wgpu_options: WgpuConfiguration { wgpu_setup: WgpuSetup::CreateNew(setup), ..WgpuConfiguration::default() },
        ..eframe::NativeOptions::default()
    };
    eframe::run_native("panel", options, Box::new(|context| Ok(Box::new(App::new(context)?))))?;
    Ok(())
}

struct App {
    host: RenderState,
    renderer: Renderer,
    view: SceneView,
    scene: Scene,
    /// The texture that the panel shows, and egui's name for it.
    picture: Option<(wgpu::Texture, TextureId)>,
    /// How far the cutting plane lies from the middle, in halves of the volume along y, the way the camera first looks.
    cut: f64,
    problem: String,
}

impl App {
    fn new(context: &eframe::CreationContext<'_>) -> Result<Self, Box<dyn Error + Send + Sync>> {
        let host = context.wgpu_render_state.clone().ok_or("the window has no wgpu device")?;
        let text = "volume.builtin = 'head:96'\ncamera = { direction = [0, 1, 0] }";
        let scene = Scene::parse(text, "panel", Path::new("."), &[])?;
        let renderer =
            Renderer::new(&host.device, &host.queue, &RendererOptions::for_target(FORMAT).with_blend(Blend::Replace))?;
        let volume = GpuVolume::new(&host.device, &host.queue, scene.load_volume()?)?;
        let view = SceneView::new(&host.device, &volume, &scene)?;
        Ok(Self { host, renderer, view, scene, picture: None, cut: -1.0, problem: String::new() })
    }

    /// Draws the picture if it differs from the last one.
    fn draw(&mut self, size: [u32; 2]) -> Result<(), Box<dyn Error>> {
        [self.scene.image.width, self.scene.image.height] = size;
        if self.picture.is_some() && self.scene == *self.view.scene() {
            return Ok(());
        }
        let RenderState { device, queue, .. } = &self.host;
        self.view.set_camera(self.scene.camera)?;
        self.view.set_image(self.scene.image)?;
        self.view.set_clip(self.scene.clip.clone())?;
        self.renderer.prepare(device, queue, &mut self.view)?;
        let target = picture(&self.host, &mut self.picture, size);
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.renderer.record(&mut encoder, &mut self.view);
        self.renderer.present(&mut encoder, &mut self.view, &target, Placement::whole(size))?;
        queue.submit([encoder.finish()]);
        Ok(())
    }

    fn show(&mut self, ui: &mut Ui) {
        let rect = ui.max_rect();
        let response = ui.allocate_rect(rect, Sense::drag());
        let moved = response.drag_delta() / rect.height().max(1.0);
        if response.dragged() {
            navigation::orbit(&mut self.scene.camera, DVec2::new(moved.x.into(), moved.y.into()) * TURN);
        }
        let size = (rect.size() * ui.pixels_per_point()).round().max(egui::Vec2::splat(1.0));
        self.problem =
            self.draw([size.x as u32, size.y as u32]).map_or_else(|error| error.to_string(), |()| String::new());
        if let Some((_, id)) = self.picture {
            let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
            ui.painter().image(id, rect, whole, Color32::WHITE);
        }
    }
}

impl eframe::App for App {
    fn ui(&mut self, ui: &mut Ui, _frame: &mut eframe::Frame) {
        Panel::right("settings").show(ui, |ui| {
            ui.heading("Cut");
            ui.add(Slider::new(&mut self.cut, -1.0..=1.0).text("depth"));
            ui.label(&self.problem);
        });
        // The plane keeps the points p with n · p + d ≥ 0, in world units from the volume's centre.
        let grid = self.view.volume().grid();
        let half = f64::from(grid.dims.y) * grid.spacing.y / 2.0;
        let planes = if self.cut > -1.0 { vec![[0.0, 1.0, 0.0, -self.cut * half]] } else { Vec::new() };
        self.scene.clip = Clip { planes, ..Clip::default() };
        CentralPanel::no_frame().show(ui, |ui| self.show(ui));
    }
}

/// A view of the texture that egui shows, which is made anew if the size changes.
fn picture(host: &RenderState, picture: &mut Option<(wgpu::Texture, TextureId)>, size: [u32; 2]) -> wgpu::TextureView {
    let size = wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 };
    if let Some((texture, _)) = picture
        && texture.size() == size
    {
        return texture.create_view(&wgpu::TextureViewDescriptor::default());
    }
    let texture = host.device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size,
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: FORMAT,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    });
    let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
    let mut painter = host.renderer.write();
    if let Some((_, id)) = picture.take() {
        painter.free_texture(&id);
    }
    let id = painter.register_native_texture(&host.device, &view, wgpu::FilterMode::Linear);
    *picture = Some((texture, id));
    view
}
