//! Adds up the images of channels that share no sheets (SPEC §10).

use std::sync::OnceLock;

use wgpu::{BindGroup, BindingResource, Buffer, BufferBinding, ComputePass, Device, ShaderStages};

use super::composite::CutBuffers;
use crate::gpu::bindings::{ComputeStage, depth_texture, storage, uniform};
use crate::gpu::layout::{Band, Cut, Frame};
use crate::gpu::shaders;
use crate::gpu::targets::BandBuffer;
use crate::image::channels::Joining;

/// The stage's pipelines, each compiled when it is first needed.
#[derive(Debug, Default)]
pub struct Join {
    /// Indexed by whether the nearest surface counts, and by whether first hits are asked for.
    stages: [[OnceLock<ComputeStage>; 2]; 2],
}

/// The mode that a pipeline is compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JoinMode {
    /// Whether the nearest surface counts, and not the sum.
    pub nearest: bool,
    /// Whether first hits are asked for, which the nearest surface needs.
    pub first_hit: bool,
}

/// The stage's buffers.
#[derive(Clone, Copy, Debug)]
pub struct JoinBuffers<'a> {
    /// One [`Frame`], the channel's.
    pub frame: &'a Buffer,
    /// The channel's first hits, `[u32]`, with their byte offset; at least one word.
    pub hits: (&'a Buffer, u64),
    /// The first hits of all channels so far.
    pub joined_hits: &'a Buffer,
    /// The buffers for cutting rays.
    pub cut: CutBuffers<'a>,
}

/// The number of pixels that one workgroup adds.
const JOIN_WORKGROUP: u32 = 256;

impl JoinMode {
    /// The mode for images with or without first hits.
    pub(crate) fn of(joining: Joining, first_hit: bool) -> Self {
        Self { nearest: joining == Joining::Nearest, first_hit }
    }
}

impl Join {
    fn stage(&self, JoinMode { nearest, first_hit }: JoinMode) -> &OnceLock<ComputeStage> {
        &self.stages[usize::from(nearest)][usize::from(first_hit)]
    }

    /// Binds a band of a channel's compositing buffer, and the same band of that of all channels.
    pub fn bind(
        &self,
        device: &Device,
        mode: JoinMode,
        buffers: JoinBuffers<'_>,
        (band, joined): (&BandBuffer, &BandBuffer),
    ) -> BindGroup {
        let JoinBuffers { frame, hits: (hits, offset), joined_hits, cut } = buffers;
        let resources = [
            ("frames", frame.as_entire_binding()),
            ("band", band.uniform.as_entire_binding()),
            ("acc", band.acc.as_entire_binding()),
            ("hits", BindingResource::Buffer(BufferBinding { buffer: hits, offset, size: None })),
            ("joined", joined.acc.as_entire_binding()),
            ("joined_hits", joined_hits.as_entire_binding()),
            ("cut", cut.uniform.as_entire_binding()),
            ("surfaces", BindingResource::TextureView(cut.surfaces)),
        ];
        self.stage(mode).get_or_init(|| compile(device, mode)).bind(device, &resources)
    }

    /// Adds a channel's image in every band, given by its bind group, and its number of pixels.
    pub fn record<'a>(
        &self,
        pass: &mut ComputePass<'_>,
        mode: JoinMode,
        bands: impl IntoIterator<Item = (&'a BindGroup, u32)>,
    ) {
        let Some(stage) = self.stage(mode).get() else { return };
        for (group, pixels) in bands {
            stage.dispatch(pass, group, &[], pixels.div_ceil(JOIN_WORKGROUP));
        }
    }
}

fn compile(device: &Device, JoinMode { nearest, first_hit }: JoinMode) -> ComputeStage {
    let stage = ShaderStages::COMPUTE;
    let slots = [
        ("frames", uniform::<Frame>(stage, false)),
        ("band", uniform::<Band>(stage, false)),
        ("acc", storage::<[f32; 4]>(stage, true)),
        ("hits", storage::<u32>(stage, true)),
        ("joined", storage::<[f32; 4]>(stage, false)),
        ("joined_hits", storage::<u32>(stage, false)),
        ("cut", uniform::<Cut>(stage, false)),
        ("surfaces", depth_texture(stage)),
    ];
    let flag = |is_set| f64::from(u8::from(is_set));
    let constants = [("NEAREST", flag(nearest)), ("FIRST_HIT", flag(first_hit))];
    ComputeStage::new(device, shaders::JOIN, "main", &slots, &constants)
}
