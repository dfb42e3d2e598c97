//! Projects voxels and finds their numbers and gradients, those of a list of places, before they are drawn onto slab planes (SPEC §9).

use std::sync::OnceLock;

use wgpu::{BindGroup, BindingResource, Buffer, ComputePass, Device, ShaderStages, TextureView, TextureViewDimension};

use crate::gpu::bindings::{ComputeStage, storage, texture_of_integers, uniform};
use crate::gpu::layout::{Brick, FieldPlanes, FieldVoxel, Frame, Indirect};
use crate::gpu::shaders;

/// The stage's pipelines: without and with coefficients of their own, without and with holes. Each is compiled when it is first asked for.
#[derive(Debug, Default)]
pub struct Values {
    stages: [[OnceLock<ComputeStage>; 2]; 2],
}

/// What voxels are drawn onto planes by.
#[derive(Clone, Copy, Debug)]
pub struct PlaneBuffers<'a> {
    /// One [`FieldPlanes`].
    pub planes: &'a Buffer,
    /// The bits of all coefficients, where they are not the values.
    pub coefficients: Option<&'a TextureView>,
}

/// What the stage reads and writes.
#[derive(Clone, Copy, Debug)]
pub struct ValuesBuffers<'a> {
    /// One [`Frame`].
    pub frame: &'a Buffer,
    /// `[Brick]`.
    pub bricks: &'a Buffer,
    /// The volume's values.
    pub values: &'a TextureView,
    /// Whether any of them is a hole.
    pub has_holes: bool,
    /// What they become.
    pub planes: PlaneBuffers<'a>,
    /// `[u32]`: the places.
    pub places: &'a Buffer,
    /// [`Indirect`]: how many they are.
    pub args: &'a Buffer,
    /// `[FieldVoxel]`, one per place of the list; those of the places are written.
    pub voxels: &'a Buffer,
}

/// Bound buffers.
#[derive(Debug)]
pub struct ValuesGroup {
    group: BindGroup,
    is_exact: bool,
    has_holes: bool,
}

impl Values {
    /// Binds buffers.
    pub fn bind(&self, device: &Device, buffers: ValuesBuffers<'_>) -> ValuesGroup {
        let ValuesBuffers { frame, bricks, values, has_holes, planes, places, args, voxels } = buffers;
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
        ];
        let is_exact = planes.coefficients.is_some();
        let stage = &self.stages[usize::from(is_exact)][usize::from(has_holes)];
        let stage = stage.get_or_init(|| compile(device, is_exact, has_holes));
        ValuesGroup { group: stage.bind(device, &resources), is_exact, has_holes }
    }

    /// Looks up as many voxels as `args` says.
    pub fn record(&self, pass: &mut ComputePass<'_>, bound: &ValuesGroup, args: &Buffer) {
        if let Some(stage) = self.stages[usize::from(bound.is_exact)][usize::from(bound.has_holes)].get() {
            stage.dispatch_indirect(pass, &bound.group, &[], args);
        }
    }
}

fn compile(device: &Device, is_exact: bool, has_holes: bool) -> ComputeStage {
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
    ];
    let constants = [("EXACT", f64::from(u8::from(is_exact))), ("HOLES", f64::from(u8::from(has_holes)))];
    ComputeStage::new(device, shaders::VALUES, "main", &slots, &constants)
}
