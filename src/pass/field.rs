//! Draws a list's voxels onto a slab plane as instanced quads that add up in two sheet buffers (SPEC §9).

use std::sync::OnceLock;

use wgpu::{
    BindGroup, Buffer, CommandEncoder, Device, RenderPassTimestampWrites, RenderPipeline, ShaderStages, TextureFormat,
    TextureView,
};

use super::clear::Clear;
use super::sheets::{added_to, sheets_of_a_group};
use super::splat::{quad_indices, record_quads};
use crate::gpu::bindings::{Bindings, at_offset, storage, uniform};
use crate::gpu::layout::{FieldPlanes, FieldVoxel, Frame, Indirect, SheetGroup};
use crate::gpu::render_pipeline::render_pipeline;
use crate::gpu::shaders;
use crate::pass::cull::CullList;
use crate::settings::shading::Gradient;

/// The number of sheet buffers for the sums of a plane.
pub const SHEETS_PER_PLANE: u32 = 2;

/// The stage's pipelines: one that zeroes tiles, and those that draw.
#[derive(Debug)]
pub struct Field {
    clear: Clear,
    bindings: Bindings,
    format: TextureFormat,
    /// Indexed by gradient; each is compiled when it is first needed.
    field: [OnceLock<RenderPipeline>; 2],
    indices: Buffer,
}

impl Field {
    /// Compiles the stage for sheets of the given format.
    pub fn new(device: &Device, format: TextureFormat) -> Self {
        let both = ShaderStages::VERTEX_FRAGMENT;
        let slots = [
            ("frames", uniform::<Frame>(both, false)),
            ("sheet_group", uniform::<SheetGroup>(ShaderStages::VERTEX, true)),
            ("voxels", storage::<FieldVoxel>(ShaderStages::VERTEX, true)),
            ("instances", storage::<u32>(ShaderStages::VERTEX, true)),
            ("args", storage::<Indirect>(ShaderStages::VERTEX, true)),
            ("planes", uniform::<FieldPlanes>(ShaderStages::VERTEX, false)),
        ];
        Self {
            clear: Clear::new(device, format, SHEETS_PER_PLANE),
            bindings: Bindings::new(device, shaders::FIELD, &slots),
            format,
            field: Default::default(),
            indices: quad_indices(device),
        }
    }

    /// Compiles the pipeline for a gradient.
    pub fn prepare(&self, device: &Device, gradient: Gradient) {
        self.field[place_of(gradient)].get_or_init(|| {
            let sheets = sheets_of_a_group(self.format, SHEETS_PER_PLANE, Some(added_to(wgpu::BlendFactor::One)));
            let constants = [("KERNEL_GRADIENT", f64::from(u8::from(gradient == Gradient::Kernel)))];
            let entries = (shaders::FIELD, ["vertex", "fragment"]);
            render_pipeline(device, entries, &self.bindings.pipeline_layout, &sheets, &constants)
        });
    }

    /// Binds the list of tiles to zero.
    pub fn bind_clear(&self, device: &Device, frame: &Buffer, tiles: &Buffer) -> BindGroup {
        self.clear.bind(device, frame, tiles)
    }

    /// Binds one list's voxels. `groups` holds a [`SheetGroup`] at every dynamic offset that will be drawn.
    pub fn bind(&self, device: &Device, [frame, groups, planes]: [&Buffer; 3], list: &CullList) -> BindGroup {
        let resources = [
            ("frames", frame.as_entire_binding()),
            ("sheet_group", at_offset::<SheetGroup>(groups)),
            ("voxels", list.splats.as_entire_binding()),
            ("instances", list.instances.as_entire_binding()),
            ("args", list.draw_args.as_entire_binding()),
            ("planes", planes.as_entire_binding()),
        ];
        self.bindings.bind(device, &resources)
    }

    /// Zeroes the listed tiles of the sheet buffers, then adds the given lists' voxels: for every list its bind group, the group's offset,
    /// and the arguments of its draw.
    pub fn record<'a>(
        &self,
        encoder: &mut CommandEncoder,
        timestamp_writes: Option<RenderPassTimestampWrites<'_>>,
        gradient: Gradient,
        sheets: &[TextureView],
        (clear_group, tiles): (&BindGroup, &Buffer),
        lists: impl IntoIterator<Item = (&'a BindGroup, u32, &'a Buffer)>,
    ) {
        let Some(field) = self.field[place_of(gradient)].get() else { return };
        let pass = ("sheetsplat.field", timestamp_writes, sheets, &self.indices);
        record_quads(encoder, pass, (&self.clear, clear_group, tiles), field, lists);
    }
}

/// The place of a gradient's pipeline.
fn place_of(gradient: Gradient) -> usize {
    usize::from(gradient == Gradient::Kernel)
}
