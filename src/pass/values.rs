//! Projects listed voxels and computes their numbers and gradients, before they are drawn onto slab planes (SPEC §9).

use std::sync::OnceLock;

use wgpu::{BindGroup, BindingResource, Buffer, ComputePass, Device, ShaderStages, TextureView, TextureViewDimension};

use crate::gpu::bindings::{ComputeStage, storage, texture_of_integers, uniform};
use crate::gpu::layout::{Brick, FieldPlanes, FieldVoxel, Frame, Indirect};
use crate::gpu::shaders;
use crate::gpu::volume_texture::{Pages, page_bits};

/// The stage's pipelines, each compiled when it is first needed.
#[derive(Debug, Default)]
pub struct Values {
    /// Indexed by whether coefficients differ from the values, by whether there are holes, and by the bits of a place in a page.
    stages: [[[OnceLock<ComputeStage>; 5]; 2]; 2],
}

/// The buffers for drawing voxels onto planes.
#[derive(Clone, Copy, Debug)]
pub struct PlaneBuffers<'a> {
    /// One [`FieldPlanes`].
    pub planes: &'a Buffer,
    /// The bits of all coefficients if they differ from the values.
    pub coefficients: Option<&'a TextureView>,
}

/// The stage's buffers.
#[derive(Clone, Copy, Debug)]
pub struct ValuesBuffers<'a> {
    /// One [`Frame`].
    pub frame: &'a Buffer,
    /// `[Brick]`.
    pub bricks: &'a Buffer,
    /// The volume's values.
    pub values: &'a TextureView,
    /// The slots of pages, where voxels are in pages.
    pub pages: Option<Pages<'a>>,
    /// Whether any value is a hole.
    pub has_holes: bool,
    /// The planes that voxels are drawn onto.
    pub planes: PlaneBuffers<'a>,
    /// `[u32]`: the voxels to compute, as slots in bricks.
    pub places: &'a Buffer,
    /// [`Indirect`]: the number of these voxels.
    pub args: &'a Buffer,
    /// `[FieldVoxel]`, one per slot of every brick; those of the listed voxels are written.
    pub voxels: &'a Buffer,
}

/// Bound buffers.
#[derive(Debug)]
pub struct ValuesGroup {
    group: BindGroup,
    mode: [usize; 3],
}

impl Values {
    /// Binds buffers.
    pub fn bind(&self, device: &Device, buffers: ValuesBuffers<'_>) -> ValuesGroup {
        let ValuesBuffers { frame, bricks, values, pages, has_holes, planes, places, args, voxels } = buffers;
        let whole = Buffer::as_entire_binding;
        let resources = [
            ("frames", whole(frame)),
            ("bricks", whole(bricks)),
            ("values", BindingResource::TextureView(values)),
            ("coefficients", BindingResource::TextureView(planes.coefficients.unwrap_or(values))),
            ("fresh", whole(places)),
            ("args", whole(args)),
            ("voxels", whole(voxels)),
            ("planes", whole(planes.planes)),
            ("pages", BindingResource::TextureView(pages.map_or(values, |pages| pages.view))),
        ];
        let is_exact = planes.coefficients.is_some();
        let mode = [is_exact.into(), has_holes.into(), page_bits(pages) as usize];
        let [exact, holes, bits] = mode;
        let stage = self.stages[exact][holes][bits].get_or_init(|| compile(device, mode));
        ValuesGroup { group: stage.bind(device, &resources), mode }
    }

    /// Computes the listed voxels, whose number `args` holds.
    pub fn record(&self, pass: &mut ComputePass<'_>, bound: &ValuesGroup, args: &Buffer) {
        let [exact, holes, bits] = bound.mode;
        if let Some(stage) = self.stages[exact][holes][bits].get() {
            stage.dispatch_indirect(pass, &bound.group, &[], args);
        }
    }
}

fn compile(device: &Device, [exact, holes, bits]: [usize; 3]) -> ComputeStage {
    let stage = ShaderStages::COMPUTE;
    let slots = [
        ("frames", uniform::<Frame>(stage, false)),
        ("bricks", storage::<Brick>(stage, true)),
        ("values", texture_of_integers(stage, TextureViewDimension::D2Array)),
        ("coefficients", texture_of_integers(stage, TextureViewDimension::D2Array)),
        ("fresh", storage::<u32>(stage, true)),
        ("args", storage::<Indirect>(stage, true)),
        ("voxels", storage::<FieldVoxel>(stage, false)),
        ("planes", uniform::<FieldPlanes>(stage, false)),
        ("pages", texture_of_integers(stage, TextureViewDimension::D2Array)),
    ];
    let constants = [("EXACT", exact as f64), ("HOLES", holes as f64), ("PAGE_BITS", bits as f64)];
    ComputeStage::new(device, shaders::VALUES, "main", &slots, &constants)
}
