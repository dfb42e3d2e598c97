//! The renderer a host embeds: it owns pipelines, never a device, and neither submits nor waits.

use wgpu::util::DeviceExt;
use wgpu::{BindGroup, Buffer, BufferUsages, CommandEncoder, Device, Queue, TextureFormat, TextureView};

use crate::classify::classify;
use crate::error::RenderError;
use crate::footprint::FootprintTable;
use crate::gpu::device::{self, DeviceError};
use crate::gpu::footprint_texture::FootprintTexture;
use crate::gpu::layout::{self, Slab};
use crate::gpu::targets::Targets;
use crate::gpu::uniforms::{self, Ramps};
use crate::gpu::voxel_list::{VoxelList, VoxelLists};
use crate::kernel::Kernel;
use crate::pass::composite::Composite;
use crate::pass::resolve::Resolve;
use crate::pass::shade::{Shade, ShadeBuffers};
use crate::pass::splat::{Draw, Splat};
use crate::plan::{FramePlan, SlabPlan, View};
use crate::scene::Scene;
use crate::splatting::FootprintForm;
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
    lists: VoxelLists,
    ramps: Ramps,
    control_points: Buffer,
}

impl ClassifiedVolume {
    /// Classifies a volume (SPEC §3) and uploads the voxels that take part. The volume itself is no longer needed.
    pub fn new(device: &Device, volume: &Volume, transfer: &TransferFunction) -> Self {
        let ramps = Ramps::new(transfer);
        let points = bytemuck::cast_slice(&ramps.points);
        Self {
            grid: *volume.grid(),
            lists: VoxelLists::upload(device, &classify(volume, transfer)),
            control_points: init(device, "sheetsplat.control_points", points, BufferUsages::STORAGE),
            ramps,
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
    /// `None` where no voxel of the list is on the screen.
    lists: Vec<Option<PreparedList>>,
    slab_stride: u32,
    slabs: Vec<SlabPlan>,
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
        let kernel = Kernel::new(splatting.radius, splatting.falloff);
        let view = View::new(&volume.grid, &scene.camera, splatting, size)?;
        let lists = volume.lists.lists.iter().map(|list| list.indices.as_slice());
        let plan = FramePlan::new(&volume.grid, lists, view, &kernel, splatting.order);

        let table = FootprintTable::new(splatting.footprint, &kernel, view.slabs.width);
        let footprints = FootprintTexture::upload(device, queue, &table);
        let frame = uniforms::frame(&view, &kernel, &volume.grid, &volume.ramps, scene);
        let frame = init(device, "sheetsplat.frame", bytemuck::bytes_of(&frame), BufferUsages::UNIFORM);
        let slab_stride =
            size_of::<Slab>().next_multiple_of(device.limits().min_uniform_buffer_offset_alignment as usize);
        let slab_bytes = uniforms::slabs(&plan.slabs, slab_stride);
        let slabs = init(device, "sheetsplat.slabs", &slab_bytes, BufferUsages::UNIFORM);
        let lists: Vec<_> = (volume.lists.lists.iter().zip(&plan.orders))
            .map(|(list, order)| {
                (!order.is_empty()).then(|| self.prepare_list(device, volume, list, order, &frame, &slabs, &footprints))
            })
            .collect();

        let sheet = targets.sheet.create_view(&wgpu::TextureViewDescriptor::default());
        let list_bytes: u64 = lists.iter().flatten().map(|list| list.splats.size() + 4 * u64::from(list.count)).sum();
        let uniform_bytes = frame.size() + slabs.size() + volume.control_points.size();
        Ok(PreparedFrame {
            form: splatting.footprint,
            width: size[0],
            counts: plan.counts,
            gpu_bytes: volume.lists.gpu_bytes()
                + targets.gpu_bytes()
                + footprints.gpu_bytes
                + list_bytes
                + uniform_bytes,
            max_groups: device.limits().max_compute_workgroups_per_dimension,
            composite_groups: targets.bands.iter().map(|b| self.composite.bind(device, &frame, b, &sheet)).collect(),
            resolve_groups: targets.bands.iter().map(|b| self.resolve.bind(device, &frame, b)).collect(),
            sheet,
            targets,
            lists,
            slab_stride: slab_stride as u32,
            slabs: plan.slabs,
        })
    }

    #[expect(clippy::too_many_arguments, reason = "the resources of one bind group each")]
    fn prepare_list(
        &self,
        device: &Device,
        volume: &ClassifiedVolume,
        list: &VoxelList,
        order: &[u32],
        frame: &Buffer,
        slabs: &Buffer,
        footprints: &FootprintTexture,
    ) -> PreparedList {
        let splats = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("sheetsplat.splats"),
            size: (order.len() * size_of::<layout::Splat>()) as u64,
            usage: BufferUsages::STORAGE | BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let order_buffer = init(device, "sheetsplat.order", bytemuck::cast_slice(order), BufferUsages::STORAGE);
        let buffers = ShadeBuffers {
            frame,
            voxels: &list.voxels,
            order: &order_buffer,
            splats: &splats,
            control_points: &volume.control_points,
        };
        PreparedList {
            count: order.len() as u32,
            shade_group: self.shade.bind(device, buffers),
            splat_group: self.splat.bind(device, frame, slabs, &splats, footprints),
            splats,
        }
    }

    /// Records a whole frame. The target must have the renderer's target format and the scene's image size.
    pub fn record(&self, encoder: &mut CommandEncoder, frame: &PreparedFrame, target: &TextureView) {
        let bands = || frame.targets.bands.iter().map(|band| band.band);
        for band in &frame.targets.bands {
            encoder.clear_buffer(&band.acc, 0, None);
        }
        for list in frame.lists.iter().flatten() {
            self.shade.record(encoder, &list.shade_group, list.count, frame.max_groups);
        }
        for (slab, offset) in frame.slabs.iter().zip((0..).step_by(frame.slab_stride as usize)) {
            let draws = (frame.lists.iter().zip(&slab.splats))
                .filter_map(|(list, splats)| Some(Draw { group: &list.as_ref()?.splat_group, splats: splats.clone() }));
            self.splat.record(encoder, frame.form, &frame.sheet, offset, draws);
            self.composite.record(encoder, frame.width, frame.composite_groups.iter().zip(bands()));
        }
        self.resolve.record(encoder, target, frame.width, frame.resolve_groups.iter().zip(bands()));
    }
}

impl PreparedFrame {
    /// The projected and shaded voxels of every list, once the frame was drawn.
    pub fn splats(&self) -> impl Iterator<Item = &Buffer> {
        self.lists.iter().flatten().map(|list| &list.splats)
    }
}

fn init(device: &Device, label: &str, contents: &[u8], usage: BufferUsages) -> Buffer {
    device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: Some(label), contents, usage })
}
