//! Draws a slab's kernel sections as instanced footprint quads, added up in the sheet buffer (§3.2).

use std::ops::Range;

use wgpu::{
    BindGroup, BindGroupLayout, Buffer, CommandEncoder, Device, RenderPipeline, ShaderStages, TextureFormat,
    TextureView, TextureViewDimension,
};

use crate::gpu::bindings::{bind, layout, storage, texture, uniform};
use crate::gpu::footprint_texture::FootprintTexture;
use crate::gpu::layout::{Frame, Slab, Splat as SplatRecord};
use crate::gpu::shaders;
use crate::splatting::FootprintForm;

/// The stage's pipelines, one per footprint form.
#[derive(Debug)]
pub struct Splat {
    layout: BindGroupLayout,
    sections: RenderPipeline,
    summed_area: RenderPipeline,
}

/// The part of one list that touches a slab.
#[derive(Clone, Debug)]
pub struct Draw<'a> {
    /// The list's bind group.
    pub group: &'a BindGroup,
    /// Instances: a range of the list's splats.
    pub splats: Range<u32>,
}

impl Splat {
    /// Compiles the stage for sheet buffers of the given format.
    pub fn new(device: &Device, sheet_format: TextureFormat) -> Self {
        let both = ShaderStages::VERTEX_FRAGMENT;
        let (layout, pipeline_layout) = layout(
            device,
            "sheetsplat.splat",
            &[
                uniform::<Frame>(both, false),
                uniform::<Slab>(ShaderStages::VERTEX, true),
                storage::<SplatRecord>(ShaderStages::VERTEX, true),
                texture(both, TextureViewDimension::D2Array),
            ],
        );
        let module = shaders::SPLAT.module(device);
        let add = wgpu::BlendComponent {
            src_factor: wgpu::BlendFactor::One,
            dst_factor: wgpu::BlendFactor::One,
            operation: wgpu::BlendOperation::Add,
        };
        let pipeline = |form: FootprintForm| {
            let constants = [("SECTIONS", f64::from(u8::from(form == FootprintForm::Sections)))];
            let compilation_options = wgpu::PipelineCompilationOptions {
                constants: &constants,
                ..wgpu::PipelineCompilationOptions::default()
            };
            device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some("sheetsplat.splat"),
                layout: Some(&pipeline_layout),
                vertex: wgpu::VertexState {
                    module: &module,
                    entry_point: Some("vertex"),
                    compilation_options: compilation_options.clone(),
                    buffers: &[],
                },
                primitive: wgpu::PrimitiveState {
                    topology: wgpu::PrimitiveTopology::TriangleStrip,
                    ..wgpu::PrimitiveState::default()
                },
                depth_stencil: None,
                multisample: wgpu::MultisampleState::default(),
                fragment: Some(wgpu::FragmentState {
                    module: &module,
                    entry_point: Some("fragment"),
                    compilation_options,
                    targets: &[Some(wgpu::ColorTargetState {
                        format: sheet_format,
                        blend: Some(wgpu::BlendState { color: add, alpha: add }),
                        write_mask: wgpu::ColorWrites::ALL,
                    })],
                }),
                multiview_mask: None,
                cache: None,
            })
        };
        Self { layout, sections: pipeline(FootprintForm::Sections), summed_area: pipeline(FootprintForm::SummedArea) }
    }

    /// Binds one list's splats. `slabs` holds a [`Slab`] at every dynamic offset that will be drawn.
    pub fn bind(
        &self,
        device: &Device,
        frame: &Buffer,
        slabs: &Buffer,
        splats: &Buffer,
        footprints: &FootprintTexture,
    ) -> BindGroup {
        let slab =
            wgpu::BufferBinding { buffer: slabs, offset: 0, size: wgpu::BufferSize::new(size_of::<Slab>() as u64) };
        let resources = [
            frame.as_entire_binding(),
            wgpu::BindingResource::Buffer(slab),
            splats.as_entire_binding(),
            wgpu::BindingResource::TextureView(&footprints.view),
        ];
        bind(device, "sheetsplat.splat", &self.layout, &resources)
    }

    /// Clears the sheet buffer and adds the given splats' sections of the slab at `slab_offset`.
    pub fn record<'a>(
        &self,
        encoder: &mut CommandEncoder,
        form: FootprintForm,
        sheet: &TextureView,
        slab_offset: u32,
        draws: impl IntoIterator<Item = Draw<'a>>,
    ) {
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("sheetsplat.splat"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: sheet,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                    store: wgpu::StoreOp::Store,
                },
            })],
            ..wgpu::RenderPassDescriptor::default()
        });
        pass.set_pipeline(match form {
            FootprintForm::Sections => &self.sections,
            FootprintForm::SummedArea => &self.summed_area,
        });
        for Draw { group, splats } in draws {
            pass.set_bind_group(0, group, &[slab_offset]);
            pass.draw(0..4, splats);
        }
    }
}
