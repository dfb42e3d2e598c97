//! `shaders/classify.wgsl`: the twin's samples on all planes, one plane after another, against its composited pixels.

use std::collections::BTreeMap;

use bytemuck::Zeroable;
use glam::DVec4;
use sheetsplat::headless::readback;
use sheetsplat::internals::gpu::layout::SheetGroup;
use sheetsplat::internals::gpu::targets::{CompositingBuffer, Targets, no_surfaces};
use sheetsplat::internals::gpu::uniforms;
use sheetsplat::internals::gpu::volume_texture::VolumeTexture;
use sheetsplat::internals::pass::classify::{CARRIED_BYTES, Classify, ClassifyBuffers, ClassifyMode};
use sheetsplat::internals::pass::composite::{CompositeBuffers, CompositeMode, CutBuffers, RayMode};
use sheetsplat::internals::quad_plan::tile_grid;
use sheetsplat::internals::reference::after::{Frame, Sample};
use sheetsplat::settings::{Compositing, Gradient, LabelTables, Order, Ramp, Window};
use sheetsplat::volume::Labels;
use sheetsplat::wgpu::{self, BufferUsages};

use super::{PERSPECTIVE, Prepared, head, head_scene, with_case};
use crate::common::compare::{apart, assert_at_least, assert_at_most, decibels, largest, root_mean_square};
use crate::common::{COMPOSITINGS, gpu};
use crate::{at_offsets, compute, init, tile_list};

/// The sums that give a pixel its sample: the weight is any number.
fn sums(prepared: &Prepared<'_>, sample: Option<Sample>, weight: f64) -> [[f32; 4]; 2] {
    let Some(Sample { value, gradient }) = sample else { return [[0.0; 4]; 2] };
    let Prepared { numbers, volume, .. } = prepared;
    let number = numbers.apply(value);
    let g = gradient * numbers.scale * volume.grid().unit() * weight;
    let first = DVec4::new(weight, number * weight, g.x, g.y);
    [first, DVec4::new(g.z, 0.0, 0.0, 0.0)].map(|sums| sums.as_vec4().to_array())
}

/// The compositing buffer after the stage has seen all planes, in the scene's order.
fn classified(prepared: &Prepared<'_>, twin: &Frame<'_>) -> Vec<DVec4> {
    let (device, queue) = (prepared.gpu.device(), prepared.gpu.queue());
    let Prepared { view, volume, scene, .. } = prepared;
    let size = view.size;
    let targets = Targets::new(device, size, wgpu::TextureFormat::Rgba32Float, 2).unwrap();
    let bands = CompositingBuffer::bands(&device.limits(), size).unwrap();
    let compositing = CompositingBuffer::new(device, size, &bands);
    let [band] = &compositing.bands[..] else { unreachable!("one band") };
    let planes = prepared.reached_planes();
    let group = |plane: i32| SheetGroup {
        near: view.slabs.plane(plane) as f32,
        number: (plane - planes.start + 1) as u32,
        ..SheetGroup::zeroed()
    };
    let (groups, stride) = at_offsets(device, &planes.clone().map(group).collect::<Vec<_>>());
    let [columns, rows] = tile_grid(size);
    let tiles = tile_list(device, &(0..columns * rows).collect::<Vec<_>>());
    let labels = volume.labels().map(|labels| VolumeTexture::upload_labels(device, queue, labels).unwrap());
    let cut = uniforms::cut(view, volume.grid(), scene, None, None, &Window::whole(view.size));
    let surfaces = no_surfaces(device);
    let stage = Classify::new(device);
    let buffers = ClassifyBuffers {
        composite: CompositeBuffers {
            frame: &prepared.frame,
            groups: &groups,
            sheets: &targets.sheets_view(),
            tiles: &tiles,
            targets: &targets,
            cut: CutBuffers { uniform: &init(device, &[cut], BufferUsages::UNIFORM), surfaces: &surfaces },
            hits: &init(device, &[0_u32; 64], BufferUsages::STORAGE),
        },
        control_points: &prepared.control_points,
        planes: &prepared.planes,
        values: &prepared.values.view,
        labels: labels.as_ref().map(|texture| &texture.view),
    };
    let mode = ClassifyMode {
        composite: CompositeMode { compositing: scene.splatting.compositing, rays: RayMode::default() },
        gradient: Gradient::Differences,
        labels: labels.is_some(),
        holes: prepared.has_holes(),
        channels: 1,
        own_colors: false,
    };
    let pixels = (size[0] * size[1]) as usize;
    let carried = init(device, &vec![0_u8; pixels * CARRIED_BYTES as usize], BufferUsages::STORAGE);
    let bound = [stage.bind(device, mode, buffers, (band, &carried))];
    let layout =
        wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(size[0] * 16), rows_per_image: Some(size[1]) };
    let mut order: Vec<i32> = planes.clone().collect();
    if scene.splatting.order == Order::BackToFront {
        order.reverse();
    }
    for plane in order {
        let weight = |pixel: usize| 0.2 + (pixel * 7 + plane.unsigned_abs() as usize) as f64 % 11.0;
        let samples = twin.plane_field(plane);
        let sums: Vec<_> =
            samples.iter().enumerate().map(|(pixel, sample)| sums(prepared, *sample, weight(pixel))).collect();
        let texels: Vec<[f32; 4]> = [0, 1].into_iter().flat_map(|layer| sums.iter().map(move |of| of[layer])).collect();
        queue.write_texture(
            targets.sheets.as_image_copy(),
            bytemuck::cast_slice(&texels),
            layout,
            targets.sheets.size(),
        );
        let offset = (plane - planes.start) as u32 * stride;
        compute(prepared.gpu, |pass| stage.record(pass, &bound, offset, &tiles));
    }
    let bytes = readback::buffer(device, queue, &band.acc).unwrap();
    let colors: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&bytes);
    colors.into_iter().map(|color| resolved(scene.splatting.compositing, DVec4::from(color.map(f64::from)))).collect()
}

/// What the compositing buffer means: for a minimum it holds 2 minus the opacity, and 0 for nothing.
fn resolved(compositing: Compositing, color: DVec4) -> DVec4 {
    match compositing {
        Compositing::Minimum if color.w > 0.0 => color.truncate().extend(2.0 - color.w),
        _ => color,
    }
}

fn check(prepared: &Prepared<'_>, twin: &Frame<'_>) {
    let Prepared { scene, name, .. } = prepared;
    let (compositing, order) = (scene.splatting.compositing, scene.splatting.order);
    let name = format!("{name}, {compositing:?}, {order:?}");
    let found = classified(prepared, twin);
    let expected: Vec<DVec4> = twin.composite().iter().map(|pixel| pixel.color).collect();
    let shown = expected.iter().filter(|color| color.w > 0.02).count();
    assert!(shown * 20 > expected.len(), "{name}: {shown} pixels");
    let errors: Vec<f64> = found.iter().zip(&expected).map(|(found, expected)| apart(*found, *expected)).collect();
    let (rms, worst) = (root_mean_square(errors.iter().copied()), largest(errors.iter().copied()));
    println!("{name}: {:.1} dB, at most {worst:.1e}", decibels(rms));
    assert_at_least(decibels(rms), 110.0, &name);
    assert_at_most(worst, 1e-4, &name);
}

#[test]
fn pixels_are_the_twins() {
    let gpu = gpu();
    for compositing in COMPOSITINGS {
        for (name, spacing, has_holes, projection) in [
            ("orthographic, holes", [1.0, 1.3, 2.0], true, None),
            ("perspective", [1.0, 0.8, 1.6], false, Some(PERSPECTIVE)),
        ] {
            let volume = head(spacing, has_holes);
            let mut scene = head_scene(projection);
            scene.splatting.compositing = compositing;
            let opacity: Option<&[(f64, f64)]> = match compositing {
                Compositing::Maximum => Some(&[(20.0, 0.0), (100.0, 0.2), (250.0, 0.9)]),
                Compositing::Minimum => Some(&[(0.0, 0.9), (60.0, 0.6), (250.0, 0.1)]),
                Compositing::Average => Some(&[(10.0, 0.0), (60.0, 0.7), (90.0, 0.2)]),
                Compositing::Surface => Some(&[(30.0, 0.0), (70.0, 0.7), (200.0, 0.8)]),
                _ => None,
            };
            if let Some(points) = opacity {
                scene.transfer.opacity = Some(Ramp::new(points.to_vec()).unwrap());
            }
            // A surface is only drawn front to back.
            let is_reversed = !has_holes && compositing != Compositing::Surface;
            scene.splatting.order = if is_reversed { Order::BackToFront } else { Order::FrontToBack };
            with_case(&gpu, (name, &volume, &scene), check);
        }
    }
}

#[test]
fn labels_and_gradient_opacity_are_the_twins() {
    let gpu = gpu();
    let head = head([1.0; 3], false);
    let values = (0..head.values().len()).map(|index| u16::from(index % 16 > 7)).collect();
    let (dims, origin) = (head.dims(), "labels".to_owned());
    let volume = head.with_labels(Labels { origin, dims, spacing: None, values, names: BTreeMap::new() }).unwrap();
    let mut scene = head_scene(None);
    scene.transfer.gradient_opacity = Some(Ramp::new(vec![(0.0, 0.1), (40.0, 1.0)]).unwrap());
    let tables =
        LabelTables { opacity: Some(Ramp::new(vec![(60.0, 0.0), (90.0, 0.9)]).unwrap()), ..LabelTables::default() };
    scene.transfer.labels.insert(1, tables);
    for compositing in [Compositing::Linear, Compositing::Surface] {
        scene.splatting.compositing = compositing;
        with_case(&gpu, ("labels", &volume, &scene), check);
    }
}
