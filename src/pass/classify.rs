//! Classifies, shades and composites the slabs between planes of values, and marks opaque pixels (SPEC §9, eq. 2).

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use wgpu::{BindGroup, BindingResource, Buffer, ComputePass, Device, ShaderStages, TextureView, TextureViewDimension};

use super::composite::{CompositeBuffers, CompositeMode, slots};
use crate::gpu::bindings::{ComputeStage, storage, texture, texture_of_integers, uniform};
use crate::gpu::layout::FieldPlanes;
use crate::gpu::light_texture::LightTexture;
use crate::gpu::shaders;
use crate::gpu::targets::BandBuffer;
use crate::gpu::volume_texture::{Pages, VolumeTexture};
use crate::settings::shading::Gradient;

/// The stage's pipelines, each compiled when it is first needed.
#[derive(Debug)]
pub struct Classify {
    stages: Mutex<HashMap<ClassifyMode, Arc<ComputeStage>>>,
    no_labels: VolumeTexture,
    no_light: TextureView,
}

/// The mode that a pipeline is compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ClassifyMode {
    /// As for classification before splatting.
    pub composite: CompositeMode,
    /// The gradients that the planes hold.
    pub gradient: Gradient,
    /// Whether any label has its own tables.
    pub labels: bool,
    /// Whether any voxel is a hole.
    pub holes: bool,
    /// The bits of a voxel's place in its page along each axis; 0 where voxels are not in pages.
    pub page_bits: u32,
    /// The number of channels that share sheets (SPEC §10).
    pub channels: u32,
    /// Whether voxels of any channel have colours of their own.
    pub own_colors: bool,
    /// The number of segments of a slab.
    pub segments: u32,
    /// Whether there are light sheets.
    pub light: bool,
}

/// The stage's buffers.
#[derive(Clone, Copy, Debug)]
pub struct ClassifyBuffers<'a> {
    /// Those of the stage composite; the sheets hold the sums of a plane, two for each channel, then one for each channel with colours.
    pub composite: CompositeBuffers<'a>,
    /// Control points of the ramps, the tables of their integrals, and those of labels and channels.
    pub control_points: &'a Buffer,
    /// One [`FieldPlanes`], of any channel.
    pub planes: &'a Buffer,
    /// The volume's values.
    pub values: &'a TextureView,
    /// The slots of pages, where voxels are in pages.
    pub pages: Option<Pages<'a>>,
    /// The volume's labels, if any of them has its own tables.
    pub labels: Option<&'a TextureView>,
    /// The light sheets, for a mode that has them.
    pub light: Option<&'a TextureView>,
}

/// A band's bind group and pipeline.
#[derive(Debug)]
pub struct ClassifyGroup {
    group: BindGroup,
    stage: Arc<ComputeStage>,
}

/// Bytes of a record that a pixel carries from plane to plane: one for each channel, and one for each with colours of voxels' own.
pub const CARRIED_BYTES: u64 = 16;

impl Classify {
    /// The stage without any pipeline.
    pub fn new(device: &Device) -> Self {
        let no_light = LightTexture::none(device);
        Self { stages: Mutex::default(), no_labels: VolumeTexture::no_labels(device), no_light }
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
        let ClassifyBuffers { composite, control_points, planes, values, pages, labels, light } = buffers;
        let texture = BindingResource::TextureView;
        let own = [
            ("control_points", control_points.as_entire_binding()),
            ("labels", texture(labels.unwrap_or(&self.no_labels.view))),
            ("values", texture(values)),
            ("planes", planes.as_entire_binding()),
            ("carried", carried.as_entire_binding()),
            ("pages", texture(pages.map_or(values, |pages| pages.view))),
            ("light_sheets", texture(light.unwrap_or(&self.no_light))),
        ];
        let resources = [&composite.resources(band)[..], &own].concat();
        let stage = self.compiled(device, mode);
        ClassifyGroup { group: stage.bind(device, &resources), stage }
    }

    /// Composites the listed tiles of every band for the group at `offset`.
    pub fn record(&self, pass: &mut ComputePass<'_>, bands: &[ClassifyGroup], offset: u32, tiles: &Buffer) {
        for ClassifyGroup { group, stage } in bands {
            stage.dispatch_indirect(pass, group, &[offset], tiles);
        }
    }
}

fn compile(device: &Device, mode: ClassifyMode) -> ComputeStage {
    let ClassifyMode { composite, gradient, labels, holes, page_bits, channels, own_colors, segments, light } = mode;
    let stage = ShaderStages::COMPUTE;
    let own = [
        ("control_points", storage::<[f32; 4]>(stage, true)),
        ("labels", texture_of_integers(stage, TextureViewDimension::D2Array)),
        ("values", texture_of_integers(stage, TextureViewDimension::D2Array)),
        ("planes", uniform::<FieldPlanes>(stage, false)),
        ("carried", storage::<[u32; 4]>(stage, false)),
        ("pages", texture_of_integers(stage, TextureViewDimension::D2Array)),
        ("light_sheets", texture(stage, TextureViewDimension::D3)),
    ];
    let slots = [&slots()[..], &own].concat();
    let flag = |is_set| f64::from(u8::from(is_set));
    let own = [
        ("KERNEL_GRADIENT", flag(gradient == Gradient::Kernel)),
        ("LABELS", flag(labels)),
        ("HOLES", flag(holes)),
        ("PAGE_BITS", f64::from(page_bits)),
        ("CHANNELS", f64::from(channels)),
        ("OWN_COLORS", flag(own_colors)),
        ("SEGMENTS", f64::from(segments)),
        ("LIGHT", flag(light)),
    ];
    let constants = [&composite.constants()[..], &own].concat();
    ComputeStage::new(device, shaders::CLASSIFY, "main", &slots, &constants)
}
