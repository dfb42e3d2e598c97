//! Projects and shades the voxels in a list of places (Fig. 12).

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use wgpu::{BindGroup, BindingResource, Buffer, ComputePass, Device, ShaderStages, TextureView, TextureViewDimension};

use crate::gpu::bindings::{ComputeStage, storage, texture, texture_of_integers, uniform};
use crate::gpu::layout::{Brick, Frame, Indirect, Splat};
use crate::gpu::light_texture::LightTexture;
use crate::gpu::shaders;
use crate::gpu::volume_texture::{OwnColors, Pages, VolumeTexture, page_bits};

/// The stage's pipelines. Each is compiled when it is first needed.
#[derive(Debug)]
pub struct Shade {
    stages: Mutex<HashMap<ShadeMode, Arc<ComputeStage>>>,
    no_labels: VolumeTexture,
    no_colors: VolumeTexture,
    no_light: TextureView,
}

/// The mode that a pipeline is compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct ShadeMode {
    /// Whether labels have their own ramps.
    labels: bool,
    holes: bool,
    page_bits: u32,
    channels: u32,
    /// The number in the voxels' own colours that stands for 1; 0 if they have none.
    full_color: u32,
    membership: bool,
    /// Whether there are light sheets.
    light: bool,
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
    /// The slots of pages, where voxels are in pages.
    pub pages: Option<Pages<'a>>,
    /// Whether any value is a hole.
    pub has_holes: bool,
    /// The number of channels (SPEC §10).
    pub channels: u32,
    /// The voxels' own colours, if they have any.
    pub colors: Option<OwnColors<'a>>,
    /// The volume's labels, if any label has its own ramps.
    pub labels: Option<&'a TextureView>,
    /// The gradients of the membership of labels, if any channel is shaded by them.
    pub membership: Option<&'a TextureView>,
    /// The light sheets, if there are any.
    pub light: Option<&'a TextureView>,
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
    stage: Arc<ComputeStage>,
}

impl Shade {
    /// The stage, with nothing compiled yet.
    pub fn new(device: &Device) -> Self {
        let [no_labels, no_colors] = [VolumeTexture::no_labels(device), VolumeTexture::no_colors(device)];
        Self { stages: Mutex::default(), no_labels, no_colors, no_light: LightTexture::none(device) }
    }

    /// Binds buffers.
    pub fn bind(&self, device: &Device, buffers: ShadeBuffers<'_>) -> ShadeGroup {
        let ShadeBuffers { frame, bricks, values, labels, control_points, places, args, splats, .. } = buffers;
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
            ("colors", BindingResource::TextureView(buffers.colors.map_or(&self.no_colors.view, |own| own.view))),
            ("pages", BindingResource::TextureView(buffers.pages.map_or(values, |pages| pages.view))),
            ("membership", BindingResource::TextureView(buffers.membership.unwrap_or(&self.no_labels.view))),
            ("light_sheets", BindingResource::TextureView(buffers.light.unwrap_or(&self.no_light))),
        ];
        let mode = ShadeMode {
            labels: labels.is_some(),
            holes: buffers.has_holes,
            page_bits: page_bits(buffers.pages),
            channels: buffers.channels,
            full_color: buffers.colors.map_or(0, |own| own.full),
            membership: buffers.membership.is_some(),
            light: buffers.light.is_some(),
        };
        let mut stages = self.stages.lock().unwrap_or_else(PoisonError::into_inner);
        let stage = Arc::clone(stages.entry(mode).or_insert_with(|| Arc::new(compile(device, mode))));
        ShadeGroup { group: stage.bind(device, &resources), stage }
    }

    /// Shades the number of voxels in `args`.
    pub fn record(&self, pass: &mut ComputePass<'_>, bound: &ShadeGroup, args: &Buffer) {
        bound.stage.dispatch_indirect(pass, &bound.group, &[], args);
    }
}

fn compile(device: &Device, mode: ShadeMode) -> ComputeStage {
    let ShadeMode { labels, holes, page_bits, channels, full_color, membership, light } = mode;
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
        ("colors", texture_of_integers(stage, TextureViewDimension::D2Array)),
        ("pages", texture_of_integers(stage, TextureViewDimension::D2Array)),
        ("membership", texture_of_integers(stage, TextureViewDimension::D2Array)),
        ("light_sheets", texture(stage, TextureViewDimension::D3)),
    ];
    let flag = |is_set| f64::from(u8::from(is_set));
    let constants = [
        ("LABELS", flag(labels)),
        ("HOLES", flag(holes)),
        ("PAGE_BITS", f64::from(page_bits)),
        ("CHANNELS", f64::from(channels)),
        ("FULL_COLOR", f64::from(full_color)),
        ("MEMBERSHIP", flag(membership)),
        ("LIGHT", flag(light)),
    ];
    ComputeStage::new(device, shaders::SHADE, "main", &slots, &constants)
}
