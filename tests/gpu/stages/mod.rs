//! Every GPU stage against its f64 evaluation in `sheetsplat::internals::reference`, one stage at a time, in float.

mod after;
mod composite;
mod cull;
mod gather;
mod join;
mod kernel_in_view;
mod means;
mod occlude;
mod patch_bins;
mod plan;
mod resolve;
mod sample;
mod section;
mod shade;
mod splat;
mod tiles;
mod values;

use std::collections::BTreeMap;

use glam::{DVec3, UVec3};
use sheetsplat::headless::{GpuHeadless, readback};
use sheetsplat::internals::gpu::layout::{Cut, Frame, Indirect, QUADS, TileList};
use sheetsplat::internals::gpu::ramps::Ramps;
use sheetsplat::internals::gpu::targets::no_surfaces;
use sheetsplat::internals::gpu::uniforms;
use sheetsplat::internals::gpu::volume_texture::ValueFormat;
use sheetsplat::internals::kernel::Kernel;
use sheetsplat::internals::pass::composite::CutBuffers;
use sheetsplat::internals::view_geometry::ViewGeometry;
use sheetsplat::scene::Scene;
use sheetsplat::settings::TransferFunction;
use sheetsplat::volume::Grid;
use sheetsplat::wgpu::util::DeviceExt;
use sheetsplat::wgpu::{self, BindingResource, Buffer, BufferUsages, Device, TextureView};

/// A frame, for stages that use nothing else of the volume.
fn frame(adjust: impl FnOnce(&mut Scene)) -> Frame {
    let mut scene = crate::common::scene(64, 64);
    adjust(&mut scene);
    frame_over(&Grid::new(UVec3::splat(9), DVec3::ONE), &scene)
}

/// A frame over a grid, with ramps that are 1 everywhere.
fn frame_over(grid: &Grid, scene: &Scene) -> Frame {
    let size = [scene.image.width, scene.image.height];
    let view = ViewGeometry::new(grid, &scene.camera, &scene.splatting, size).unwrap();
    let kernel = Kernel::new(scene.splatting.radius, scene.splatting.falloff);
    let transfer = crate::common::transfer(&[(0.0, [1.0; 3])], &[(0.0, 1.0)]);
    let (color, opacity) = (transfer.color.unwrap(), transfer.opacity.unwrap());
    let ramps = Ramps::new(&TransferFunction {
        color,
        opacity,
        gradient_opacity: None,
        iso_ranges: None,
        membership: false,
        labels: BTreeMap::new(),
    });
    uniforms::frame(&view, &kernel, (grid, ValueFormat::Bits), &ramps, scene)
}

/// Buffers for the cut stage that cut nothing.
struct Uncut {
    uniform: Buffer,
    surfaces: TextureView,
}

impl Uncut {
    fn new(device: &Device) -> Self {
        let uniform = init(device, &[0_u32; size_of::<Cut>() / 4], BufferUsages::UNIFORM);
        Self { uniform, surfaces: no_surfaces(device) }
    }

    fn buffers(&self) -> CutBuffers<'_> {
        CutBuffers { uniform: &self.uniform, surfaces: &self.surfaces }
    }
}

/// A buffer with contents.
fn init<T: bytemuck::NoUninit>(device: &Device, contents: &[T], usage: BufferUsages) -> Buffer {
    device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: Some("test"),
        contents: bytemuck::cast_slice(contents),
        usage,
    })
}

/// Uniforms at dynamic offsets: the buffer and the distance between two of them.
fn at_offsets<T: bytemuck::NoUninit>(device: &Device, uniforms: &[T]) -> (Buffer, u32) {
    let stride = size_of::<T>().next_multiple_of(device.limits().min_uniform_buffer_offset_alignment as usize);
    let mut bytes = Vec::new();
    for uniform in uniforms {
        bytes.extend_from_slice(bytemuck::bytes_of(uniform));
        bytes.resize(bytes.len().next_multiple_of(stride), 0);
    }
    (init(device, &bytes, BufferUsages::UNIFORM), stride as u32)
}

/// The arguments that the shaders' `indirect` gives for `count` items: one quad each, 16 per instance, and one workgroup each, at most
/// 32768 in a row.
fn indirect(count: u32) -> Indirect {
    Indirect {
        draw: [6 * u32::from(QUADS), count.div_ceil(u32::from(QUADS)), 0, 0, 0],
        dispatch: [count.min(32768), count.div_ceil(32768), 1],
        count,
    }
}

/// A [`TileList`] of these tiles.
fn tile_list(device: &Device, tiles: &[u32]) -> Buffer {
    let mut bytes = bytemuck::bytes_of(&indirect(tiles.len() as u32)).to_vec();
    bytes.extend_from_slice(bytemuck::cast_slice(tiles));
    bytes.resize(bytes.len().max(size_of::<TileList>()), 0xff);
    init(device, &bytes, BufferUsages::STORAGE | BufferUsages::INDIRECT)
}

/// The contents of a buffer without the usage for copying: a shader copies it.
fn contents<T: bytemuck::Pod>(gpu: &GpuHeadless, buffer: &Buffer) -> Vec<T> {
    const COPY: &str = "
        @group(0) @binding(0) var<storage, read> source: array<u32>;
        @group(0) @binding(1) var<storage, read_write> result: array<u32>;
        @compute @workgroup_size(64)
        fn main(@builtin(global_invocation_id) id: vec3u) {
            let at = id.x + id.y * 64u * 32768u;
            if at < arrayLength(&source) { result[at] = source[at]; }
        }";
    written(gpu, COPY, &[buffer.as_entire_binding()], buffer.size() / 4)
}

/// The words that the `main` of a WGSL source writes into the binding after the given ones; its workgroups have 64 threads, with at most 32768
/// workgroups in a row.
fn written<T: bytemuck::Pod>(gpu: &GpuHeadless, source: &str, given: &[BindingResource<'_>], words: u64) -> Vec<T> {
    let device = gpu.device();
    let result = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("written"),
        size: words * 4,
        usage: BufferUsages::STORAGE | BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    });
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("written"),
        source: wgpu::ShaderSource::Wgsl(source.into()),
    });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some("written"),
        layout: None,
        module: &module,
        entry_point: Some("main"),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    });
    let resources = given.iter().cloned().chain([result.as_entire_binding()]);
    let entries: Vec<_> =
        (0..).zip(resources).map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource }).collect();
    let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("written"),
        layout: &pipeline.get_bind_group_layout(0),
        entries: &entries,
    });
    compute(gpu, |pass| {
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &group, &[]);
        let workgroups = (words as u32).div_ceil(64);
        pass.dispatch_workgroups(workgroups.min(32768), workgroups.div_ceil(32768), 1);
    });
    bytemuck::pod_collect_to_vec::<u8, T>(&readback::buffer(device, gpu.queue(), &result).unwrap())
}

/// Submits a compute pass.
fn compute(gpu: &GpuHeadless, record: impl FnOnce(&mut wgpu::ComputePass<'_>)) {
    let mut encoder = gpu.device().create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    record(&mut encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default()));
    gpu.queue().submit([encoder.finish()]);
}
