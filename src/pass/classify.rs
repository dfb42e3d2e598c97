//! Classifies, shades and composites the slabs between planes of values, and notes opaque pixels (SPEC §9, eq. 2).

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use wgpu::{BindGroup, Buffer, ComputePass, Device, ShaderStages, TextureView, TextureViewDimension};

use super::composite::{CompositeBuffers, CompositeMode};
use crate::gpu::bindings::{ComputeStage, at_offset, depth_texture, storage, texture, texture_of_integers, uniform};
use crate::gpu::layout::{Band, Cut, FieldPlanes, Frame, SheetGroup, TileList};
use crate::gpu::shaders;
use crate::gpu::targets::BandBuffer;
use crate::gpu::volume_texture::VolumeTexture;
use crate::settings::shading::Gradient;

/// The stage's pipelines; each is compiled when it is first asked for.
#[derive(Debug)]
pub struct Classify {
    stages: Mutex<HashMap<ClassifyMode, Arc<ComputeStage>>>,
    no_labels: VolumeTexture,
}

/// What a pipeline is compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ClassifyMode {
    /// As where colours are splatted.
    pub composite: CompositeMode,
    /// Which gradients the planes hold.
    pub gradient: Gradient,
    /// Whether any label has tables of its own.
    pub labels: bool,
    /// Whether any voxel is a hole.
    pub holes: bool,
}

/// Buffers of the stage.
#[derive(Clone, Copy, Debug)]
pub struct ClassifyBuffers<'a> {
    /// Those that `composite` has, too; the sheets hold a plane's sums.
    pub composite: CompositeBuffers<'a>,
    /// Control points of the ramps, and the tables of their integrals.
    pub control_points: &'a Buffer,
    /// One [`FieldPlanes`].
    pub planes: &'a Buffer,
    /// The volume's values.
    pub values: &'a TextureView,
    /// Its labels, if any of them has tables of its own.
    pub labels: Option<&'a TextureView>,
}

/// A band's bound buffers, and its pipeline.
#[derive(Debug)]
pub struct ClassifyGroup {
    group: BindGroup,
    stage: Arc<ComputeStage>,
}

/// Bytes that a pixel carries from plane to plane.
pub const CARRIED_BYTES: u64 = 16;

impl Classify {
    /// The stage, nothing compiled.
    pub fn new(device: &Device) -> Self {
        Self { stages: Mutex::default(), no_labels: VolumeTexture::no_labels(device) }
    }

    fn compiled(&self, device: &Device, mode: ClassifyMode) -> Arc<ComputeStage> {
        let mut stages = self.stages.lock().unwrap_or_else(PoisonError::into_inner);
        Arc::clone(stages.entry(mode).or_insert_with(|| Arc::new(compile(device, mode))))
    }

    /// Binds a band of the compositing buffer, and what its pixels carry from plane to plane.
    pub fn bind(
        &self,
        device: &Device,
        mode: ClassifyMode,
        buffers: ClassifyBuffers<'_>,
        (band, carried): (&BandBuffer, &Buffer),
    ) -> ClassifyGroup {
        let ClassifyBuffers { composite, control_points, planes, values, labels } = buffers;
        let CompositeBuffers { frame, groups, sheets, tiles, targets, cut, hits } = composite;
        let texture = wgpu::BindingResource::TextureView;
        let resources = [
            ("frames", frame.as_entire_binding()),
            ("band", band.uniform.as_entire_binding()),
            ("sheets", texture(sheets)),
            ("acc", band.acc.as_entire_binding()),
            ("composited", tiles.as_entire_binding()),
            ("opaque", targets.opaque.as_entire_binding()),
            ("opaque_tiles", targets.opaque_tiles.as_entire_binding()),
            ("sheet_group", at_offset::<SheetGroup>(groups)),
            ("cut", cut.uniform.as_entire_binding()),
            ("surfaces", texture(cut.surfaces)),
            ("hits", hits.as_entire_binding()),
            ("last_groups", targets.last_groups.as_entire_binding()),
            ("control_points", control_points.as_entire_binding()),
            ("labels", texture(labels.unwrap_or(&self.no_labels.view))),
            ("values", texture(values)),
            ("planes", planes.as_entire_binding()),
            ("carried", carried.as_entire_binding()),
        ];
        let stage = self.compiled(device, mode);
        ClassifyGroup { group: stage.bind(device, &resources), stage }
    }

    /// Composites the listed tiles of every band, of the group at `offset`.
    pub fn record(&self, pass: &mut ComputePass<'_>, bands: &[ClassifyGroup], offset: u32, tiles: &Buffer) {
        for ClassifyGroup { group, stage } in bands {
            stage.dispatch_indirect(pass, group, &[offset], tiles);
        }
    }
}

fn compile(device: &Device, mode: ClassifyMode) -> ComputeStage {
    let ClassifyMode { composite: CompositeMode { compositing, rays }, gradient, labels, holes } = mode;
    let stage = ShaderStages::COMPUTE;
    let slots = [
        ("frames", uniform::<Frame>(stage, false)),
        ("band", uniform::<Band>(stage, false)),
        ("sheets", texture(stage, TextureViewDimension::D2Array)),
        ("acc", storage::<[f32; 4]>(stage, false)),
        ("composited", storage::<TileList>(stage, true)),
        ("opaque", storage::<u32>(stage, false)),
        ("opaque_tiles", storage::<u32>(stage, false)),
        ("sheet_group", uniform::<SheetGroup>(stage, true)),
        ("cut", uniform::<Cut>(stage, false)),
        ("surfaces", depth_texture(stage)),
        ("hits", storage::<u32>(stage, false)),
        ("last_groups", storage::<u32>(stage, false)),
        ("control_points", storage::<[f32; 4]>(stage, true)),
        ("labels", texture_of_integers(stage, TextureViewDimension::D2Array)),
        ("values", texture_of_integers(stage, TextureViewDimension::D2Array)),
        ("planes", uniform::<FieldPlanes>(stage, false)),
        ("carried", storage::<[f32; 4]>(stage, false)),
    ];
    let flag = |is_set| f64::from(u8::from(is_set));
    let constants = [
        ("COMPOSITING", f64::from(compositing as u32)),
        ("CUT", flag(rays.cut)),
        ("FIRST_HIT", flag(rays.first_hit)),
        ("KERNEL_GRADIENT", flag(gradient == Gradient::Kernel)),
        ("LABELS", flag(labels)),
        ("HOLES", flag(holes)),
    ];
    ComputeStage::new(device, shaders::CLASSIFY, "main", &slots, &constants)
}
