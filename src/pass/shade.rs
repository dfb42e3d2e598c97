//! Projects and shades the voxels in a list of places (Fig. 12).

use std::sync::OnceLock;

use wgpu::{BindGroup, BindingResource, Buffer, ComputePass, Device, ShaderStages, TextureView, TextureViewDimension};

use crate::gpu::bindings::{ComputeStage, storage, texture_of_integers, uniform};
use crate::gpu::layout::{Brick, Frame, Indirect, Splat};
use crate::gpu::shaders;
use crate::gpu::volume_texture::VolumeTexture;

/// The stage's pipelines, without and with labels that have their own ramps, without and with holes. Each is compiled when it is first
/// needed.
#[derive(Debug)]
pub struct Shade {
    stages: [[OnceLock<ComputeStage>; 2]; 2],
    no_labels: VolumeTexture,
}

/// The buffers that the stage reads and writes.
#[derive(Clone, Copy, Debug)]
pub struct ShadeBuffers<'a> {
    /// One [`Frame`].
    pub frame: &'a Buffer,
    /// `[Brick]`.
    pub bricks: &'a Buffer,
    /// The volume's values.
    pub values: &'a TextureView,
    /// Whether any value is a hole.
    pub has_holes: bool,
    /// The volume's labels, if any label has its own ramps.
    pub labels: Option<&'a TextureView>,
    /// The control points of the ramps.
    pub control_points: &'a Buffer,
    /// `[u32]`: the places.
    pub places: &'a Buffer,
    /// [`Indirect`]: the number of places.
    pub args: &'a Buffer,
    /// `[Splat]`, one per slot of the list; those of the places are written.
    pub splats: &'a Buffer,
}

/// The bound buffers.
#[derive(Debug)]
pub struct ShadeGroup {
    group: BindGroup,
    has_labels: bool,
    has_holes: bool,
}

impl Shade {
    /// The stage, with nothing compiled yet.
    pub fn new(device: &Device) -> Self {
        Self { stages: Default::default(), no_labels: VolumeTexture::no_labels(device) }
    }

    /// Binds buffers.
    pub fn bind(&self, device: &Device, buffers: ShadeBuffers<'_>) -> ShadeGroup {
        let ShadeBuffers { frame, bricks, values, has_holes, labels, control_points, places, args, splats } = buffers;
        let whole = Buffer::as_entire_binding;
        let resources = [
            ("frames", whole(frame)),
            ("bricks", whole(bricks)),
            ("values", BindingResource::TextureView(values)),
            ("control_points", whole(control_points)),
            ("fresh", whole(places)),
            ("args", whole(args)),
            ("splats", whole(splats)),
            ("labels", BindingResource::TextureView(labels.unwrap_or(&self.no_labels.view))),
        ];
        let has_labels = labels.is_some();
        let stage = &self.stages[usize::from(has_labels)][usize::from(has_holes)];
        let stage = stage.get_or_init(|| compile(device, has_labels, has_holes));
        ShadeGroup { group: stage.bind(device, &resources), has_labels, has_holes }
    }

    /// Shades the number of voxels in `args`.
    pub fn record(&self, pass: &mut ComputePass<'_>, bound: &ShadeGroup, args: &Buffer) {
        if let Some(stage) = self.stages[usize::from(bound.has_labels)][usize::from(bound.has_holes)].get() {
            stage.dispatch_indirect(pass, &bound.group, &[], args);
        }
    }
}

fn compile(device: &Device, labels: bool, holes: bool) -> ComputeStage {
    let stage = ShaderStages::COMPUTE;
    let slots = [
        ("frames", uniform::<Frame>(stage, false)),
        ("bricks", storage::<Brick>(stage, true)),
        ("values", texture_of_integers(stage, TextureViewDimension::D2Array)),
        ("control_points", storage::<[f32; 4]>(stage, true)),
        ("fresh", storage::<u32>(stage, true)),
        ("args", storage::<Indirect>(stage, true)),
        ("splats", storage::<Splat>(stage, false)),
        ("labels", texture_of_integers(stage, TextureViewDimension::D2Array)),
    ];
    let constants = [("LABELS", f64::from(u8::from(labels))), ("HOLES", f64::from(u8::from(holes)))];
    ComputeStage::new(device, shaders::SHADE, "main", &slots, &constants)
}
