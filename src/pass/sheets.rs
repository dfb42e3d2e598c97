//! Sheets as targets of passes that draw quads.

use wgpu::TextureFormat;

use crate::gpu::render_pipeline::Attachments;

/// Blending that adds the drawn colour to the target's, multiplied by a factor.
pub(super) fn added_to(there: wgpu::BlendFactor) -> wgpu::BlendState {
    let component = wgpu::BlendComponent {
        src_factor: wgpu::BlendFactor::One,
        dst_factor: there,
        operation: wgpu::BlendOperation::Add,
    };
    wgpu::BlendState { color: component, alpha: component }
}

/// All sheets of a group.
pub(super) fn sheets_of_a_group(format: TextureFormat, sheets: u32, blend: Option<wgpu::BlendState>) -> Attachments {
    let target = wgpu::ColorTargetState { format, blend, write_mask: wgpu::ColorWrites::ALL };
    Attachments::colors(vec![target; sheets as usize])
}
