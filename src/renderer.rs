//! The renderer a host embeds: it owns pipelines, never a device, and neither submits nor waits.

use std::ops::Range;

use glam::{DVec2, DVec3, DVec4};
use wgpu::util::DeviceExt;
use wgpu::{BindGroup, Buffer, BufferUsages, CommandEncoder, Device, Queue, TextureFormat, TextureView};

use crate::classify::classify;
use crate::error::RenderError;
use crate::footprint::FootprintTable;
use crate::gpu::device::{self, DeviceError};
use crate::gpu::footprint_texture::FootprintTexture;
use crate::gpu::layout::{Frame, Slab};
use crate::gpu::targets::Targets;
use crate::gpu::voxel_list::VoxelLists;
use crate::kernel::Kernel;
use crate::pass::composite::Composite;
use crate::pass::resolve::Resolve;
use crate::pass::shade::{Shade, ShadeBuffers};
use crate::pass::splat::{Draw, Splat};
use crate::plan::{ListPlan, View};
use crate::scene::{ImageSettings, Scene};
use crate::shading::{Light, Shading};
use crate::splatting::{Compositing, FootprintForm, Order, Splatting};
use crate::stats::Counts;
use crate::transfer_function::TransferFunction;
use crate::volume::{Grid, Volume};

/// What a renderer is made for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RendererOptions {
    /// Format of the sheet buffer, `Rgba32Float` or `Rgba16Float`; `None` takes the better one that the device blends.
    pub sheet_format: Option<TextureFormat>,
    /// Format of the views that frames are drawn into; any renderable float or normalised format.
    pub target_format: TextureFormat,
}

impl Default for RendererOptions {
    fn default() -> Self {
        Self { sheet_format: None, target_format: TextureFormat::Rgba32Float }
    }
}

/// The pipelines of every stage, for one device. Volumes and frames are separate and can be many.
#[derive(Debug)]
pub struct Renderer {
    sheet_format: TextureFormat,
    shade: Shade,
    splat: Splat,
    composite: Composite,
    resolve: Resolve,
}

/// A volume under a transfer function, on the GPU: the voxels that take part.
#[derive(Debug)]
pub struct ClassifiedVolume {
    grid: Grid,
    transfer: TransferFunction,
    lists: VoxelLists,
    control_points: Buffer,
}

impl ClassifiedVolume {
    /// Classifies a volume (SPEC §3) and uploads the voxels that take part. The volume itself is no longer needed.
    pub fn new(device: &Device, volume: &Volume, transfer: &TransferFunction) -> Self {
        Self {
            grid: *volume.grid(),
            transfer: transfer.clone(),
            lists: VoxelLists::upload(device, &classify(volume, transfer)),
            control_points: device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
                label: Some("sheetsplat.control_points"),
                contents: bytemuck::cast_slice(&control_points(transfer).0),
                usage: BufferUsages::STORAGE,
            }),
        }
    }
}

/// A frame whose buffers are all allocated and filled: recording it cannot fail, and can be repeated.
#[derive(Debug)]
pub struct PreparedFrame {
    form: FootprintForm,
    width: u32,
    /// What the frame is made of.
    pub counts: Counts,
    /// Bytes of GPU memory that the frame and its volume hold.
    pub gpu_bytes: u64,
    max_groups: u32,
    sheet: TextureView,
    targets: Targets,
    lists: Vec<PreparedList>,
    slabs: Vec<PreparedSlab>,
    composite_groups: Vec<BindGroup>,
    resolve_groups: Vec<BindGroup>,
}

#[derive(Debug)]
struct PreparedList {
    splats: Buffer,
    count: u32,
    shade_group: BindGroup,
    splat_group: BindGroup,
}

/// A slab that any splat touches: where its uniform is, and each list's range of splats.
#[derive(Debug)]
struct PreparedSlab {
    offset: u32,
    ranges: Vec<Range<u32>>,
}

impl Renderer {
    /// Compiles every stage.
    ///
    /// # Errors
    /// If a limit of the device is too small or it cannot blend the sheet format asked for.
    pub fn new(device: &Device, options: &RendererOptions) -> Result<Self, DeviceError> {
        device::check(device)?;
        let sheet_format = device::sheet_format(device, options.sheet_format)?;
        Ok(Self {
            sheet_format,
            shade: Shade::new(device),
            splat: Splat::new(device, sheet_format),
            composite: Composite::new(device),
            resolve: Resolve::new(device, options.target_format),
        })
    }

    /// Format of the sheet buffer.
    pub fn sheet_format(&self) -> TextureFormat {
        self.sheet_format
    }

    /// Plans a frame and allocates all it needs. Of the scene it reads camera, image, shading and splatting.
    ///
    /// # Errors
    /// If the scene asks for something not implemented, or for more than the device's limits allow.
    pub fn prepare(
        &self,
        device: &Device,
        queue: &Queue,
        volume: &ClassifiedVolume,
        scene: &Scene,
    ) -> Result<PreparedFrame, RenderError> {
        let splatting = &scene.splatting;
        let size = [scene.image.width, scene.image.height];
        let targets = Targets::new(device, size, self.sheet_format)?;
        let sheet = targets.sheet.create_view(&wgpu::TextureViewDescriptor::default());
        let kernel = Kernel::new(splatting.radius, splatting.falloff);
        let view = View::new(&volume.grid, &scene.camera, splatting, size)?;
        let plans: Vec<ListPlan> = volume
            .lists
            .lists
            .iter()
            .map(|list| ListPlan::new(&volume.grid, &list.indices, &view, &kernel))
            .collect();

        let table = FootprintTable::new(splatting.footprint, &kernel, view.slabs.width);
        let footprints = FootprintTexture::upload(device, queue, &table);
        let frame = frame_uniform(&view, &kernel, scene, volume);
        let frame = init(device, "sheetsplat.frame", bytemuck::bytes_of(&frame), BufferUsages::UNIFORM);
        let (slab_uniforms, slabs) = prepare_slabs(device, &view, &plans);

        let lists: Vec<PreparedList> = (volume.lists.lists.iter().zip(&plans))
            .filter(|(_, plan)| !plan.buckets.order.is_empty())
            .map(|(list, plan)| {
                let order = &plan.buckets.order;
                let splats = device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some("sheetsplat.splats"),
                    size: (order.len() * size_of::<crate::gpu::layout::Splat>()) as u64,
                    usage: BufferUsages::STORAGE | BufferUsages::COPY_SRC,
                    mapped_at_creation: false,
                });
                let shade_group = self.shade.bind(
                    device,
                    ShadeBuffers {
                        frame: &frame,
                        voxels: &list.voxels,
                        order: &init(device, "sheetsplat.order", bytemuck::cast_slice(order), BufferUsages::STORAGE),
                        splats: &splats,
                        control_points: &volume.control_points,
                    },
                );
                let splat_group = self.splat.bind(device, &frame, &slab_uniforms, &splats, &footprints);
                PreparedList { splats, count: order.len() as u32, shade_group, splat_group }
            })
            .collect();

        let list_bytes: u64 = lists.iter().map(|list| list.splats.size() + 4 * u64::from(list.count)).sum();
        let uniform_bytes = frame.size() + slab_uniforms.size() + volume.control_points.size();
        Ok(PreparedFrame {
            form: splatting.footprint,
            width: size[0],
            counts: count(volume, size, &plans, slabs.len() as u64),
            gpu_bytes: volume.lists.gpu_bytes() + targets.gpu_bytes() + footprints.gpu_bytes + list_bytes + uniform_bytes,
            max_groups: device.limits().max_compute_workgroups_per_dimension,
            composite_groups: targets.bands.iter().map(|b| self.composite.bind(device, &frame, b, &sheet)).collect(),
            resolve_groups: targets.bands.iter().map(|b| self.resolve.bind(device, &frame, b)).collect(),
            sheet,
            targets,
            lists,
            slabs: if splatting.order == Order::BackToFront { slabs.into_iter().rev().collect() } else { slabs },
        })
    }

    /// Records a whole frame. The target must have the renderer's target format and the scene's image size.
    pub fn record(&self, encoder: &mut CommandEncoder, frame: &PreparedFrame, target: &TextureView) {
        let bands = || frame.targets.bands.iter().map(|band| band.band);
        for band in &frame.targets.bands {
            encoder.clear_buffer(&band.acc, 0, None);
        }
        for list in &frame.lists {
            self.shade.record(encoder, &list.shade_group, list.count, frame.max_groups);
        }
        for slab in &frame.slabs {
            let draws = (frame.lists.iter().zip(&slab.ranges))
                .filter(|(_, range)| !range.is_empty())
                .map(|(list, range)| Draw { group: &list.splat_group, splats: range.clone() });
            self.splat.record(encoder, frame.form, &frame.sheet, slab.offset, draws);
            self.composite.record(encoder, frame.width, frame.composite_groups.iter().zip(bands()));
        }
        self.resolve.record(encoder, target, frame.width, frame.resolve_groups.iter().zip(bands()));
    }
}

impl PreparedFrame {
    /// The projected and shaded voxels of every list, once the frame was drawn.
    pub fn splats(&self) -> impl Iterator<Item = &Buffer> {
        self.lists.iter().map(|list| &list.splats)
    }
}

/// The slabs that splats touch, front to back, and their uniforms at the device's offset alignment.
fn prepare_slabs(device: &Device, view: &View, plans: &[ListPlan]) -> (Buffer, Vec<PreparedSlab>) {
    let stride = size_of::<Slab>().next_multiple_of(device.limits().min_uniform_buffer_offset_alignment as usize);
    let drawn: Vec<&ListPlan> = plans.iter().filter(|plan| !plan.buckets.order.is_empty()).collect();
    let (first, end) = slab_range(plans);
    let mut uniforms = Vec::new();
    let mut slabs = Vec::new();
    for k in first..end {
        let ranges: Vec<_> = drawn.iter().map(|plan| plan.buckets.touching(k)).collect();
        if ranges.iter().any(|range| !range.is_empty()) {
            slabs.push(PreparedSlab { offset: uniforms.len() as u32, ranges });
            let slab = Slab { near: (f64::from(k) * view.slabs.width) as f32 };
            uniforms.extend_from_slice(bytemuck::bytes_of(&slab));
            uniforms.resize(uniforms.len().next_multiple_of(stride), 0);
        }
    }
    uniforms.resize(uniforms.len().max(stride), 0);
    (init(device, "sheetsplat.slabs", &uniforms, BufferUsages::UNIFORM), slabs)
}

/// The slabs that any kernel touches, `first..end`.
fn slab_range(plans: &[ListPlan]) -> (i32, i32) {
    let first = plans.iter().map(|plan| plan.slabs.0).min().unwrap_or(0);
    let end = plans.iter().map(|plan| plan.slabs.1).max().unwrap_or(0);
    (first, end)
}

fn count(volume: &ClassifiedVolume, size: [u32; 2], plans: &[ListPlan], sheets_drawn: u64) -> Counts {
    const TILE: u32 = 32;
    let tiles = u64::from(size[0].div_ceil(TILE)) * u64::from(size[1].div_ceil(TILE));
    let (first, end) = slab_range(plans);
    let sheets = (end - first) as u64;
    Counts {
        voxels_total: volume.grid.dims.as_u64vec3().element_product(),
        voxels_in_range: volume.lists.len(),
        voxels_shaded: plans.iter().map(|plan| plan.buckets.order.len() as u64).sum(),
        sections_total: plans.iter().map(|plan| plan.sections_total).sum(),
        sections_rasterized: plans.iter().map(|plan| plan.sections_on_screen).sum(),
        sheets,
        tiles_total: tiles * sheets,
        tiles_composited: tiles * sheets_drawn,
    }
}

fn frame_uniform(view: &View, kernel: &Kernel, scene: &Scene, volume: &ClassifiedVolume) -> Frame {
    let Scene { image, shading, splatting, .. } = scene;
    let ImageSettings { background: [r, g, b, a], .. } = *image;
    let to_eye = -view.basis.w;
    let to_light = match shading.light {
        Light::Headlight => to_eye,
        Light::Direction(direction) => direction.normalize(),
    };
    let Shading { enabled, ambient, diffuse, specular, shininess, .. } = *shading;
    let Splatting { compositing, order, .. } = *splatting;
    let dims = volume.grid.dims;
    let matrix = |m: &glam::DMat2| m.to_cols_array().map(|x| x as f32);
    let [color_end, opacity_end, gradient_opacity_end] = control_points(&volume.transfer).1;
    Frame {
        screen_from_voxel: view.screen_from_voxel.map(|row| row.as_vec4().to_array()),
        pixels_from_footprint: matrix(&view.footprint.pixels_from_footprint),
        footprint_from_pixels: matrix(&view.footprint.footprint_from_pixels),
        light: to_light.extend(f64::from(u8::from(enabled))).as_vec4().to_array(),
        half_vector: half_vector(to_light, to_eye).extend(0.0).as_vec4().to_array(),
        shading: DVec4::new(ambient, diffuse, specular, shininess).as_vec4().to_array(),
        background: DVec4::new(r * a, g * a, b * a, a).as_vec4().to_array(),
        dims: dims.extend(0).to_array(),
        ramps: [color_end, opacity_end, gradient_opacity_end, 0],
        size: view.size,
        amplitude: (view.footprint.amplitude / view.lambda) as f32,
        radius: kernel.radius() as f32,
        support: kernel.support() as f32,
        falloff: kernel.falloff() as f32,
        slab_width: view.slabs.width as f32,
        compositing: match compositing {
            Compositing::Linear => 0,
            Compositing::Exponential => 1,
            Compositing::Xray => 2,
        },
        order: match order {
            Order::FrontToBack => 0,
            Order::BackToFront => 1,
        },
        padding_0: 0,
        padding_1: 0,
        padding_2: 0,
    }
}

/// `hv = normalize(l + c)`, 0 where they cancel (SPEC §3).
fn half_vector(to_light: DVec3, to_eye: DVec3) -> DVec3 {
    let sum = to_light + to_eye;
    // Opposite unit vectors add up to rounding noise, not to 0.
    if sum.length() < 1e-12 { DVec3::ZERO } else { sum.normalize() }
}

/// The control points of all ramps for `shade.wgsl`, and where each ramp ends.
fn control_points(transfer: &TransferFunction) -> (Vec<[f32; 4]>, [u32; 3]) {
    let scalar = |&(at, y): &(f64, f64)| DVec2::new(at, y).extend(0.0).extend(0.0);
    let always = [(0.0, 1.0)];
    let gradient_opacity = transfer.gradient_opacity.as_ref().map_or(&always[..], |ramp| ramp.points());
    let mut points: Vec<DVec4> =
        transfer.color.points().iter().map(|&(at, rgb)| DVec4::new(at, rgb.x, rgb.y, rgb.z)).collect();
    let color_end = points.len() as u32;
    points.extend(transfer.opacity.points().iter().map(scalar));
    let opacity_end = points.len() as u32;
    points.extend(gradient_opacity.iter().map(scalar));
    let ends = [color_end, opacity_end, points.len() as u32];
    (points.iter().map(|point| point.as_vec4().to_array()).collect(), ends)
}

fn init(device: &Device, label: &str, contents: &[u8], usage: BufferUsages) -> Buffer {
    device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: Some(label), contents, usage })
}
