//! Draws a group's kernel sections as instanced footprint quads that add up in the sheet buffers (§3.2): one quad per voxel, one colour
//! target per sheet.

use std::sync::OnceLock;

use wgpu::{
    BindGroup, Buffer, CommandEncoder, Device, RenderPassTimestampWrites, RenderPipeline, ShaderStages, TextureFormat,
    TextureView, TextureViewDimension,
};

use super::clear::Clear;
use super::sheets::{added_to, sheets_of_a_group};
use crate::geometry::footprint::{SUMMED_AREA_LAYERS, SUMMED_AREA_SIZE};
use crate::gpu::bindings::{Bindings, Slot, at_offset, storage, texture, uniform, uploaded};
use crate::gpu::footprint_texture::FootprintTexture;
use crate::gpu::layout::{Frame, Indirect, QUADS, SheetGroup, Splat as SplatRecord};
use crate::gpu::render_pipeline::render_pipeline;
use crate::gpu::shaders;
use crate::pass::cull::CullList;
use crate::settings::splatting::FootprintForm;

/// The stage's pipelines: one that zeroes tiles, and those that draw.
#[derive(Debug)]
pub struct Splat {
    clear: Clear,
    bindings: Bindings,
    format: TextureFormat,
    sheets: u32,
    /// Indexed by footprint form, without and with an eye; each is compiled when it is first needed.
    splat: [[OnceLock<RenderPipeline>; 2]; 2],
    /// Two triangles for each quad of an instance.
    indices: Buffer,
}

/// The mode that a pipeline is compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SplatMode {
    /// How sections are stored.
    pub form: FootprintForm,
    /// Whether every voxel has its own ray.
    pub perspective: bool,
}

impl Splat {
    /// Compiles the stage for groups of `sheets` sheets, 1, 2 or 4, in the given format.
    pub fn new(device: &Device, format: TextureFormat, sheets: u32) -> Self {
        Self {
            clear: Clear::new(device, format, sheets),
            bindings: Bindings::new(device, shaders::SPLAT, &splat_slots()),
            format,
            sheets,
            splat: Default::default(),
            indices: quad_indices(device),
        }
    }

    /// The pipeline for a footprint form, without or with an eye.
    fn pipeline(&self, device: &Device, mode: SplatMode) -> &RenderPipeline {
        self.cell(mode).get_or_init(|| {
            let additive = Some(added_to(wgpu::BlendFactor::One));
            let shader = if mode.perspective { shaders::SPLAT_PERSPECTIVE } else { shaders::SPLAT };
            let sheets = self.sheets;
            let entry = format!("fragment_{sheets}");
            let constants = [
                ("SECTIONS", f64::from(u8::from(mode.form == FootprintForm::Sections))),
                ("SHEETS", f64::from(sheets)),
                ("PLANE_TEXELS", f64::from(SUMMED_AREA_SIZE)),
                ("LAYERS", f64::from(SUMMED_AREA_LAYERS)),
            ];
            let targets = sheets_of_a_group(self.format, sheets, additive);
            render_pipeline(device, (shader, ["vertex", &entry]), &self.bindings.pipeline_layout, &targets, &constants)
        })
    }

    fn cell(&self, mode: SplatMode) -> &OnceLock<RenderPipeline> {
        &self.splat[mode.form as usize][usize::from(mode.perspective)]
    }

    /// Binds the list of tiles to zero.
    pub fn bind_clear(&self, device: &Device, frame: &Buffer, tiles: &Buffer) -> BindGroup {
        self.clear.bind(device, frame, tiles)
    }

    /// Compiles the pipeline for a mode.
    pub fn prepare(&self, device: &Device, mode: SplatMode) {
        self.pipeline(device, mode);
    }

    /// Binds one list's splats. `groups` holds a [`SheetGroup`] at every dynamic offset that will be drawn.
    pub fn bind(
        &self,
        device: &Device,
        frame: &Buffer,
        groups: &Buffer,
        list: &CullList,
        footprints: &FootprintTexture,
    ) -> BindGroup {
        let resources = [
            ("frames", frame.as_entire_binding()),
            ("sheet_group", at_offset::<SheetGroup>(groups)),
            ("splats", list.splats.as_entire_binding()),
            ("instances", list.instances.as_entire_binding()),
            ("args", list.draw_args.as_entire_binding()),
            ("footprints", wgpu::BindingResource::TextureView(&footprints.view)),
        ];
        self.bindings.bind(device, &resources)
    }

    /// Zeroes the listed tiles of the sheet buffers, then adds the given lists' sections of a group: for every list its bind group, the group's
    /// offset, and the arguments of its draw.
    pub fn record<'a>(
        &self,
        encoder: &mut CommandEncoder,
        timestamp_writes: Option<RenderPassTimestampWrites<'_>>,
        mode: SplatMode,
        sheets: &[TextureView],
        clear: (&BindGroup, &Buffer),
        lists: impl IntoIterator<Item = (&'a BindGroup, u32, &'a Buffer)>,
    ) {
        let Some(splat) = self.cell(mode).get() else { return };
        let pass = ("sheetsplat.splat", timestamp_writes, sheets, &self.indices);
        record_quads(encoder, pass, (&self.clear, clear.0, clear.1), splat, lists);
    }
}

/// Records a pass, given by its label, its times, its targets and the quads' indices, that zeroes tiles, given by stage, bind group and list, and draws
/// lists of quads.
pub(super) fn record_quads<'a>(
    encoder: &mut CommandEncoder,
    (label, timestamp_writes, sheets, indices): (&str, Option<RenderPassTimestampWrites<'_>>, &[TextureView], &Buffer),
    (clear, clear_group, tiles): (&Clear, &BindGroup, &Buffer),
    pipeline: &RenderPipeline,
    lists: impl IntoIterator<Item = (&'a BindGroup, u32, &'a Buffer)>,
) {
    let target = |view| {
        let ops = wgpu::Operations { load: wgpu::LoadOp::Load, store: wgpu::StoreOp::Store };
        Some(wgpu::RenderPassColorAttachment { view, depth_slice: None, resolve_target: None, ops })
    };
    let targets: Vec<_> = sheets.iter().map(target).collect();
    let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        label: Some(label),
        color_attachments: &targets,
        timestamp_writes,
        ..wgpu::RenderPassDescriptor::default()
    });
    let draw = std::mem::offset_of!(Indirect, draw) as u64;
    pass.set_index_buffer(indices.slice(..), wgpu::IndexFormat::Uint16);
    pass.set_pipeline(&clear.pipeline);
    pass.set_bind_group(0, clear_group, &[]);
    pass.draw_indexed_indirect(tiles, draw);
    pass.set_pipeline(pipeline);
    for (group, offset, args) in lists {
        pass.set_bind_group(0, group, &[offset]);
        pass.draw_indexed_indirect(args, draw);
    }
}

/// The bindings of the shaders that draw quads.
pub(super) fn splat_slots() -> [(&'static str, Slot); 6] {
    let both = ShaderStages::VERTEX_FRAGMENT;
    [
        ("frames", uniform::<Frame>(both, false)),
        ("sheet_group", uniform::<SheetGroup>(ShaderStages::VERTEX, true)),
        ("splats", storage::<SplatRecord>(ShaderStages::VERTEX, true)),
        ("instances", storage::<u32>(ShaderStages::VERTEX, true)),
        ("args", storage::<Indirect>(ShaderStages::VERTEX, true)),
        ("footprints", texture(both, TextureViewDimension::D2Array)),
    ]
}

/// The vertices 4q to 4q + 3 of quad q as two triangles, for an instance's quads.
pub(super) fn quad_indices(device: &Device) -> Buffer {
    let indices: Vec<u16> = (0..QUADS).flat_map(|quad| [0, 1, 2, 2, 1, 3].map(|corner| 4 * quad + corner)).collect();
    let bytes: &[u8] = bytemuck::cast_slice(&indices);
    uploaded(device, "sheetsplat.quad_indices", bytes, bytes.len() as u64, wgpu::BufferUsages::INDEX)
}
