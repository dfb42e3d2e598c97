//! Draws patches front to back: the single stage of the tile rasterizer, which culls, splats and composites (§6).

use std::collections::HashMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use wgpu::{
    BindGroup, Buffer, BufferUsages, CommandEncoder, ComputePass, Device, DeviceType, ShaderStages, TextureView,
    TextureViewDimension,
};

use super::composite::{CutBuffers, RayMode};
use super::lanes::{PATCH_THREADS, lanes, threads};
use crate::gpu::bindings::{
    ComputeStage, at_offset, buffer_spec, depth_texture, storage, texture, texture_of_integers, uniform,
};
use crate::gpu::layout::{Brick, Cut, FieldPlanes, Frame, Gather as GatherUniform, Gathered, Indirect, PatchRange};
use crate::gpu::light_texture::LightTexture;
use crate::gpu::shaders::{self, Lanes};
use crate::gpu::volume_texture::{OwnColors, Pages, VolumeTexture, page_bits};
use crate::lists::patch_bins::SHEETS;
use crate::settings::shading::Gradient;
use crate::settings::splatting::{Classification, Compositing, FootprintBox, Order, Splatting, sheets_per_test};

/// The stage's pipelines, each compiled when it is first needed.
#[derive(Debug, Default)]
pub struct Gather {
    stages: Mutex<HashMap<GatherMode, Arc<ComputeStage>>>,
    no_labels: OnceLock<VolumeTexture>,
    no_colors: OnceLock<VolumeTexture>,
    no_light: OnceLock<TextureView>,
}

/// The mode that a pipeline is compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct GatherMode {
    compositing: Compositing,
    order: Order,
    footprint_box: FootprintBox,
    perspective: bool,
    economies: bool,
    labels: bool,
    holes: bool,
    page_bits: u32,
    channels: u32,
    /// The number in the voxels' own colours that stands for 1; 0 if they have none.
    full_color: u32,
    /// Whether any channel has normals of the membership of labels.
    membership: bool,
    /// Whether there are light sheets.
    light: bool,
    rays: RayMode,
    /// How values are gathered on slab planes; `None` if colours are.
    planes: Option<PlaneMode>,
    /// The number of a group's sheets after which values' pixels are tested for being opaque.
    sheets_per_test: u32,
    /// Whether the blocks of a patch are divided among workgroups.
    divided: bool,
}

/// The order in which groups are drawn. A plane is handed on from front to back, and after splatting the order does not change an image (SPEC §9).
pub fn drawn_order(splatting: &Splatting) -> Order {
    if splatting.classification == Classification::After { Order::FrontToBack } else { splatting.order }
}

/// The maximum number of channels that are gathered on slab planes, each a layer of every group.
pub const MOST_LAYERS: usize = 16;

/// What is gathered on slab planes (SPEC §9).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct PlaneMode {
    /// The gradients.
    pub gradient: Gradient,
    /// Whether coefficients differ from the values.
    pub exact: bool,
    /// The number of layers, one for each channel that shares sheets (SPEC §10).
    pub layers: u32,
    /// Whether voxels of any channel have colours of their own.
    pub own_colors: bool,
    /// The number of segments of a slab.
    pub segments: u32,
}

impl GatherMode {
    /// The mode that splatting settings ask for, with or without an eye, of a volume with or without labels that have ramps of their own
    /// and with or without holes; `workgroups` is how many workgroups draw each patch.
    pub fn of(
        splatting: &Splatting,
        planes: Option<PlaneMode>,
        perspective: bool,
        [labels, holes]: [bool; 2],
        rays: RayMode,
        workgroups: u32,
    ) -> Self {
        let Splatting { compositing, footprint_box, experimental, .. } = *splatting;
        let (order, economies) = (drawn_order(splatting), experimental.in_use().is_some());
        // In perspective every voxel has its own parallelogram.
        let footprint_box = if perspective { FootprintBox::Rectangle } else { footprint_box };
        let divided = workgroups > 1;
        let sheets_per_test = planes.map_or(SHEETS, |_| sheets_per_test(splatting.slab_width));
        let (channels, full_color, page_bits) = (1, 0, 0);
        Self {
            compositing,
            order,
            footprint_box,
            perspective,
            economies,
            labels,
            holes,
            page_bits,
            channels,
            full_color,
            membership: false,
            light: false,
            rays,
            planes,
            sheets_per_test,
            divided,
        }
    }

    /// The same mode for another number of channels, and for voxels with colours of their own (SPEC §10).
    pub fn with_channels(self, channels: u32, colors: Option<OwnColors<'_>>) -> Self {
        Self { channels, full_color: colors.map_or(0, |own| own.full), ..self }
    }

    /// The same mode with or without normals of the membership of labels.
    pub fn with_membership(self, membership: bool) -> Self {
        Self { membership, ..self }
    }

    /// The same mode with or without light sheets.
    pub fn with_light(self, light: bool) -> Self {
        Self { light, ..self }
    }

    /// The same mode for voxels in pages.
    pub fn with_pages(self, pages: Option<Pages<'_>>) -> Self {
        Self { page_bits: page_bits(pages), ..self }
    }
}

/// The buffers for gathering values on planes.
#[derive(Clone, Copy, Debug)]
pub struct GatheredPlanes<'a> {
    /// [`FieldPlanes`] of every channel, as many as [`MOST_LAYERS`].
    pub planes: &'a Buffer,
    /// The bits of all coefficients if they differ from the values.
    pub coefficients: Option<&'a TextureView>,
}

/// The stage's buffers.
#[derive(Clone, Copy, Debug)]
pub struct GatherBuffers<'a> {
    /// One [`Frame`].
    pub frame: &'a Buffer,
    /// One [`GatherUniform`].
    pub gather: &'a Buffer,
    /// The planes, if values are gathered on them (SPEC §9).
    pub planes: Option<GatheredPlanes<'a>>,
    /// One [`PatchRange`] at every dynamic offset.
    pub patch_ranges: &'a Buffer,
    /// `[Brick]`.
    pub bricks: &'a Buffer,
    /// [`PatchBins::words`](crate::lists::patch_bins::PatchBins::words).
    pub bins: &'a Buffer,
    /// The control points of the ramps.
    pub control_points: &'a Buffer,
    /// The volume's values.
    pub values: &'a TextureView,
    /// The slots of pages, where voxels are in pages.
    pub pages: Option<Pages<'a>>,
    /// The voxels' own colours, for a mode that needs them.
    pub colors: Option<OwnColors<'a>>,
    /// The volume's labels, for a mode that needs them.
    pub labels: Option<&'a TextureView>,
    /// The gradients of the membership of labels, for a mode that needs them.
    pub membership: Option<&'a TextureView>,
    /// The light sheets, for a mode that has them.
    pub light: Option<&'a TextureView>,
    /// [`Gathered`].
    pub gathered: &'a Buffer,
    /// [`PatchBins::half_boxes`](crate::lists::patch_bins::PatchBins::half_boxes), `[[f32; 2]]`.
    pub half_boxes: &'a Buffer,
    /// The buffers for cutting rays.
    pub cut: CutBuffers<'a>,
}

impl Gather {
    fn compiled(&self, device: &Device, mode: GatherMode) -> Arc<ComputeStage> {
        let mut stages = self.stages.lock().unwrap_or_else(PoisonError::into_inner);
        Arc::clone(stages.entry(mode).or_insert_with(|| Arc::new(compile(device, mode))))
    }

    /// Binds a band of the compositing buffer, `[vec4f]`, and what its pixels carry from plane to plane, if values are gathered on planes, for one mode and
    /// a number of dispatches.
    pub fn bind(
        &self,
        device: &Device,
        mode: GatherMode,
        buffers: GatherBuffers<'_>,
        band: (&Buffer, Option<&Buffer>),
        dispatches: u32,
    ) -> GatherBand {
        let usage = BufferUsages::STORAGE | BufferUsages::INDIRECT | BufferUsages::COPY_DST;
        let descriptor = buffer_spec("sheetsplat.next", NEXT_BYTES, usage);
        let next: Vec<Buffer> = (0..dispatches).map(|_| device.create_buffer(&descriptor)).collect();
        let stage = self.compiled(device, mode);
        let groups = next.iter().map(|next| self.bind_one(device, &stage, buffers, band, next)).collect();
        GatherBand { stage, groups, next, workgroups_per_patch: workgroups_per_patch(device, mode) }
    }

    fn bind_one(
        &self,
        device: &Device,
        stage: &ComputeStage,
        buffers: GatherBuffers<'_>,
        (acc, carried): (&Buffer, Option<&Buffer>),
        next: &Buffer,
    ) -> BindGroup {
        let GatherBuffers { frame, gather, patch_ranges, bricks, bins, control_points, values, labels, .. } = buffers;
        let labels = labels.unwrap_or_else(|| &self.no_labels.get_or_init(|| VolumeTexture::no_labels(device)).view);
        let whole = Buffer::as_entire_binding;
        let mut resources = vec![
            ("frames", whole(frame)),
            ("gathers", whole(gather)),
            ("patch_range", at_offset::<PatchRange>(patch_ranges)),
            ("bricks", whole(bricks)),
            ("bins", whole(bins)),
            ("control_points", whole(control_points)),
            ("values", wgpu::BindingResource::TextureView(values)),
            ("acc", whole(acc)),
            ("gathered", whole(buffers.gathered)),
            ("half_boxes", whole(buffers.half_boxes)),
            ("labels", wgpu::BindingResource::TextureView(labels)),
            ("next", whole(next)),
            ("cut", whole(buffers.cut.uniform)),
            ("surfaces", wgpu::BindingResource::TextureView(buffers.cut.surfaces)),
        ];
        let none = || &self.no_colors.get_or_init(|| VolumeTexture::no_colors(device)).view;
        let colors = buffers.colors.map_or_else(none, |own| own.view);
        resources.push(("colors", wgpu::BindingResource::TextureView(colors)));
        let pages = buffers.pages.map_or(values, |pages| pages.view);
        resources.push(("pages", wgpu::BindingResource::TextureView(pages)));
        let no_light = || self.no_light.get_or_init(|| LightTexture::none(device));
        let light = buffers.light.unwrap_or_else(no_light);
        resources.push(("light_sheets", wgpu::BindingResource::TextureView(light)));
        if let Some(GatheredPlanes { planes, coefficients }) = buffers.planes {
            resources.push(("planes_of", whole(planes)));
            resources.push(("coefficients", wgpu::BindingResource::TextureView(coefficients.unwrap_or(values))));
        } else {
            let membership = buffers.membership.unwrap_or(labels);
            resources.push(("membership", wgpu::BindingResource::TextureView(membership)));
        }
        resources.extend(carried.map(|carried| ("carried", whole(carried))));
        stage.bind(device, &resources)
    }

    /// Draws the first `patches` patches of the range at `offset`. The band must have been cleared.
    pub fn record(&self, pass: &mut ComputePass<'_>, band: &GatherBand, offset: u32, patches: u32) {
        let (stage, Some(first)) = (&band.stage, band.groups.first()) else { return };
        stage.dispatch(pass, first, &[offset], patches * band.workgroups_per_patch);
        for (group, args) in band.groups[1..].iter().zip(&band.next) {
            stage.dispatch_indirect(pass, group, &[offset], args);
        }
    }
}

fn compile(device: &Device, mode: GatherMode) -> ComputeStage {
    let stage = ShaderStages::COMPUTE;
    let mut slots = vec![
        ("frames", uniform::<Frame>(stage, false)),
        ("gathers", uniform::<GatherUniform>(stage, false)),
        ("patch_range", uniform::<PatchRange>(stage, true)),
        ("bricks", storage::<Brick>(stage, true)),
        ("bins", storage::<u32>(stage, true)),
        ("control_points", storage::<[f32; 4]>(stage, true)),
        ("values", texture_of_integers(stage, TextureViewDimension::D2Array)),
        ("acc", storage::<[f32; 4]>(stage, false)),
        ("gathered", storage::<Gathered>(stage, false)),
        ("half_boxes", storage::<[f32; 2]>(stage, true)),
        ("labels", texture_of_integers(stage, TextureViewDimension::D2Array)),
        ("next", storage::<Indirect>(stage, false)),
        ("cut", uniform::<Cut>(stage, false)),
        ("surfaces", depth_texture(stage)),
        ("colors", texture_of_integers(stage, TextureViewDimension::D2Array)),
        ("pages", texture_of_integers(stage, TextureViewDimension::D2Array)),
        ("light_sheets", texture(stage, TextureViewDimension::D3)),
    ];
    if mode.planes.is_some() {
        slots.push(("planes_of", uniform::<[FieldPlanes; MOST_LAYERS]>(stage, false)));
        slots.push(("coefficients", texture_of_integers(stage, TextureViewDimension::D2Array)));
        slots.push(("carried", storage::<[u32; 4]>(stage, false)));
    } else {
        slots.push(("membership", texture_of_integers(stage, TextureViewDimension::D2Array)));
    }
    let mut constants = vec![
        ("THREADS", f64::from(threads(device))),
        ("QUEUE", f64::from(queue(device, mode))),
        ("WORKGROUPS_PER_PATCH", f64::from(workgroups_per_patch(device, mode))),
        ("COMPOSITING", f64::from(mode.compositing as u32)),
        ("ORDER", f64::from(mode.order as u32)),
        ("PERSPECTIVE", f64::from(u8::from(mode.perspective))),
        ("PARALLELOGRAM", f64::from(mode.footprint_box as u32)),
        ("LABELS", f64::from(u8::from(mode.labels))),
        ("HOLES", f64::from(u8::from(mode.holes))),
        ("PAGE_BITS", f64::from(mode.page_bits)),
        ("CHANNELS", f64::from(mode.channels)),
        ("FULL_COLOR", f64::from(mode.full_color)),
        ("LIGHT", f64::from(u8::from(mode.light))),
        ("CUT", f64::from(u8::from(mode.rays.cut))),
        ("FIRST_HIT", f64::from(u8::from(mode.rays.first_hit))),
    ];
    let flag = |is_set| f64::from(u8::from(is_set));
    let lanes = lanes(device);
    let variants = match mode.planes {
        Some(planes) => {
            constants.extend([
                ("KERNEL_GRADIENT", flag(planes.gradient == Gradient::Kernel)),
                ("EXACT", flag(planes.exact)),
                ("OWN_COLORS", flag(planes.own_colors)),
                ("SUMS", f64::from(planes.sums())),
                ("SAVED", f64::from(planes.sums() * SHEETS * PATCH_THREADS)),
                ("SEGMENTS", f64::from(planes.segments)),
                ("LAYER_SHEETS", f64::from(planes.layer_sheets())),
                ("SHEETS_PER_TEST", f64::from(mode.sheets_per_test)),
                ("QUEUE_COLORS", f64::from(if planes.own_colors { queue(device, mode) } else { 1 })),
            ]);
            shaders::GATHER_PLANES
        }
        None => {
            let membership = ("MEMBERSHIP", flag(mode.membership));
            constants.extend([("ECONOMIES", flag(mode.economies)), membership, ("QUEUE_COLORS", 1.0)]);
            shaders::GATHER
        }
    };
    if lanes == Lanes::Workgroup {
        constants.push(("HELD", f64::from(held_slots(mode.planes) * threads(device))));
    }
    ComputeStage::new(device, variants[lanes as usize], "main", &slots, &constants)
}

/// Bytes of memory for a workgroup that the stage asks for.
pub const WORKGROUP_BYTES: u32 = 16384;

/// Workgroups that a patch is divided among: one for every round of its threads, or one for all.
fn workgroups_per_patch(device: &Device, mode: GatherMode) -> u32 {
    if mode.divided { PATCH_THREADS / threads(device) } else { 1 }
}

impl PlaneMode {
    /// The number of sums of a pixel on a slab plane (SPEC §9).
    fn sums(&self) -> u32 {
        let of_values = match self.gradient {
            Gradient::Kernel => 8,
            _ => 5,
        };
        of_values + if self.own_colors { 4 } else { 0 }
    }

    /// The number of colours of a group's first sheet at a patch's pixels that layers are added up in, if there are several.
    fn layer_sheets(&self) -> u32 {
        if self.layers > 1 { 4 * PATCH_THREADS } else { 1 }
    }
}

/// The workgroup memory in bytes of a patch's pixels: four sheets of a colour; or the sums on four planes, and the first sheet of all layers.
fn pixel_bytes(planes: Option<PlaneMode>) -> u32 {
    let (sums, others) = planes.map_or((4, 0), |planes| (planes.sums(), planes.layer_sheets()));
    (sums * SHEETS * PATCH_THREADS + others) * size_of::<[f32; 4]>() as u32
}

/// The bytes of a voxel in the queue: point, amount and blocks, and a colour of its own.
fn voxel_bytes(planes: Option<PlaneMode>) -> u32 {
    if planes.is_some_and(|planes| planes.own_colors) { 52 } else { 36 }
}

/// The bytes of a list of colours that a mode does not need.
const NO_COLORS_BYTES: u32 = 16;

/// The slots in which a lane of a workgroup holds numbers for the others: the most that a footprint or kernel has.
fn held_slots(planes: Option<PlaneMode>) -> u32 {
    match planes {
        None => 9,
        Some(PlaneMode { own_colors: true, .. }) => 7,
        Some(PlaneMode { gradient: Gradient::Kernel, .. }) => 6,
        Some(_) => 5,
    }
}

/// The workgroup memory in bytes in which lanes share values: those that they hold, and two numbers that they tell one another, twice.
fn shared_bytes(planes: Option<PlaneMode>, lanes: Lanes) -> u32 {
    let of_lane = held_slots(planes) * size_of::<[f32; 4]>() as u32 + 2 * size_of::<[u32; 2]>() as u32;
    if lanes == Lanes::Workgroup { PATCH_THREADS * of_lane } else { 0 }
}

/// The minimum workgroup memory in bytes: that of the pixels, of a queue of two voxels for each thread of the largest subgroup, and of what lanes share.
pub fn min_workgroup_bytes(planes: Option<PlaneMode>, lanes: Lanes) -> u32 {
    NO_COLORS_BYTES + pixel_bytes(planes) + shared_bytes(planes, lanes) + 64 * voxel_bytes(planes)
}

/// The maximum workgroup memory in bytes. On GPUs it is [`WORKGROUP_BYTES`]: an NVIDIA H100 (driver 580.159.04) draws nothing in some of the modes that need more, and no
/// other GPU has been tried. More would keep workgroups from running side by side there, too.
pub fn most_workgroup_bytes(device: &Device) -> u32 {
    most_bytes_of(device.adapter_info().device_type, device.limits().max_compute_workgroup_storage_size)
}

fn most_bytes_of(device_type: DeviceType, limit: u32) -> u32 {
    if device_type == DeviceType::Cpu { limit } else { limit.min(WORKGROUP_BYTES) }
}

/// The number of voxels in a workgroup's queue, which has the memory that the patch's pixels leave.
fn queue(device: &Device, mode: GatherMode) -> u32 {
    let lanes = lanes(device);
    let bytes = most_workgroup_bytes(device).min(2 * WORKGROUP_BYTES).max(min_workgroup_bytes(mode.planes, lanes));
    (bytes - NO_COLORS_BYTES - pixel_bytes(mode.planes) - shared_bytes(mode.planes, lanes))
        / voxel_bytes(mode.planes)
        / 32
        * 32
}

/// The size in bytes of the arguments that a dispatch leaves for the next.
const NEXT_BYTES: u64 = size_of::<Indirect>() as u64;

/// A band with its bind groups.
#[derive(Debug)]
pub struct GatherBand {
    stage: Arc<ComputeStage>,
    /// The number of workgroups per patch.
    workgroups_per_patch: u32,
    /// One bind group for every dispatch.
    groups: Vec<BindGroup>,
    /// [`Indirect`]: the arguments that each dispatch leaves for the next, for all patches or none.
    next: Vec<Buffer>,
}

impl GatherBand {
    /// Clears the band for a frame.
    pub fn clear(&self, encoder: &mut CommandEncoder) {
        self.next.iter().for_each(|args| encoder.clear_buffer(args, 0, None));
    }

    /// Bytes of GPU memory that a band uses with this many dispatches.
    pub fn estimate(dispatches: u32) -> u64 {
        u64::from(dispatches) * NEXT_BYTES
    }

    /// Bytes of GPU memory.
    pub fn gpu_bytes(&self) -> u64 {
        self.next.iter().map(Buffer::size).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gpus_draw_sums_of_at_most_16_kib() {
        let sums =
            |gradient, layers, own_colors| Some(PlaneMode { gradient, exact: true, layers, own_colors, segments: 2 });
        for kind in [DeviceType::DiscreteGpu, DeviceType::IntegratedGpu, DeviceType::VirtualGpu, DeviceType::Other] {
            let most = most_bytes_of(kind, 49152);
            for (mode, lanes, is_little) in [
                (None, Lanes::Subgroup, true),
                (None, Lanes::Workgroup, true),
                (sums(Gradient::Differences, 16, false), Lanes::OnlySubgroup, true),
                (sums(Gradient::Differences, 1, false), Lanes::Workgroup, true),
                (sums(Gradient::Differences, 2, false), Lanes::Workgroup, false),
                (sums(Gradient::Kernel, 1, false), Lanes::Subgroup, false),
                (sums(Gradient::Differences, 1, true), Lanes::OnlySubgroup, false),
            ] {
                assert_eq!(min_workgroup_bytes(mode, lanes) <= most, is_little, "{kind:?}, {mode:?}, {lanes:?}");
            }
            assert_eq!(most_bytes_of(kind, 8192), 8192, "{kind:?}");
        }
        assert_eq!(most_bytes_of(DeviceType::Cpu, 32768), 32768);
    }
}
