//! Shorthand for render pipelines without vertex buffers.

use wgpu::{ColorTargetState, DepthStencilState, Device, MultisampleState, PipelineLayout, RenderPipeline};

use super::shaders::Shader;

/// The attachments that a pipeline draws into.
#[derive(Clone, Debug)]
pub struct Attachments {
    /// Formats and blending.
    pub colors: Vec<Option<ColorTargetState>>,
    /// The pass's depth attachment.
    pub depth: Option<DepthStencilState>,
    /// The number of samples per pixel.
    pub samples: u32,
}

impl Attachments {
    /// Only colours, with one sample per pixel.
    pub fn colors(colors: impl IntoIterator<Item = ColorTargetState>) -> Self {
        Self { colors: colors.into_iter().map(Some).collect(), depth: None, samples: 1 }
    }
}

/// Compiles a pipeline that draws triangles with a shader's vertex and fragment entry points and pipeline constants.
pub fn render_pipeline(
    device: &Device,
    (shader, [vertex, fragment]): (Shader, [&str; 2]),
    layout: &PipelineLayout,
    attachments: &Attachments,
    constants: &[(&str, f64)],
) -> RenderPipeline {
    let label = format!("sheetsplat.{}", shader.stage);
    let module = shader.module(device);
    let compilation_options =
        wgpu::PipelineCompilationOptions { constants, ..wgpu::PipelineCompilationOptions::default() };
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(&label),
        layout: Some(layout),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some(vertex),
            compilation_options: compilation_options.clone(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: attachments.depth.clone(),
        multisample: MultisampleState { count: attachments.samples, ..MultisampleState::default() },
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some(fragment),
            compilation_options,
            targets: &attachments.colors,
        }),
        multiview_mask: None,
        cache: None,
    })
}
