//! `shaders/sample.wgsl` against `reference::splat` and `reference::composite`: whole kernels, each composited by itself, from back to front.

use bytemuck::Zeroable;
use glam::DVec4;
use sheetsplat::headless::readback;
use sheetsplat::internals::footprint::FootprintTable;
use sheetsplat::internals::gpu::footprint_texture::FootprintTexture;
use sheetsplat::internals::gpu::layout;
use sheetsplat::internals::pass::sample::{Sample, SampleBuffers, SampleMode};
use sheetsplat::internals::reference::composite::composite_pixel;
use sheetsplat::settings::{FootprintForm, Method, Order};
use sheetsplat::wgpu::{self, BufferUsages, TextureFormat, TextureUsages};

use crate::common::compare::{apart, assert_at_most};
use crate::common::devices::gpu;
use crate::common::{BY_AMOUNTS, F32, Random, pixels};
use crate::stages::kernel_in_view::{KernelInView, random_view};
use crate::stages::section::Seen;
use crate::stages::{frame_over, indirect, init};

const COUNT: u32 = 40;

#[test]
fn kernels_one_by_one() {
    let gpu = gpu();
    let (device, queue) = (gpu.device(), gpu.queue());
    let stage = Sample::new(device, TextureFormat::Rgba32Float);
    let mut random = Random(29);
    for (compositing, form) in BY_AMOUNTS
        .into_iter()
        .flat_map(|compositing| [FootprintForm::SummedArea, FootprintForm::Sections].map(|form| (compositing, form)))
    {
        let (mut lit, mut worst) = (0, 0.0_f64);
        for _ in 0..8 {
            let (grid, mut scene) = random_view(&mut random, Method::CompositeEverySample, form);
            scene.splatting.compositing = compositing;
            let frame = init(device, &[frame_over(&grid, &scene)], BufferUsages::UNIFORM);
            let seen = Seen::new(&grid, scene);
            let kernels: Vec<_> = (0..COUNT).map(|_| KernelInView::random(&seen, &mut random)).collect();
            // Some of the kernels, in another order than in memory.
            let order: Vec<u32> = (0..COUNT).rev().filter(|_| !random.bits().is_multiple_of(8)).collect();

            let view = &seen.view;
            let table = FootprintTable::new(form, &seen.kernel, view.section_width());
            let group = layout::SheetGroup { near: view.slabs.plane(0) as f32, ..layout::SheetGroup::zeroed() };
            let mode = SampleMode { form, compositing };
            let count = order.len() as u32;
            let records: Vec<_> = kernels.iter().map(|kernel| kernel.record).collect();
            let bound = stage.bind(
                device,
                mode,
                SampleBuffers {
                    frame: &frame,
                    group: &init(device, &[group], BufferUsages::UNIFORM),
                    splats: &init(device, &records, BufferUsages::STORAGE),
                    order: &init(device, &order, BufferUsages::STORAGE),
                    args: &init(device, &[indirect(count)], BufferUsages::STORAGE),
                    footprints: &FootprintTexture::upload(device, queue, &table),
                },
            );
            let target = device.create_texture(&wgpu::TextureDescriptor {
                label: Some("target"),
                size: wgpu::Extent3d { width: view.size[0], height: view.size[1], depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: TextureFormat::Rgba32Float,
                usage: TextureUsages::RENDER_ATTACHMENT | TextureUsages::COPY_SRC,
                view_formats: &[],
            });
            let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            let target_view = target.create_view(&wgpu::TextureViewDescriptor::default());
            stage.record(&mut encoder, None, (mode, &bound), &target_view, count);
            queue.submit([encoder.finish()]);
            let drawn = pixels(&readback::texture(device, queue, &target).unwrap());

            let mut expected = vec![(DVec4::ZERO, 0.0); drawn.len()];
            for kernel in order.iter().map(|&at| &kernels[at as usize]) {
                let Some(section) = kernel.section(0) else { continue };
                let section = if form == FootprintForm::Sections { kernel.stored(section, 0) } else { Some(section) };
                // A kernel whose slab is whole uses the first of the stored sections, whatever f32 does.
                let section = section.unwrap();
                kernel.draw(&section, 0, |pixel, amount, error| {
                    let (acc, tolerance) = &mut expected[pixel];
                    composite_pixel(acc, amount, compositing, Order::BackToFront);
                    // A kernel's error affects its own amount, the division by that, and what it leaves visible of those behind it. Added
                    // to this are a few roundings of numbers up to the current maximum, and exp, which errs by up to (3 + 2a) ULP.
                    let most = acc.max_element().max(1.0);
                    *tolerance += if amount.w > 0.0 { 3.0 * error + 16.0 * F32 * most } else { error };
                });
            }
            for (pixel, (actual, (expected, tolerance))) in drawn.iter().zip(&expected).enumerate() {
                let error = apart(*actual, *expected);
                let what = format_args!("pixel {pixel}: {actual}, not {expected}, {:?}", seen.scene);
                // The kernels' errors have either sign, so their sum is far below the sum of the bounds.
                assert_at_most(error, 0.2 * tolerance, what);
                worst = worst.max(error / tolerance.max(1e-300));
                lit += usize::from(expected.w > 0.0);
            }
        }
        println!("{compositing:?}, {form:?}: {lit} pixels lit, errors up to {worst:.3} of the tolerance");
        assert!(lit > 5000, "only {lit} pixels were compared");
    }
}
