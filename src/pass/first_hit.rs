//! Writes the depths of first hits into a texture.

use wgpu::{
    BindGroup, Buffer, BufferBinding, CommandEncoder, Device, RenderPipeline, ShaderStages, Texture, TextureFormat,
    TextureUsages, TextureView,
};

use super::composite::CutBuffers;
use crate::gpu::bindings::{Bindings, depth_texture, storage, uniform};
use crate::gpu::layout::{Cut, Frame};
use crate::gpu::render_pipeline::{Attachments, render_pipeline};
use crate::gpu::shaders;

/// The format of depths, one per pixel.
pub const FORMAT: TextureFormat = TextureFormat::R32Float;

/// The stage's pipeline.
#[derive(Debug)]
pub struct FirstHit {
    bindings: Bindings,
    pipeline: RenderPipeline,
}

impl FirstHit {
    /// Compiles the stage.
    pub fn new(device: &Device) -> Self {
        let stage = ShaderStages::FRAGMENT;
        let slots = [
            ("frames", uniform::<Frame>(stage, false)),
            ("cut", uniform::<Cut>(stage, false)),
            ("surfaces", depth_texture(stage)),
            ("hits", storage::<u32>(stage, true)),
        ];
        let bindings = Bindings::new(device, shaders::FIRST_HIT, &slots);
        let attachments = Attachments::colors([FORMAT.into()]);
        let shader = (shaders::FIRST_HIT, ["vertex", "fragment"]);
        let pipeline = render_pipeline(device, shader, &bindings.pipeline_layout, &attachments, &[]);
        Self { bindings, pipeline }
    }

    /// A texture for the depths of an image.
    pub fn texture(device: &Device, [width, height]: [u32; 2]) -> Texture {
        device.create_texture(&wgpu::TextureDescriptor {
            label: Some("sheetsplat.first_hits"),
            size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: FORMAT,
            usage: TextureUsages::RENDER_ATTACHMENT | TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_SRC,
            view_formats: &[],
        })
    }

    /// Binds the words of first hits, which start at a byte offset in their buffer.
    pub fn bind(
        &self,
        device: &Device,
        frame: &Buffer,
        cut: CutBuffers<'_>,
        (hits, offset): (&Buffer, u64),
    ) -> BindGroup {
        let resources = [
            ("frames", frame.as_entire_binding()),
            ("cut", cut.uniform.as_entire_binding()),
            ("surfaces", wgpu::BindingResource::TextureView(cut.surfaces)),
            ("hits", wgpu::BindingResource::Buffer(BufferBinding { buffer: hits, offset, size: None })),
        ];
        self.bindings.bind(device, &resources)
    }

    /// Overwrites the whole texture.
    pub fn record(&self, encoder: &mut CommandEncoder, group: &BindGroup, target: &TextureView) {
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("sheetsplat.first_hit"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: target,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                    store: wgpu::StoreOp::Store,
                },
            })],
            ..wgpu::RenderPassDescriptor::default()
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, group, &[]);
        pass.draw(0..3, 0..1);
    }
}
