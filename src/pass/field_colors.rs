//! Draws the colours of a list's voxels onto a slab plane, as the stage field draws their values (SPEC §10).

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use wgpu::{
    BindGroup, BindingResource, Buffer, CommandEncoder, Device, RenderPassTimestampWrites, RenderPipeline,
    ShaderStages, TextureFormat, TextureView, TextureViewDimension,
};

use super::clear::Clear;
use super::sheets::{added_to, sheets_of_a_group};
use super::splat::{quad_indices, record_quads};
use crate::gpu::bindings::{Bindings, at_offset, storage, texture_of_integers, uniform};
use crate::gpu::layout::{Brick, FieldPlanes, FieldVoxel, Frame, Indirect, SheetGroup};
use crate::gpu::render_pipeline::render_pipeline;
use crate::gpu::shaders;
use crate::gpu::volume_texture::Pages;
use crate::pass::cull::CullList;

/// The stage's pipelines: one that zeroes tiles, and those that draw.
#[derive(Debug)]
pub struct FieldColors {
    clear: Clear,
    bindings: Bindings,
    format: TextureFormat,
    /// Each is compiled when it is first needed.
    pipelines: Mutex<HashMap<ColorMode, Arc<RenderPipeline>>>,
    indices: Buffer,
}

/// What the colours of voxels are read from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ColorMode {
    /// The number in the volume's colours that stands for 1.
    pub full: u32,
    /// Whether they are the bits of coefficients.
    pub is_exact: bool,
    /// The bits of a voxel's place in its page along each axis; 0 where voxels are not in pages.
    pub page_bits: u32,
}

/// The buffers of one list.
#[derive(Clone, Copy, Debug)]
pub struct FieldColorsBuffers<'a> {
    /// One [`Frame`].
    pub frame: &'a Buffer,
    /// One [`SheetGroup`] at every dynamic offset.
    pub groups: &'a Buffer,
    /// One [`FieldPlanes`].
    pub planes: &'a Buffer,
    /// `[Brick]`.
    pub bricks: &'a Buffer,
    /// What the mode says.
    pub colors: &'a TextureView,
    /// The slots of pages, where voxels are in pages.
    pub pages: Option<Pages<'a>>,
}

/// Bound buffers.
#[derive(Debug)]
pub struct FieldColorsGroup {
    group: BindGroup,
    pipeline: Arc<RenderPipeline>,
}

impl FieldColors {
    /// Compiles the stage for a sheet of the given format.
    pub fn new(device: &Device, format: TextureFormat) -> Self {
        let vertex = ShaderStages::VERTEX;
        let slots = [
            ("frames", uniform::<Frame>(ShaderStages::VERTEX_FRAGMENT, false)),
            ("sheet_group", uniform::<SheetGroup>(vertex, true)),
            ("voxels", storage::<FieldVoxel>(vertex, true)),
            ("instances", storage::<u32>(vertex, true)),
            ("args", storage::<Indirect>(vertex, true)),
            ("planes", uniform::<FieldPlanes>(vertex, false)),
            ("bricks", storage::<Brick>(vertex, true)),
            ("colors", texture_of_integers(vertex, TextureViewDimension::D2Array)),
            ("pages", texture_of_integers(vertex, TextureViewDimension::D2Array)),
        ];
        Self {
            clear: Clear::new(device, format, 1),
            bindings: Bindings::new(device, shaders::FIELD_COLORS, &slots),
            format,
            pipelines: Mutex::default(),
            indices: quad_indices(device),
        }
    }

    fn pipeline(&self, device: &Device, mode: ColorMode) -> Arc<RenderPipeline> {
        let compile = || {
            let sheets = sheets_of_a_group(self.format, 1, Some(added_to(wgpu::BlendFactor::One)));
            let ColorMode { full, is_exact, page_bits } = mode;
            let constants = [
                ("FULL_COLOR", f64::from(full)),
                ("EXACT", f64::from(u8::from(is_exact))),
                ("PAGE_BITS", f64::from(page_bits)),
            ];
            let entries = (shaders::FIELD_COLORS, ["vertex", "fragment"]);
            Arc::new(render_pipeline(device, entries, &self.bindings.pipeline_layout, &sheets, &constants))
        };
        let mut pipelines = self.pipelines.lock().unwrap_or_else(PoisonError::into_inner);
        Arc::clone(pipelines.entry(mode).or_insert_with(compile))
    }

    /// Binds the list of tiles to zero.
    pub fn bind_clear(&self, device: &Device, frame: &Buffer, tiles: &Buffer) -> BindGroup {
        self.clear.bind(device, frame, tiles)
    }

    /// Binds one list's voxels. `groups` holds a [`SheetGroup`] at every dynamic offset that will be drawn.
    pub fn bind(
        &self,
        device: &Device,
        mode: ColorMode,
        buffers: FieldColorsBuffers<'_>,
        list: &CullList,
    ) -> FieldColorsGroup {
        let FieldColorsBuffers { frame, groups, planes, bricks, colors, pages } = buffers;
        let resources = [
            ("frames", frame.as_entire_binding()),
            ("sheet_group", at_offset::<SheetGroup>(groups)),
            ("voxels", list.splats.as_entire_binding()),
            ("instances", list.instances.as_entire_binding()),
            ("args", list.draw_args.as_entire_binding()),
            ("planes", planes.as_entire_binding()),
            ("bricks", bricks.as_entire_binding()),
            ("colors", BindingResource::TextureView(colors)),
            ("pages", BindingResource::TextureView(pages.map_or(colors, |pages| pages.view))),
        ];
        FieldColorsGroup { group: self.bindings.bind(device, &resources), pipeline: self.pipeline(device, mode) }
    }

    /// Zeroes the listed tiles of the sheet buffer, then adds the colours of the given lists' voxels: for every list its bound buffers, the group's offset,
    /// and the arguments of its draw. All lists have the same mode.
    pub fn record<'a>(
        &self,
        encoder: &mut CommandEncoder,
        timestamp_writes: Option<RenderPassTimestampWrites<'_>>,
        sheet: &TextureView,
        (clear_group, tiles): (&BindGroup, &Buffer),
        lists: impl IntoIterator<Item = (&'a FieldColorsGroup, u32, &'a Buffer)>,
    ) {
        let lists: Vec<_> = lists.into_iter().collect();
        // Without lists the tiles are zeroed all the same.
        let pipeline = lists.first().map_or(&self.clear.pipeline, |(bound, ..)| &*bound.pipeline);
        let draws = lists.iter().map(|&(bound, offset, args)| (&bound.group, offset, args));
        let pass = ("sheetsplat.field_colors", timestamp_writes, std::slice::from_ref(sheet), &self.indices);
        record_quads(encoder, pass, (&self.clear, clear_group, tiles), pipeline, draws);
    }
}
