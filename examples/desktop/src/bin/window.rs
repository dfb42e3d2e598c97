//! A volume in a window of winit: the application owns surface and device, and the pointer turns the camera.

use std::error::Error;
use std::path::Path;
use std::sync::Arc;

use glam::DVec2;
use sheetsplat::settings::navigation;
use sheetsplat::{Blend, DeviceRequirements, GpuVolume, Placement, Renderer, RendererOptions, Scene, SceneView, wgpu};
use winit::application::ApplicationHandler;
use winit::dpi::PhysicalPosition;
use winit::event::{ElementState, MouseButton, WindowEvent};
use winit::event_loop::{ActiveEventLoop, EventLoop};
use winit::window::{Window, WindowId};

/// Degrees that the camera turns for a drag over the window's whole height.
const TURN: f64 = 180.0;

fn main() -> Result<(), Box<dyn Error>> {
    let mut app = App::Waiting;
    EventLoop::new()?.run_app(&mut app)?;
    if let App::Failed(error) = app { Err(error) } else { Ok(()) }
}

enum App {
    Waiting,
    Shown(Box<Shown>),
    Failed(Box<dyn Error>),
}

struct Shown {
    window: Arc<Window>,
    surface: wgpu::Surface<'static>,
    configuration: wgpu::SurfaceConfiguration,
    device: wgpu::Device,
    queue: wgpu::Queue,
    renderer: Renderer,
    view: SceneView,
    pointer: PhysicalPosition<f64>,
    is_turning: bool,
}

impl Shown {
    fn new(events: &ActiveEventLoop) -> Result<Self, Box<dyn Error>> {
        let window = Arc::new(events.create_window(Window::default_attributes().with_title("window"))?);
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
        let surface = instance.create_surface(Arc::clone(&window))?;
        let options = wgpu::RequestAdapterOptions {
            compatible_surface: Some(&surface),
            ..wgpu::RequestAdapterOptions::default()
        };
        let adapter = pollster::block_on(instance.request_adapter(&options))?;
        let mut descriptor = wgpu::DeviceDescriptor::default();
        DeviceRequirements::for_adapter(&adapter).merge_into(&mut descriptor);
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))?;
        let size = window.inner_size();
        let configuration = surface
            .get_default_config(&adapter, size.width.max(1), size.height.max(1))
            .ok_or("the adapter cannot draw on this window")?;
        surface.configure(&device, &configuration);

        // Any format of a surface does: colours are the same in all of them.
        let options = RendererOptions::for_target(configuration.format).with_blend(Blend::Replace);
        let renderer = Renderer::new(&device, &queue, &options)?;
        let scene = Scene::parse("volume.builtin = 'head:96'", "window", Path::new("."), &[])?;
        let volume = GpuVolume::new(&device, &queue, scene.load_volume()?)?;
        let view = SceneView::new(&device, &volume, &scene)?;
        let pointer = PhysicalPosition::new(0.0, 0.0);
        Ok(Self { window, surface, configuration, device, queue, renderer, view, pointer, is_turning: false })
    }

    fn draw(&mut self) -> Result<(), Box<dyn Error>> {
        use wgpu::CurrentSurfaceTexture::{Occluded, Suboptimal, Success, Timeout};
        let texture = match self.surface.get_current_texture() {
            Success(texture) | Suboptimal(texture) => texture,
            Timeout | Occluded => return Ok(()),
            // The window has another size, or another screen.
            _ => {
                self.surface.configure(&self.device, &self.configuration);
                self.window.request_redraw();
                return Ok(());
            }
        };
        let size = [texture.texture.width(), texture.texture.height()];
        let mut image = self.view.scene().image;
        [image.width, image.height] = size;
        self.view.set_image(image)?;
        self.renderer.prepare(&self.device, &self.queue, &mut self.view)?;
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.renderer.record(&mut encoder, &mut self.view);
        let target = texture.texture.create_view(&wgpu::TextureViewDescriptor::default());
        self.renderer.present(&mut encoder, &mut self.view, &target, Placement::whole(size))?;
        self.queue.submit([encoder.finish()]);
        self.window.pre_present_notify();
        self.queue.present(texture);
        Ok(())
    }

    fn happened(&mut self, events: &ActiveEventLoop, event: WindowEvent) -> Result<(), Box<dyn Error>> {
        match event {
            WindowEvent::CloseRequested => events.exit(),
            WindowEvent::RedrawRequested => self.draw()?,
            WindowEvent::Resized(size) => {
                (self.configuration.width, self.configuration.height) = (size.width.max(1), size.height.max(1));
                self.surface.configure(&self.device, &self.configuration);
                self.window.request_redraw();
            }
            WindowEvent::MouseInput { state, button: MouseButton::Left, .. } => {
                self.is_turning = state == ElementState::Pressed;
            }
            WindowEvent::CursorMoved { position, .. } => {
                let moved = DVec2::new(position.x - self.pointer.x, position.y - self.pointer.y);
                self.pointer = position;
                if self.is_turning {
                    let mut camera = self.view.scene().camera;
                    navigation::orbit(&mut camera, moved / f64::from(self.configuration.height) * TURN);
                    self.view.set_camera(camera)?;
                    self.window.request_redraw();
                }
            }
            _ => {}
        }
        Ok(())
    }
}

impl ApplicationHandler for App {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        if matches!(self, Self::Waiting) {
            *self = match Shown::new(events) {
                Ok(shown) => Self::Shown(Box::new(shown)),
                Err(error) => {
                    events.exit();
                    Self::Failed(error)
                }
            };
        }
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Self::Shown(shown) = self else { return };
        if let Err(error) = shown.happened(events, event) {
            events.exit();
            *self = Self::Failed(error);
        }
    }
}
