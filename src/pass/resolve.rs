//! Composites the compositing buffer over the background, into the host's target.

use wgpu::{BindGroup, Buffer, Device, RenderPass, RenderPipeline, ShaderStages};

use crate::gpu::bindings::{Bindings, storage, uniform};
use crate::gpu::layout::{Band, Frame};
use crate::gpu::options::RendererOptions;
use crate::gpu::placement::Placement;
use crate::gpu::render_pipeline::{Attachments, render_pipeline};
use crate::gpu::shaders;
use crate::gpu::targets::BandBuffer;

/// The stage's pipeline.
#[derive(Debug)]
pub struct Resolve {
    bindings: Bindings,
    pipeline: RenderPipeline,
}

/// A bias that makes both numbers of an origin non-negative; `shaders/resolve.wgsl` subtracts it. No texture is wider than 32768 pixels.
const ORIGIN_BIAS: i32 = 32767;

impl Resolve {
    /// Compiles the stage for targets with these options.
    pub fn new(device: &Device, options: &RendererOptions) -> Self {
        let stage = ShaderStages::FRAGMENT;
        let slots = [
            ("frames", uniform::<Frame>(stage, false)),
            ("band", uniform::<Band>(stage, false)),
            ("acc", storage::<[f32; 4]>(stage, true)),
        ];
        let bindings = Bindings::new(device, shaders::RESOLVE, &slots);
        let attachments = Attachments {
            colors: vec![Some(wgpu::ColorTargetState {
                format: options.target_format,
                blend: options.blend_state(),
                write_mask: wgpu::ColorWrites::ALL,
            })],
            // The pass may have a depth attachment, which is neither tested nor written.
            depth: options.depth_format.map(|format| wgpu::DepthStencilState {
                format,
                depth_write_enabled: Some(false),
                depth_compare: Some(wgpu::CompareFunction::Always),
                stencil: wgpu::StencilState::default(),
                bias: wgpu::DepthBiasState::default(),
            }),
            samples: options.sample_count,
        };
        let shader = (shaders::RESOLVE, ["vertex", "fragment"]);
        let constants = [("LINEAR_LIGHT", f64::from(u8::from(options.is_linear())))];
        let pipeline = render_pipeline(device, shader, &bindings.pipeline_layout, &attachments, &constants);
        Self { bindings, pipeline }
    }

    /// Binds a band of the compositing buffer.
    pub fn bind(&self, device: &Device, frame: &Buffer, band: &BandBuffer) -> BindGroup {
        let whole = Buffer::as_entire_binding;
        let resources = [("frames", whole(frame)), ("band", whole(&band.uniform)), ("acc", whole(&band.acc))];
        self.bindings.bind(device, &resources)
    }

    /// Draws an image of the given width and height, band by band, at its placement. Changes the pass's pipeline, bind group 0, viewport and
    /// scissor rectangle.
    pub fn draw<'a>(
        &self,
        pass: &mut RenderPass<'_>,
        [width, height]: [u32; 2],
        bands: impl IntoIterator<Item = (&'a BindGroup, Band)>,
        placement: Placement,
    ) {
        let origin = placement.origin;
        for (group, Band { first_row, rows }) in bands {
            let Some([x, y, covered_width, covered_height]) = placement.covered(width, first_row..first_row + rows)
            else {
                continue;
            };
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, group, &[]);
            pass.set_viewport(origin[0] as f32, origin[1] as f32, width as f32, height as f32, 0.0, 1.0);
            pass.set_scissor_rect(x, y, covered_width, covered_height);
            // The instance index passes the origin, because that needs neither a buffer nor a feature. Origins that do not fit belong to scissors
            // outside the target, which wgpu refuses.
            let [x, y] = origin.map(|at| at.wrapping_add(ORIGIN_BIAS) as u32 & 0xffff);
            let instance = x | y << 16;
            pass.draw(0..3, instance..instance.saturating_add(1));
        }
    }
}
