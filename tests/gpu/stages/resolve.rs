//! `shaders/resolve.wgsl` against `reference::resolve`: a random compositing buffer over backgrounds.

use glam::{DVec3, DVec4};
use sheetsplat::Placement;
use sheetsplat::headless::{GpuHeadless, readback};
use sheetsplat::internals::gpu::{layout, targets::CompositingBuffer};
use sheetsplat::internals::pass::resolve::Resolve;
use sheetsplat::internals::reference::Buffer;
use sheetsplat::internals::reference::resolve::resolve;
use sheetsplat::settings::{Compositing, Splatting};
use sheetsplat::wgpu::{self, BufferUsages, TextureFormat, TextureUsages};
use sheetsplat::{Blend, RendererOptions};

use crate::common::compare::{apart, assert_at_most};
use crate::common::devices::{gpu, gpu_with_small_bindings};
use crate::common::{COMPOSITINGS, F32, Random, pixels};
use crate::stages::{frame, init};

const BACKGROUNDS: [[f64; 4]; 5] =
    [[0.0, 0.0, 0.0, 1.0], [0.2, 0.9, 0.4, 1.0], [0.7, 0.5, 0.3, 0.0], [0.1, 1.0, 0.6, 0.5], [1.0, 1.0, 1.0, 1.0]];

fn check(gpu: &GpuHeadless, size: [u32; 2], bands: usize) {
    let (device, queue) = (gpu.device(), gpu.queue());
    let options = RendererOptions::for_target(TextureFormat::Rgba32Float).with_blend(Blend::Replace);
    let stage = Resolve::new(device, &options);
    let mut random = Random(9);
    let cut = CompositingBuffer::bands(&device.limits(), size).unwrap();
    let compositing_buffer = CompositingBuffer::new(device, size, &cut);
    assert_eq!(compositing_buffer.bands.len(), bands);
    let target = device.create_texture(&wgpu::TextureDescriptor {
        label: Some("target"),
        size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: TextureFormat::Rgba32Float,
        usage: TextureUsages::RENDER_ATTACHMENT | TextureUsages::COPY_SRC,
        view_formats: &[],
    });
    let view = target.create_view(&wgpu::TextureViewDescriptor::default());
    for compositing in COMPOSITINGS {
        for (background, threshold) in BACKGROUNDS.into_iter().zip([0.95, 0.3, 1.0, 0.6, 0.95]) {
            // Sums exceed 1; the other modes cannot. Some pixels are empty, some opaque.
            let most = match compositing {
                Compositing::Xray | Compositing::Average => 3.0,
                // Two minus the opacity.
                Compositing::Minimum => 2.0,
                _ => 1.0,
            };
            let acc: Vec<[f32; 4]> = (0..size[0] * size[1])
                .map(|_| {
                    let alpha = random.uniform(-0.2 * most, 1.2 * most).clamp(0.0, most);
                    let rgb = DVec3::from([(); 3].map(|()| random.uniform(0.0, 1.0))) * alpha;
                    rgb.extend(alpha).as_vec4().to_array()
                })
                .collect();
            let rows: Vec<layout::Band> = compositing_buffer.bands.iter().map(|band| band.band).collect();
            for (band, rows) in compositing_buffer.bands.iter().zip(&rows) {
                let first = (rows.first_row * size[0]) as usize;
                let acc = &acc[first..first + (rows.rows * size[0]) as usize];
                queue.write_buffer(&band.acc, 0, bytemuck::cast_slice(acc));
            }
            let frame = frame(|scene| {
                (scene.image.width, scene.image.height) = (size[0], size[1]);
                scene.image.background = background;
                (scene.splatting.compositing, scene.splatting.opacity_threshold) = (compositing, threshold);
            });
            let frame = init(device, &[frame], BufferUsages::UNIFORM);
            let groups: Vec<_> = compositing_buffer.bands.iter().map(|band| stage.bind(device, &frame, band)).collect();
            let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &view,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations::default(),
                })],
                ..wgpu::RenderPassDescriptor::default()
            });
            stage.draw(&mut pass, size, groups.iter().zip(rows), Placement::whole(size));
            drop(pass);
            queue.submit([encoder.finish()]);
            let actual = pixels(&readback::texture(device, queue, &target).unwrap());

            let acc = acc.iter().map(|pixel| DVec4::from(pixel.map(f64::from))).collect();
            let acc = Buffer { width: size[0] as usize, pixels: acc };
            let splatting = Splatting { compositing, opacity_threshold: threshold, ..Splatting::default() };
            let expected = resolve(&acc, (compositing, &splatting), background);
            assert_eq!(actual.len(), expected.pixels.len());
            for (i, (actual, expected)) in actual.iter().zip(&expected.pixels).enumerate() {
                // One rounding each for the background's product, one minus alpha, a product, and a sum of numbers up to 1; closing has as many.
                let over = format_args!("{compositing:?} {background:?} pixel {i}: acc {}", acc.pixels[i]);
                assert_at_most(apart(*actual, *expected), 8.0 * F32, format_args!("{over}: {actual}, not {expected}"));
            }
        }
    }
}

#[test]
fn over_every_kind_of_background() {
    check(gpu(), [61, 37], 1);
}

#[test]
fn several_bands() {
    // Rows have 61 pixels: 33 of them fit a binding, and a band consists of whole tiles.
    check(&gpu_with_small_bindings(32768), [61, 137], 5);
}
