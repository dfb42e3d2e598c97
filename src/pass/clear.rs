//! Zeroes the marked tiles of sheet buffers, at the start of the passes that draw quads into them.

use wgpu::{BindGroup, Buffer, Device, RenderPipeline, ShaderStages, TextureFormat};

use super::sheets::sheets_of_a_group;
use crate::gpu::bindings::{Bindings, storage, uniform};
use crate::gpu::layout::{Frame, TileList};
use crate::gpu::render_pipeline::render_pipeline;
use crate::gpu::shaders;

/// The stage's pipeline.
#[derive(Debug)]
pub(super) struct Clear {
    bindings: Bindings,
    pub(super) pipeline: RenderPipeline,
}

impl Clear {
    /// Compiles the stage for some sheets of a format.
    pub(super) fn new(device: &Device, format: TextureFormat, sheets: u32) -> Self {
        let slots = [
            ("frames", uniform::<Frame>(ShaderStages::VERTEX, false)),
            ("composited", storage::<TileList>(ShaderStages::VERTEX, true)),
        ];
        let bindings = Bindings::new(device, shaders::CLEAR, &slots);
        let entry = format!("fragment_{sheets}");
        let attachments = sheets_of_a_group(format, sheets, None);
        let entries = (shaders::CLEAR, ["vertex", &entry]);
        let pipeline = render_pipeline(device, entries, &bindings.pipeline_layout, &attachments, &[]);
        Self { bindings, pipeline }
    }

    /// Binds the list of tiles to zero.
    pub(super) fn bind(&self, device: &Device, frame: &Buffer, tiles: &Buffer) -> BindGroup {
        let resources = [("frames", frame.as_entire_binding()), ("composited", tiles.as_entire_binding())];
        self.bindings.bind(device, &resources)
    }
}
