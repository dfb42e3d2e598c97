//! Lays the compositing buffer over the background, into the target.

use wgpu::{
    BindGroup, BindGroupLayout, Buffer, CommandEncoder, Device, RenderPassTimestampWrites, RenderPipeline,
    ShaderStages, TextureFormat, TextureView,
};

use crate::gpu::bindings::{bind, layout, storage, uniform};
use crate::gpu::layout::{Band, Frame};
use crate::gpu::shaders;
use crate::gpu::targets::BandBuffer;

/// The stage's pipeline.
#[derive(Debug)]
pub struct Resolve {
    layout: BindGroupLayout,
    pipeline: RenderPipeline,
}

impl Resolve {
    /// Compiles the stage for targets of the given format.
    pub fn new(device: &Device, target_format: TextureFormat) -> Self {
        let stage = ShaderStages::FRAGMENT;
        let (layout, pipeline_layout) = layout(
            device,
            "sheetsplat.resolve",
            &[uniform::<Frame>(stage, false), uniform::<Band>(stage, false), storage::<[f32; 4]>(stage, true)],
        );
        let module = shaders::RESOLVE.module(device);
        let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("sheetsplat.resolve"),
            layout: Some(&pipeline_layout),
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("vertex"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: None,
            multisample: wgpu::MultisampleState::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some("fragment"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                targets: &[Some(target_format.into())],
            }),
            multiview_mask: None,
            cache: None,
        });
        Self { layout, pipeline }
    }

    /// Binds a band of the compositing buffer.
    pub fn bind(&self, device: &Device, frame: &Buffer, band: &BandBuffer) -> BindGroup {
        let resources = [frame, &band.uniform, &band.acc].map(Buffer::as_entire_binding);
        bind(device, "sheetsplat.resolve", &self.layout, &resources)
    }

    /// Overwrites the target, `width` pixels wide, band by band.
    pub fn record<'a>(
        &self,
        encoder: &mut CommandEncoder,
        timestamp_writes: Option<RenderPassTimestampWrites<'_>>,
        target: &TextureView,
        width: u32,
        bands: impl IntoIterator<Item = (&'a BindGroup, Band)>,
    ) {
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("sheetsplat.resolve"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: target,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                    store: wgpu::StoreOp::Store,
                },
            })],
            timestamp_writes,
            ..wgpu::RenderPassDescriptor::default()
        });
        pass.set_pipeline(&self.pipeline);
        for (group, band) in bands {
            pass.set_scissor_rect(0, band.first_row, width, band.rows);
            pass.set_bind_group(0, group, &[]);
            pass.draw(0..3, 0..1);
        }
    }
}
