//! Draws a volume into a texture of an application that already has a wgpu device, in the application's own command encoder.
//!
//! `cargo run --release --example host_frame`

use std::path::Path;

use glam::{DVec3, dcamera::rh};
use sheetsplat::wgpu;
use sheetsplat::{Camera, DeviceRequirements, GpuVolume, Placement, Renderer, RendererOptions, Scene, SceneView};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // The application's part.
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default()))?;
    let mut descriptor = wgpu::DeviceDescriptor::default();
    DeviceRequirements::for_adapter(&adapter).merge_into(&mut descriptor);
    let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))?;
    let target = device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d { width: 640, height: 480, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Bgra8UnormSrgb,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
        view_formats: &[],
    });
    let view_from_world = rh::view::look_at_mat4(DVec3::new(90.0, -60.0, 30.0), DVec3::ZERO, DVec3::Z);
    let clip_from_view = rh::proj::directx::perspective_infinite_reverse(0.8, 320.0 / 240.0, 0.1);

    // Once: pipelines, the volume, and a view of it. The transparent background keeps the target's content visible.
    let renderer = Renderer::new(&device, &queue, &RendererOptions::for_target(target.format()))?;
    let text = "volume.builtin = 'head:48'\nimage = { width = 320, height = 240, background = [0, 0, 0, 0] }";
    let scene = Scene::parse(text, "example", Path::new("."), &[])?;
    let volume = GpuVolume::new(&device, &queue, scene.load_volume()?)?;
    let mut view = SceneView::new(&device, &volume, &scene)?;

    // When something has changed. A setter refuses invalid settings; `prepare` refuses what the device cannot draw.
    view.set_camera(Camera::from_clip_from_world(clip_from_view * view_from_world, [320, 240])?)?;
    renderer.prepare(&device, &queue, &mut view)?;
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    renderer.record(&mut encoder, &mut view);

    // Every frame, even if nothing has changed: `present`, or `draw` in the application's own pass.
    let at = Placement { origin: [40, 30], scissor: [0, 0, 640, 480] };
    renderer.present(&mut encoder, &mut view, &target.create_view(&wgpu::TextureViewDescriptor::default()), at)?;
    queue.submit([encoder.finish()]);
    Ok(())
}
