//! Composites the sheet buffer into the compositing buffer (eq. 2).

use wgpu::{
    BindGroup, BindGroupLayout, Buffer, CommandEncoder, ComputePipeline, Device, ShaderStages, TextureView,
    TextureViewDimension,
};

use crate::gpu::bindings::{bind, layout, storage, texture, uniform};
use crate::gpu::layout::{Band, Frame};
use crate::gpu::shaders;
use crate::gpu::targets::BandBuffer;

/// The stage's pipeline.
#[derive(Debug)]
pub struct Composite {
    layout: BindGroupLayout,
    pipeline: ComputePipeline,
}

const TILE: u32 = 16;

impl Composite {
    /// Compiles the stage.
    pub fn new(device: &Device) -> Self {
        let stage = ShaderStages::COMPUTE;
        let (layout, pipeline_layout) = layout(
            device,
            "sheetsplat.composite",
            &[
                uniform::<Frame>(stage, false),
                uniform::<Band>(stage, false),
                texture(stage, TextureViewDimension::D2),
                storage::<[f32; 4]>(stage, false),
            ],
        );
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("sheetsplat.composite"),
            layout: Some(&pipeline_layout),
            module: &shaders::COMPOSITE.module(device),
            entry_point: Some("main"),
            compilation_options: wgpu::PipelineCompilationOptions {
                constants: &[("TILE", f64::from(TILE))],
                ..wgpu::PipelineCompilationOptions::default()
            },
            cache: None,
        });
        Self { layout, pipeline }
    }

    /// Binds a band of the compositing buffer and the sheet buffer.
    pub fn bind(&self, device: &Device, frame: &Buffer, band: &BandBuffer, sheet: &TextureView) -> BindGroup {
        let resources = [
            frame.as_entire_binding(),
            band.uniform.as_entire_binding(),
            wgpu::BindingResource::TextureView(sheet),
            band.acc.as_entire_binding(),
        ];
        bind(device, "sheetsplat.composite", &self.layout, &resources)
    }

    /// Composites the sheet into bands of `width` pixels a row.
    pub fn record<'a>(
        &self,
        encoder: &mut CommandEncoder,
        width: u32,
        bands: impl IntoIterator<Item = (&'a BindGroup, Band)>,
    ) {
        let descriptor = wgpu::ComputePassDescriptor { label: Some("sheetsplat.composite"), timestamp_writes: None };
        let mut pass = encoder.begin_compute_pass(&descriptor);
        pass.set_pipeline(&self.pipeline);
        for (group, band) in bands {
            pass.set_bind_group(0, group, &[]);
            pass.dispatch_workgroups(width.div_ceil(TILE), band.rows.div_ceil(TILE), 1);
        }
    }
}
