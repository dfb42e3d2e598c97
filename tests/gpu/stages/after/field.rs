//! `shaders/field.wgsl`: sums of kernels on slab planes, as the field and its gradient.

use std::cell::RefCell;

use bytemuck::Zeroable;
use glam::{DVec3, DVec4};
use sheetsplat::headless::readback;
use sheetsplat::internals::brick::BrickList;
use sheetsplat::internals::gpu::brick_lists::BrickLists;
use sheetsplat::internals::gpu::layout::{FieldVoxel, SheetGroup};
use sheetsplat::internals::gpu::volume_texture::VolumeTexture;
use sheetsplat::internals::pass::cull::{Cull, CullBuffers, CullList};
use sheetsplat::internals::pass::field::{Field, SHEETS_PER_PLANE};
use sheetsplat::internals::plane_geometry::PlaneGeometry;
use sheetsplat::internals::quad_plan::tile_grid;
use sheetsplat::internals::reference::after::{Frame, Sample};
use sheetsplat::settings::Gradient;
use sheetsplat::volume::{Grid, ValueSlice};
use sheetsplat::wgpu::{self, BufferUsages, TextureFormat, TextureUsages};

use super::values::records;
use super::{Prepared, each_case};
use crate::common::compare::{assert_at_least, assert_at_most};
use crate::common::devices::gpu;
use crate::common::pixels;
use crate::stages::{at_offsets, indirect, init, tile_list};

/// The two sheets of a plane, with the sums of all records.
fn sums(prepared: &Prepared<'_>, list: &RefCell<CullList>, records: &[FieldVoxel], near: f64) -> [Vec<DVec4>; 2] {
    let (device, queue) = (prepared.gpu.device(), prepared.gpu.queue());
    let stage = Field::new(device, TextureFormat::Rgba32Float);
    let size = prepared.view.size;
    let sheets = [(); SHEETS_PER_PLANE as usize].map(|()| {
        device.create_texture(&wgpu::TextureDescriptor {
            label: Some("sheet"),
            size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: TextureFormat::Rgba32Float,
            usage: TextureUsages::RENDER_ATTACHMENT | TextureUsages::COPY_SRC | TextureUsages::COPY_DST,
            view_formats: &[],
        })
    });
    // The plane is not at the first offset.
    let of = |near| SheetGroup { near, ..SheetGroup::zeroed() };
    let (groups, offset) = at_offsets(device, &[of(1e9), of(near as f32)]);
    let [columns, rows] = tile_grid(size);
    let tiles = tile_list(device, &(0..columns * rows).collect::<Vec<_>>());
    let clear = stage.bind_clear(device, &prepared.frame, &tiles);
    let places: Vec<u32> = prepared.voxels().keys().copied().collect();
    let args = init(device, &[indirect(places.len() as u32)], BufferUsages::INDIRECT | BufferUsages::STORAGE);
    let group = {
        let mut list = list.borrow_mut();
        list.splats = init(device, records, BufferUsages::STORAGE);
        list.instances = init(device, &places, BufferUsages::STORAGE);
        list.draw_args = args.clone();
        stage.bind(device, [&prepared.frame, &groups, &prepared.planes], &list)
    };
    let views: Vec<_> = sheets.iter().map(|sheet| sheet.create_view(&wgpu::TextureViewDescriptor::default())).collect();
    let gradient = prepared.scene.shading.gradient;
    stage.prepare(device, gradient);
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    stage.record(&mut encoder, None, gradient, &views, (&clear, &tiles), [(&group, offset, &args)]);
    queue.submit([encoder.finish()]);
    sheets.each_ref().map(|sheet| pixels(&readback::texture(device, queue, sheet).unwrap()))
}

/// A list whose records, instances and arguments [`sums`] replaces.
fn any_list(prepared: &Prepared<'_>) -> CullList {
    let device = prepared.gpu.device();
    let any = |usage| init(device, &[0_u8; 1024], usage);
    let (storage, uniform) = (any(BufferUsages::STORAGE), any(BufferUsages::UNIFORM));
    let buffers = CullBuffers {
        light: None,
        frame: &uniform,
        groups: &uniform,
        values: &VolumeTexture::upload(device, prepared.gpu.queue(), ValueSlice::F32(&[0.0])).unwrap().view,
        pages: None,
        has_holes: false,
        channels: 1,
        colors: None,
        labels: None,
        membership: None,
        control_points: &storage,
        occluded: &storage,
        culled: &storage,
        planes: None,
    };
    let grid = Grid::new(glam::UVec3::ONE, DVec3::ONE);
    let lists = BrickLists::upload(device, BrickList::new(&grid, &[0]));
    Cull::new(device, 1).prepare(device, buffers, &lists.lists[0], &storage, (1, 1), None).unwrap()
}

/// The field of a pixel from its sums (SPEC §9), in values and world units; `None` without a value.
fn sample(prepared: &Prepared<'_>, first: DVec4, second: DVec4) -> Option<Sample> {
    let Prepared { numbers, volume, scene, .. } = prepared;
    let grid = volume.grid();
    if first.x < 1e-3 {
        return None;
    }
    let number = first.y / first.x;
    let sums = DVec3::new(first.z, first.w, second.x);
    let gradient = if scene.shading.gradient == Gradient::Kernel {
        let moment = DVec3::new(second.y, second.z, second.w) - number * sums;
        let axes = PlaneGeometry::new(&prepared.view, grid).axes;
        let in_grid = axes[0] * moment.x + axes[1] * moment.y + axes[2] * moment.z;
        -2.0 * scene.splatting.falloff / first.x * in_grid / grid.spacing
    } else {
        sums / first.x / grid.unit()
    };
    Some(Sample { value: number / numbers.scale + numbers.base, gradient: gradient / numbers.scale })
}

fn check(prepared: &Prepared<'_>, twin: &Frame<'_>) {
    let Prepared { view, volume, scene, name, .. } = prepared;
    let places: Vec<u32> = prepared.voxels().keys().copied().collect();
    let records = records(prepared, &places);
    let list = RefCell::new(any_list(prepared));
    let range = twin.field().range();
    let spread = range[1] - range[0];
    let planes = prepared.reached_planes();
    let (mut seen, mut disagreeing) = (0, 0);
    let (mut values, mut gradients, mut steepest) = (0.0, 0.0, 0.0_f64);
    for plane in planes.clone().step_by(3) {
        let [first, second] = sums(prepared, &list, &records, view.slabs.plane(plane));
        for ((first, second), expected) in first.iter().zip(&second).zip(twin.plane_field(plane)) {
            let found = sample(prepared, *first, *second);
            // The nearest voxel's hole is the next stage's to see.
            let (Some(found), Some(expected)) = (found, expected) else {
                disagreeing += usize::from(found.is_some() != expected.is_some() && !prepared.has_holes());
                continue;
            };
            seen += 1;
            // Rounding decides at the rim of a kernel, and there a voxel's weight jumps to 0.
            let jump = (-scene.splatting.falloff * scene.splatting.radius.powi(2)).exp() / first.x;
            let error = (found.value - expected.value).abs() / spread;
            assert_at_most(error, 2.0 * jump + 1e-5 / first.x.min(1.0), format_args!("{name}: plane {plane}"));
            values += error * error;
            gradients += (found.gradient - expected.gradient).length_squared();
            steepest = steepest.max(expected.gradient.length());
        }
    }
    assert!(seen > planes.len() * volume.dims().x as usize * 3, "{name}: {seen} pixels");
    assert!(disagreeing * 500 <= seen, "{name}: {disagreeing} of {seen} pixels have a value only here or there");
    assert!(steepest > 0.0, "{name}: no gradient");
    let decibels = |sum: f64, most: f64| -10.0 * (sum / f64::from(seen as u32) / (most * most)).log10();
    let (of_values, of_gradients) = (decibels(values, 1.0), decibels(gradients, steepest));
    println!("{name}: values {of_values:.1} dB, gradients {of_gradients:.1} dB");
    assert_at_least(of_values, 120.0, format_args!("{name}: values"));
    assert_at_least(of_gradients, 100.0, format_args!("{name}: gradients"));
}

#[test]
fn planes_are_the_twins() {
    each_case(gpu(), check);
}
