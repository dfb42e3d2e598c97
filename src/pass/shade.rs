//! Projects and shades the voxels of a list, once each, in bucket order.

use wgpu::{BindGroup, BindGroupLayout, Buffer, CommandEncoder, ComputePipeline, Device, ShaderStages};

use crate::gpu::bindings::{bind, layout, storage, uniform};
use crate::gpu::layout::{Frame, Splat, Voxel};
use crate::gpu::shaders;

/// The stage's pipeline.
#[derive(Debug)]
pub struct Shade {
    layout: BindGroupLayout,
    pipeline: ComputePipeline,
}

/// The buffers the stage works on.
#[derive(Clone, Copy, Debug)]
pub struct ShadeBuffers<'a> {
    /// One [`Frame`], uniform.
    pub frame: &'a Buffer,
    /// `[Voxel]`.
    pub voxels: &'a Buffer,
    /// `[u32]`: which voxel each splat is.
    pub order: &'a Buffer,
    /// `[Splat]`, as many as `order` has: the result.
    pub splats: &'a Buffer,
    /// `[vec4f]`: the transfer function's ramps.
    pub control_points: &'a Buffer,
}

const WORKGROUP_SIZE: u32 = 256;

impl Shade {
    /// Compiles the stage.
    pub fn new(device: &Device) -> Self {
        let stage = ShaderStages::COMPUTE;
        let (layout, pipeline_layout) = layout(
            device,
            "sheetsplat.shade",
            &[
                uniform::<Frame>(stage, false),
                storage::<Voxel>(stage, true),
                storage::<u32>(stage, true),
                storage::<Splat>(stage, false),
                storage::<[f32; 4]>(stage, true),
            ],
        );
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("sheetsplat.shade"),
            layout: Some(&pipeline_layout),
            module: &shaders::SHADE.module(device),
            entry_point: Some("main"),
            compilation_options: wgpu::PipelineCompilationOptions {
                constants: &[("WORKGROUP_SIZE", f64::from(WORKGROUP_SIZE))],
                ..wgpu::PipelineCompilationOptions::default()
            },
            cache: None,
        });
        Self { layout, pipeline }
    }

    /// Binds the stage's buffers.
    pub fn bind(&self, device: &Device, buffers: ShadeBuffers<'_>) -> BindGroup {
        let ShadeBuffers { frame, voxels, order, splats, control_points } = buffers;
        let resources = [frame, voxels, order, splats, control_points].map(Buffer::as_entire_binding);
        bind(device, "sheetsplat.shade", &self.layout, &resources)
    }

    /// Shades `count` splats. `max_groups` is the device's limit per dispatch dimension.
    pub fn record(&self, encoder: &mut CommandEncoder, group: &BindGroup, count: u32, max_groups: u32) {
        let groups = count.div_ceil(WORKGROUP_SIZE);
        let columns = groups.min(max_groups);
        let descriptor = wgpu::ComputePassDescriptor { label: Some("sheetsplat.shade"), timestamp_writes: None };
        let mut pass = encoder.begin_compute_pass(&descriptor);
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, group, &[]);
        pass.dispatch_workgroups(columns, groups.div_ceil(columns.max(1)), 1);
    }
}
