//! `shaders/composite.wgsl` against `reference::composite`: random sheets over random compositing buffers.

use glam::{DVec3, DVec4};
use sheetsplat::gpu::targets::Targets;
use sheetsplat::gpu::{layout, readback};
use sheetsplat::headless::Headless;
use sheetsplat::pass::composite::Composite;
use sheetsplat::reference::Buffer;
use sheetsplat::reference::composite::composite;
use sheetsplat::splatting::{Compositing, Order};
use sheetsplat::wgpu;

use crate::common::{F32, Random, gpu, gpu_with_small_bindings, pixels};
use crate::frame_buffer;

/// Premultiplied colours, in f32: a share of the pixels with no alpha at all, tiny ones, and, if asked for, some above 1.
fn random_pixels(random: &mut Random, size: [u32; 2], above_one: bool) -> Vec<[f32; 4]> {
    let alpha = |random: &mut Random| match random.bits() % 6 {
        0 => 0.0,
        1 => 1e-6 * random.uniform(0.5, 2.0),
        // Around the shader's switch from a series to exp.
        2 => random.uniform(0.06, 0.065),
        3 => 1.0,
        4 if above_one => random.uniform(1.0, 30.0),
        _ => random.uniform(0.0, 1.0),
    };
    (0..size[0] * size[1])
        .map(|_| {
            let alpha = alpha(random);
            let rgb = DVec3::from([(); 3].map(|()| random.uniform(0.0, 1.0))) * alpha;
            rgb.extend(alpha).as_vec4().to_array()
        })
        .collect()
}

fn to_f64(width: u32, pixels: &[[f32; 4]]) -> Buffer {
    Buffer { width: width as usize, pixels: pixels.iter().map(|pixel| DVec4::from(pixel.map(f64::from))).collect() }
}

/// What f32 may change in a pixel. A sum and a product of numbers up to `most` is worth a few roundings; WGSL's division
/// is good to 2.5 ULP, its exp to (3 + 2|x|) ULP, of which 1 - exp(-a) keeps all in absolute terms; the shader's series
/// below 1/16 errs by a⁵/720.
fn tolerance(compositing: Compositing, alpha: f64, most: f64) -> f64 {
    let exp_error = match compositing {
        Compositing::Exponential if alpha >= 0.06 => (3.0 + 2.0 * alpha) * 2.0 * F32 * (-alpha).exp(),
        Compositing::Exponential => alpha.powi(6) / 720.0,
        Compositing::Linear | Compositing::Xray => 0.0,
    };
    exp_error + 10.0 * F32 * most
}

fn check(gpu: &Headless, size: [u32; 2], bands: usize) {
    let (device, queue) = (gpu.device(), gpu.queue());
    let stage = Composite::new(device);
    let mut random = Random(u64::from(size[0]));
    for compositing in [Compositing::Linear, Compositing::Exponential, Compositing::Xray] {
        for order in [Order::FrontToBack, Order::BackToFront] {
            let targets = Targets::new(device, size, wgpu::TextureFormat::Rgba32Float).unwrap();
            assert_eq!(targets.bands.len(), bands);
            let sheet = random_pixels(&mut random, size, true);
            let acc = random_pixels(&mut random, size, compositing == Compositing::Xray);
            let layout =
                wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(size[0] * 16), rows_per_image: None };
            queue.write_texture(
                targets.sheet.as_image_copy(),
                bytemuck::cast_slice(&sheet),
                layout,
                targets.sheet.size(),
            );
            let frame = frame_buffer(device, |scene| {
                (scene.image.width, scene.image.height) = (size[0], size[1]);
                (scene.splatting.compositing, scene.splatting.order) = (compositing, order);
            });
            let view = targets.sheet.create_view(&wgpu::TextureViewDescriptor::default());
            let rows: Vec<layout::Band> = targets.bands.iter().map(|band| band.band).collect();
            for (band, rows) in targets.bands.iter().zip(&rows) {
                let first = (rows.first_row * size[0]) as usize;
                let acc = &acc[first..first + (rows.rows * size[0]) as usize];
                queue.write_buffer(&band.acc, 0, bytemuck::cast_slice(acc));
            }
            let groups: Vec<_> = targets.bands.iter().map(|band| stage.bind(device, &frame, band, &view)).collect();
            let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            stage.record(&mut encoder, size[0], groups.iter().zip(rows));
            queue.submit([encoder.finish()]);
            let actual: Vec<DVec4> = (targets.bands.iter())
                .flat_map(|band| pixels(&readback::buffer(device, queue, &band.acc).unwrap()))
                .collect();

            let sheet = to_f64(size[0], &sheet);
            let mut expected = to_f64(size[0], &acc);
            composite(&mut expected, &sheet, compositing, order);
            assert_eq!(actual.len(), expected.pixels.len());
            for (i, (actual, expected)) in actual.iter().zip(&expected.pixels).enumerate() {
                let alpha = sheet.pixels[i].w;
                let tolerance = tolerance(compositing, alpha, expected.max_element().max(1.0));
                assert!(
                    (*actual - *expected).abs().max_element() <= tolerance,
                    "{compositing:?} {order:?} {size:?}, pixel {i}: sheet {}, acc {:?}: {actual}, not {expected} ± {tolerance}",
                    sheet.pixels[i],
                    acc[i],
                );
                // What nothing was drawn on stays what it is, to the last bit.
                assert!(alpha > 0.0 || *actual == DVec4::from(acc[i].map(f64::from)), "pixel {i}");
            }
        }
    }
}

#[test]
fn every_compositing_and_order() {
    let gpu = gpu();
    for size in [[1, 1], [16, 16], [61, 37], [130, 5], [7, 100]] {
        check(&gpu, size, 1);
    }
}

#[test]
fn several_bands() {
    // Rows of 61 pixels: 8 of them fit a binding.
    check(&gpu_with_small_bindings(8192), [61, 37], 5);
}
