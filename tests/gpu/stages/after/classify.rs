//! `shaders/classify.wgsl`: the twin's samples on all planes, one plane after another, against its composited pixels.

use std::collections::BTreeMap;

use bytemuck::Zeroable;
use glam::{DMat3, DVec3, DVec4};
use sheetsplat::SurfaceDepths;
use sheetsplat::headless::readback;
use sheetsplat::internals::gpu::layout::SheetGroup;
use sheetsplat::internals::gpu::targets::{CompositingBuffer, Targets, no_surfaces};
use sheetsplat::internals::gpu::uniforms;
use sheetsplat::internals::gpu::volume_texture::VolumeTexture;
use sheetsplat::internals::pass::classify::{CARRIED_BYTES, Classify, ClassifyBuffers, ClassifyMode};
use sheetsplat::internals::pass::composite::{CompositeBuffers, CompositeMode, CutBuffers, RayMode};
use sheetsplat::internals::plane_geometry::PlaneGeometry;
use sheetsplat::internals::quad_plan::tile_grid;
use sheetsplat::internals::reference::Host;
use sheetsplat::internals::reference::after::{Frame, Sample};
use sheetsplat::internals::view_geometry::ViewGeometry;
use sheetsplat::scene::Scene;
use sheetsplat::settings::{Compositing, Gradient, LabelTables, Order, Ramp, Window};
use sheetsplat::volume::Labels;
use sheetsplat::wgpu::{self, BufferUsages};

use super::{PERSPECTIVE, Prepared, assert_hits, cut, head, head_scene, resolved, shown_by, with_case, with_host};
use crate::common::COMPOSITINGS;
use crate::common::compare::{apart, assert_at_least, assert_at_most, decibels, largest, root_mean_square};
use crate::common::devices::gpu;
use crate::common::surfaces::{DepthRange, surfaces};
use crate::stages::{at_offsets, compute, contents, init, tile_list};

/// The sums that give a pixel its sample: the weight is any number, and so is the moment of the weights.
fn sums(prepared: &Prepared<'_>, sample: Option<Sample>, weight: f64) -> [[f32; 4]; 2] {
    let Some(Sample { value, gradient }) = sample else { return [[0.0; 4]; 2] };
    let Prepared { numbers, volume, scene, view, .. } = prepared;
    let number = numbers.apply(value);
    if scene.shading.gradient == Gradient::Kernel {
        let in_grid = gradient * numbers.scale * volume.spacing() * weight / (-2.0 * scene.splatting.falloff);
        let axes = DMat3::from_cols_array_2d(&PlaneGeometry::new(view, volume.grid()).axes.map(|axis| axis.to_array()));
        let of_weights = DVec3::new(0.02, -0.01, 0.03) * weight;
        let of_numbers = number * of_weights + axes.transpose() * in_grid;
        let first = DVec4::new(weight, number * weight, of_weights.x, of_weights.y);
        let second = DVec4::new(of_weights.z, of_numbers.x, of_numbers.y, of_numbers.z);
        return [first, second].map(|sums| sums.as_vec4().to_array());
    }
    let g = gradient * numbers.scale * volume.grid().unit() * weight;
    let first = DVec4::new(weight, number * weight, g.x, g.y);
    [first, DVec4::new(g.z, 0.0, 0.0, 0.0)].map(|sums| sums.as_vec4().to_array())
}

/// The compositing buffer after the stage has seen all planes, in the scene's order, and the words of first hits.
fn classified(prepared: &Prepared<'_>, twin: &Frame<'_>, rays: Rays<'_>) -> (Vec<DVec4>, Vec<u32>) {
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
    let unit = volume.grid().unit();
    let clip_planes = [0.5, 1000.0];
    let given = rays
        .surfaces
        .map(|depths| surfaces(prepared.gpu, view, unit, DepthRange::Standard, clip_planes, depths, [2, 1]));
    let of_host = given.as_ref().map(|given| (depths_of(view, clip_planes), given.origin));
    let cut = uniforms::cut(view, volume.grid(), scene, of_host, rays.first_hit, &Window::whole(view.size));
    let surfaces = given.map_or_else(|| no_surfaces(device), |given| given.depth);
    let pixels = (size[0] * size[1]) as usize;
    let hits = init(device, &vec![0_u32; pixels], BufferUsages::STORAGE);
    let stage = Classify::new(device);
    let buffers = ClassifyBuffers {
        light: None,
        composite: CompositeBuffers {
            frame: &prepared.frame,
            groups: &groups,
            sheets: &targets.sheets_view(),
            tiles: &tiles,
            targets: &targets,
            cut: CutBuffers { uniform: &init(device, &[cut], BufferUsages::UNIFORM), surfaces: &surfaces },
            hits: &hits,
        },
        control_points: &prepared.control_points,
        planes: &prepared.planes,
        values: &prepared.values.view,
        pages: None,
        labels: labels.as_ref().map(|texture| &texture.view),
    };
    let mode = ClassifyMode {
        light: false,
        composite: CompositeMode { compositing: scene.splatting.compositing, rays: rays.mode(scene) },
        gradient: scene.shading.gradient,
        labels: labels.is_some(),
        holes: prepared.has_holes(),
        page_bits: 0,
        channels: 1,
        own_colors: false,
        segments: scene.splatting.segments(),
    };
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
    let resolve = |color: [f32; 4]| resolved(scene.splatting.compositing, DVec4::from(color.map(f64::from)));
    (colors.into_iter().map(resolve).collect(), contents(prepared.gpu, &hits))
}

/// The depths that the values of a texture of [`DepthRange::Standard`] stand for.
fn depths_of(view: &ViewGeometry, [near, far]: [f64; 2]) -> SurfaceDepths {
    let (a, b) = (far / (far - near), -near * far / (far - near));
    let (depth, w) = match view.perspective {
        None => (DVec4::new(0.0, 0.0, far - near, near), DVec4::W),
        Some(_) => (DVec4::W * b, DVec4::new(0.0, 0.0, 1.0, -a)),
    };
    SurfaceDepths { depth, w, none: 1.0 }
}

/// What cuts rays beside the scene's planes, and first hits.
#[derive(Clone, Copy, Debug, Default)]
struct Rays<'a> {
    surfaces: Option<&'a [f64]>,
    first_hit: Option<f64>,
}

impl Rays<'_> {
    fn mode(&self, scene: &Scene) -> RayMode {
        RayMode { cut: self.surfaces.is_some() || !scene.clip.is_empty(), first_hit: self.first_hit.is_some() }
    }
}

fn check(prepared: &Prepared<'_>, twin: &Frame<'_>) {
    check_rays(prepared, twin, Rays::default(), 110.0);
}

fn check_rays(prepared: &Prepared<'_>, twin: &Frame<'_>, rays: Rays<'_>, least: f64) {
    let Prepared { scene, name, .. } = prepared;
    let (compositing, order) = (scene.splatting.compositing, scene.splatting.order);
    let name = format!("{name}, {compositing:?}, {order:?}, {:?}", rays.mode(scene));
    let (found, hits) = classified(prepared, twin, rays);
    let expected: Vec<DVec4> = twin.composite().iter().map(|pixel| pixel.color).collect();
    let shown = expected.iter().filter(|color| color.w > 0.02).count();
    assert!(shown * 20 > expected.len(), "{name}: {shown} pixels");
    let errors: Vec<f64> = found.iter().zip(&expected).map(|(found, expected)| apart(*found, *expected)).collect();
    let (rms, worst) = (root_mean_square(errors.iter().copied()), largest(errors.iter().copied()));
    println!("{name}: {:.1} dB, at most {worst:.1e}", decibels(rms));
    assert_at_least(decibels(rms), least, &name);
    assert_at_most(worst, if least < 110.0 { 1e-2 } else { 1e-4 }, &name);
    if rays.first_hit.is_some() {
        let hits = assert_hits(prepared, twin, &hits, &name);
        assert!(hits > 20, "{name}: {hits} hits");
    }
}

/// With the kernel's gradient, of which rounding leaves fewer digits.
#[test]
fn pixels_with_the_kernels_gradient_are_the_twins() {
    let gpu = gpu();
    for (compositing, projection) in
        [Compositing::Linear, Compositing::Exponential, Compositing::Maximum, Compositing::Surface]
            .into_iter()
            .zip([None, Some(PERSPECTIVE)].into_iter().cycle())
    {
        let mut scene = shown_by(compositing, projection);
        scene.shading.gradient = Gradient::Kernel;
        let volume = head([1.0, 0.8, 1.6], false);
        let kernel = |prepared: &Prepared<'_>, twin: &Frame<'_>| check_rays(prepared, twin, Rays::default(), 90.0);
        with_case(gpu, ("the kernel's gradient", &volume, &scene), kernel);
    }
}

/// Rays that planes, a box and a host's surface cut, with first hits.
#[test]
fn cut_pixels_and_first_hits_are_the_twins() {
    let gpu = gpu();
    for (compositing, projection) in
        COMPOSITINGS.into_iter().flat_map(|compositing| [None, Some(PERSPECTIVE)].map(|eye| (compositing, eye)))
    {
        let volume = head([1.0, 0.8, 1.6], false);
        let mut scene = shown_by(compositing, projection);
        cut(&mut scene);
        let middle = if projection.is_some() { 34.0 / 0.8 } else { 0.0 };
        let [width, height] = [scene.image.width, scene.image.height];
        let wavy = |at: u32| match (f64::from(at % width) * 0.3).sin() {
            gap if gap > 0.8 => f64::INFINITY,
            wave => middle + 3.0 + 2.0 * wave,
        };
        let depths: Vec<f64> = (0..width * height).map(wavy).collect();
        let first_hit = (compositing != Compositing::Minimum).then_some(0.15);
        let host = Host { surfaces: Some(&depths), first_hit };
        let rays = Rays { surfaces: Some(&depths), first_hit };
        let check = |prepared: &Prepared<'_>, twin: &Frame<'_>| check_rays(prepared, twin, rays, 90.0);
        with_host(gpu, host, ("cut", &volume, &scene), check);
    }
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
            let mut scene = shown_by(compositing, projection);
            // A surface is only drawn front to back.
            let is_reversed = !has_holes && compositing != Compositing::Surface;
            scene.splatting.order = if is_reversed { Order::BackToFront } else { Order::FrontToBack };
            with_case(gpu, (name, &volume, &scene), check);
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
    scene.channels[0].transfer.gradient_opacity = Some(Ramp::new(vec![(0.0, 0.1), (40.0, 1.0)]).unwrap());
    let tables =
        LabelTables { opacity: Some(Ramp::new(vec![(60.0, 0.0), (90.0, 0.9)]).unwrap()), ..LabelTables::default() };
    scene.channels[0].transfer.labels.insert(1, tables);
    for compositing in [Compositing::Linear, Compositing::Surface] {
        scene.splatting.compositing = compositing;
        with_case(gpu, ("labels", &volume, &scene), check);
    }
}
