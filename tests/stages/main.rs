//! Every GPU stage against its f64 twin in `sheetsplat::reference`, one stage at a time, in float.
#![expect(clippy::unwrap_used, reason = "tests")]

#[path = "../common/mod.rs"]
mod common;
mod composite;
mod plan;
mod resolve;
mod shade;
mod splat;

use glam::{DVec3, UVec3};
use sheetsplat::gpu::uniforms::{self, Ramps};
use sheetsplat::kernel::Kernel;
use sheetsplat::plan::View;
use sheetsplat::scene::Scene;
use sheetsplat::transfer_function::TransferFunction;
use sheetsplat::volume::Grid;
use sheetsplat::wgpu::util::DeviceExt;
use sheetsplat::wgpu::{self, BufferUsages};

/// The uniform buffer of a frame, for stages that see nothing of the volume but it.
fn frame_buffer(device: &wgpu::Device, adjust: impl FnOnce(&mut Scene)) -> wgpu::Buffer {
    let mut scene = common::scene(64, 64);
    adjust(&mut scene);
    uniform_buffer(device, &Grid { dims: UVec3::splat(9), spacing: DVec3::ONE }, &scene)
}

/// The uniform buffer of a frame over a grid, with ramps that are 1 everywhere.
fn uniform_buffer(device: &wgpu::Device, grid: &Grid, scene: &Scene) -> wgpu::Buffer {
    let size = [scene.image.width, scene.image.height];
    let view = View::new(grid, &scene.camera, &scene.splatting, size).unwrap();
    let kernel = Kernel::new(scene.splatting.radius, scene.splatting.falloff);
    let transfer = common::transfer(&[(0.0, [1.0; 3])], &[(0.0, 1.0)]);
    let (color, opacity) = (transfer.color.unwrap(), transfer.opacity.unwrap());
    let ramps = Ramps::new(&TransferFunction { color, opacity, gradient_opacity: None, iso_ranges: None });
    let frame = uniforms::frame(&view, &kernel, grid, &ramps, scene);
    device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: Some("frame"),
        contents: bytemuck::bytes_of(&frame),
        usage: BufferUsages::UNIFORM,
    })
}
