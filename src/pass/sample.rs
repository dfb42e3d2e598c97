//! Draws whole kernels one by one into one buffer, each composited by itself: composite-every-sample (§3, Westover's first form).

use std::sync::OnceLock;

use wgpu::{
    BindGroup, Buffer, CommandEncoder, Device, RenderPassTimestampWrites, RenderPipeline, TextureFormat, TextureView,
};

use super::sheets::{added_to, sheets_of_a_group};
use super::splat::{quad_indices, splat_slots};
use crate::geometry::footprint::{SUMMED_AREA_LAYERS, SUMMED_AREA_SIZE};
use crate::gpu::bindings::{Bindings, at_offset};
use crate::gpu::footprint_texture::FootprintTexture;
use crate::gpu::layout::{QUADS, SheetGroup};
use crate::gpu::render_pipeline::render_pipeline;
use crate::gpu::shaders;
use crate::settings::splatting::{Compositing, FootprintForm};

/// The stage's pipelines, each compiled when it is first needed.
#[derive(Debug)]
pub struct Sample {
    bindings: Bindings,
    format: TextureFormat,
    /// Indexed by footprint form, and by whether samples are composited or summed.
    pipelines: [[OnceLock<RenderPipeline>; 2]; 2],
    indices: Buffer,
}

/// The mode that a pipeline is compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SampleMode {
    /// How footprints are stored.
    pub form: FootprintForm,
    /// How samples are composited.
    pub compositing: Compositing,
}

/// The stage's buffers.
#[derive(Clone, Copy, Debug)]
pub struct SampleBuffers<'a> {
    /// One [`Frame`](crate::gpu::layout::Frame).
    pub frame: &'a Buffer,
    /// One [`SheetGroup`] of a single sheet that contains all kernels.
    pub group: &'a Buffer,
    /// `[Splat]`.
    pub splats: &'a Buffer,
    /// `[u32]`: the splats that are drawn, from back to front.
    pub order: &'a Buffer,
    /// [`Indirect`](crate::gpu::layout::Indirect): the number of splats.
    pub args: &'a Buffer,
    /// The kernel's footprints.
    pub footprints: &'a FootprintTexture,
}

impl Sample {
    /// The stage for a buffer of the given format, with nothing compiled yet.
    pub fn new(device: &Device, format: TextureFormat) -> Self {
        let bindings = Bindings::new(device, shaders::SAMPLE, &splat_slots());
        Self { bindings, format, pipelines: Default::default(), indices: quad_indices(device) }
    }

    fn pipeline(&self, mode: SampleMode) -> &OnceLock<RenderPipeline> {
        &self.pipelines[mode.form as usize][usize::from(mode.compositing.is_by_opacity())]
    }

    /// Compiles the pipeline for a mode, and binds buffers.
    pub fn bind(&self, device: &Device, mode: SampleMode, buffers: SampleBuffers<'_>) -> BindGroup {
        self.pipeline(mode).get_or_init(|| {
            let over = added_to(match mode.compositing.is_by_opacity() {
                true => wgpu::BlendFactor::OneMinusSrcAlpha,
                false => wgpu::BlendFactor::One,
            });
            let constants = [
                ("SECTIONS", f64::from(u8::from(mode.form == FootprintForm::Sections))),
                ("SHEETS", 1.0),
                ("PLANE_TEXELS", f64::from(SUMMED_AREA_SIZE)),
                ("LAYERS", f64::from(SUMMED_AREA_LAYERS)),
            ];
            let shader = (shaders::SAMPLE, ["vertex", "fragment"]);
            let sheet = sheets_of_a_group(self.format, 1, Some(over));
            render_pipeline(device, shader, &self.bindings.pipeline_layout, &sheet, &constants)
        });
        let SampleBuffers { frame, group, splats, order, args, footprints } = buffers;
        let resources = [
            ("frames", frame.as_entire_binding()),
            ("sheet_group", at_offset::<SheetGroup>(group)),
            ("splats", splats.as_entire_binding()),
            ("instances", order.as_entire_binding()),
            ("args", args.as_entire_binding()),
            ("footprints", wgpu::BindingResource::TextureView(&footprints.view)),
        ];
        self.bindings.bind(device, &resources)
    }

    /// Draws `count` kernels into a cleared `target`, in the mode that the group was bound for.
    pub fn record(
        &self,
        encoder: &mut CommandEncoder,
        timestamp_writes: Option<RenderPassTimestampWrites<'_>>,
        (mode, group): (SampleMode, &BindGroup),
        target: &TextureView,
        count: u32,
    ) {
        let Some(pipeline) = self.pipeline(mode).get() else { return };
        let ops = wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT), store: wgpu::StoreOp::Store };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("sheetsplat.sample"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: target,
                depth_slice: None,
                resolve_target: None,
                ops,
            })],
            timestamp_writes,
            ..wgpu::RenderPassDescriptor::default()
        });
        pass.set_index_buffer(self.indices.slice(..), wgpu::IndexFormat::Uint16);
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, group, &[0]);
        pass.draw_indexed(0..6 * u32::from(QUADS), 0, 0..count.div_ceil(u32::from(QUADS)));
    }
}
