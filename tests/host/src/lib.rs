//! An application with its own wgpu device, and tests of the library in it.
#![cfg(test)]
#![expect(clippy::unwrap_used, reason = "tests")]

#[expect(dead_code, reason = "the host needs few of them")]
#[path = "../../common/compare.rs"]
mod compare;
mod dependencies;
mod depth;
mod devices;
mod faults;
mod passes;
mod sharing;
mod targets;

use std::path::Path;

use sheetsplat::headless::{GpuHeadless, HeadlessOptions};
use sheetsplat::{DeviceRequirements, GpuVolume, Placement, Renderer, RendererOptions, Scene, SceneView};
use wgpu::{Adapter, Device, DeviceDescriptor, Features, Limits, Queue, Texture, TextureFormat, TextureUsages};

/// The application's device.
struct Host {
    device: Device,
    queue: Queue,
}

/// Mesa's software driver, so that results are the same on every machine.
fn adapter() -> Adapter {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::VULKAN));
    let lavapipe = adapters.into_iter().find(|adapter| adapter.get_info().name.contains("llvmpipe"));
    lavapipe.expect("these tests need Mesa's lavapipe")
}

impl Host {
    /// A device with a few features for the application and the rest for the library.
    fn new() -> Self {
        let adapter = adapter();
        let mut descriptor = DeviceDescriptor {
            required_limits: Limits { max_bind_groups: 5, ..Limits::downlevel_defaults() },
            ..DeviceDescriptor::default()
        };
        DeviceRequirements::for_adapter(&adapter).merge_into(&mut descriptor);
        assert_eq!(descriptor.required_limits.max_bind_groups, 5);
        Self::open(&adapter, &descriptor)
    }

    fn with(features: Features, limits: Limits) -> Self {
        let descriptor =
            DeviceDescriptor { required_features: features, required_limits: limits, ..DeviceDescriptor::default() };
        Self::open(&adapter(), &descriptor)
    }

    fn open(adapter: &Adapter, descriptor: &DeviceDescriptor<'_>) -> Self {
        let (device, queue) = pollster::block_on(adapter.request_device(descriptor)).unwrap();
        Self { device, queue }
    }

    fn renderer(&self, options: RendererOptions) -> Renderer {
        Renderer::new(&self.device, &self.queue, &options).unwrap()
    }

    fn volume(&self, scene: &Scene) -> GpuVolume {
        GpuVolume::new(&self.device, &self.queue, scene.load_volume().unwrap()).unwrap()
    }

    fn view(&self, scene: &Scene) -> SceneView {
        SceneView::new(&self.device, &self.volume(scene), scene).unwrap()
    }

    fn target(&self, format: TextureFormat, [width, height]: [u32; 2], sample_count: u32) -> Texture {
        let copies = if sample_count == 1 && !format.has_depth_aspect() {
            TextureUsages::COPY_SRC | TextureUsages::COPY_DST
        } else {
            TextureUsages::empty()
        };
        self.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("host's"),
            size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: TextureUsages::RENDER_ATTACHMENT | copies,
            view_formats: &[],
        })
    }

    /// A target with these texels.
    fn filled(&self, format: TextureFormat, size: [u32; 2], texels: &[u8]) -> Texture {
        let target = self.target(format, size, 1);
        let layout = wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(size[0] * format.block_copy_size(None).unwrap()),
            rows_per_image: None,
        };
        self.queue.write_texture(target.as_image_copy(), texels, layout, target.size());
        target
    }

    fn encoder(&self) -> wgpu::CommandEncoder {
        self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default())
    }

    fn submit(&self, encoder: wgpu::CommandEncoder) {
        self.queue.submit([encoder.finish()]);
    }

    /// The image of only this view, in a target of its size.
    fn render(&self, renderer: &Renderer, format: TextureFormat, view: &mut SceneView) -> Vec<u8> {
        renderer.prepare(&self.device, &self.queue, view).unwrap();
        let target = self.target(format, size(view), 1);
        let mut encoder = self.encoder();
        renderer.record(&mut encoder, view);
        let at = Placement::whole(size(view));
        renderer.present(&mut encoder, view, &target.create_view(&wgpu::TextureViewDescriptor::default()), at).unwrap();
        self.submit(encoder);
        self.read(&target)
    }

    /// The texels of a target, row by row.
    fn read(&self, target: &Texture) -> Vec<u8> {
        let row = target.width() * target.format().block_copy_size(None).unwrap();
        let padded = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: u64::from(padded) * u64::from(target.height()),
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(padded), rows_per_image: None };
        let mut encoder = self.encoder();
        let to = wgpu::TexelCopyBufferInfo { buffer: &buffer, layout };
        encoder.copy_texture_to_buffer(target.as_image_copy(), to, target.size());
        self.submit(encoder);
        buffer.map_async(wgpu::MapMode::Read, .., |mapped| mapped.unwrap());
        self.device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
        let bytes = buffer.get_mapped_range(..).unwrap();
        bytes.chunks(padded as usize).flat_map(|padded| padded[..row as usize].to_vec()).collect()
    }
}

fn size(view: &SceneView) -> [u32; 2] {
    let image = view.scene().image;
    [image.width, image.height]
}

/// A small head over a background, visible in every part of the image.
fn scene(background: &str) -> Scene {
    let text = format!(
        "
        volume.builtin = 'head:32'
        camera.direction = [0.55, 0.8, -0.12]
        camera.height = 150
        image = {{ width = 90, height = 70, background = {background} }}
        transfer.color = [[0, [0.1, 0.3, 0.9]], [120, [0.9, 0.6, 0.2]], [255, [1, 1, 1]]]
        transfer.opacity = [[20, 0], [140, 0.3]]
        splatting.compositing = 'exponential'
        "
    );
    Scene::parse(&text, "test", Path::new("."), &[]).unwrap()
}

const OPAQUE: &str = "[0.2, 0.5, 0.9, 1]";
const TRANSPARENT: &str = "[0, 0, 0, 0]";

/// The image that headless rendering gives.
fn headless(scene: &Scene) -> Vec<[f32; 4]> {
    let options = HeadlessOptions::default().with_adapter("llvmpipe");
    GpuHeadless::new(&options).unwrap().render(scene).unwrap().image.pixels
}

fn pixels(bytes: &[u8]) -> Vec<[f32; 4]> {
    bytemuck::pod_collect_to_vec(bytes)
}

/// The maximum relative error of an f16: a driver may truncate where others round.
const F16: f64 = 1.0 / 1024.0;

/// A half-precision float.
fn f16(bits: u16) -> f64 {
    let (exponent, fraction) = (i32::from(bits >> 10 & 31), f64::from(bits & 1023) / 1024.0);
    assert!(bits >> 15 == 0 && exponent < 31, "{bits:x} is negative or not finite");
    if exponent == 0 { fraction * 2.0_f64.powi(-14) } else { (1.0 + fraction) * 2.0_f64.powi(exponent - 15) }
}
