//! The renderer a host embeds: it owns pipelines, never a device, and neither submits nor waits.

use wgpu::util::DeviceExt;
use wgpu::{BindGroup, Buffer, BufferUsages, CommandEncoder, Device, Queue, TextureFormat, TextureView};

use crate::brick;
use crate::classify::classify;
use crate::error::RenderError;
use crate::footprint::FootprintTable;
use crate::gpu::device::{self, DeviceError};
use crate::gpu::footprint_texture::FootprintTexture;
use crate::gpu::layout::{Group, Tally};
use crate::gpu::targets::Targets;
use crate::gpu::uniforms::{self, Ramps};
use crate::gpu::voxel_list::VoxelLists;
use crate::kernel::Kernel;
use crate::pass::composite::Composite;
use crate::pass::cull::{Cull, CullBuffers, CullList};
use crate::pass::occlude::Occlude;
use crate::pass::resolve::Resolve;
use crate::pass::splat::Splat;
use crate::pass::tiles::{TileLists, Tiles};
use crate::plan::{FramePlan, View, add_sections, count_sections, tile_grid};
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
    /// Sheets drawn by one quad: 1, 2 or 4; `None` takes as many as the device's colour attachments allow.
    pub sheets_per_group: Option<u32>,
    /// Format of the views that frames are drawn into; any renderable float or normalised format.
    pub target_format: TextureFormat,
}

impl Default for RendererOptions {
    fn default() -> Self {
        Self { sheet_format: None, sheets_per_group: None, target_format: TextureFormat::Rgba32Float }
    }
}

/// The pipelines of every stage, for one device. Volumes and frames are separate and can be many.
#[derive(Debug)]
pub struct Renderer {
    sheet_format: TextureFormat,
    sheets: u32,
    cull: Cull,
    tiles: Tiles,
    splat: Splat,
    composite: Composite,
    occlude: Occlude,
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
        let (voxels, bricks) = brick::group(volume.grid(), &classify(volume, transfer));
        let ramps = Ramps::new(transfer);
        let points = bytemuck::cast_slice(&ramps.points);
        Self {
            grid: *volume.grid(),
            lists: VoxelLists::upload(device, &voxels, &bricks),
            control_points: init(device, "sheetsplat.control_points", points, BufferUsages::STORAGE),
            ramps,
        }
    }

    /// What a frame is made of (Table 4), from what it left on the GPU: its tally, and the tiles composited by every group.
    pub fn count(&self, plan: &FramePlan, tally: &Tally, tiles: &[u32]) -> Counts {
        let lists = self.lists.lists.iter();
        let sections = lists.filter_map(|list| count_sections(&self.grid, &list.indices, &plan.view));
        let (sections_total, slabs) = sections.reduce(add_sections).unwrap_or((0, 0..0));
        let sheets = slabs.len() as u64;
        // A group's first or last sheets can lie outside of what any kernel touches.
        let sheets_of = |first: i32| {
            (first + plan.sheets as i32).min(slabs.end).saturating_sub(first.max(slabs.start)).max(0) as u64
        };
        let [columns, rows] = tile_grid(plan.view.size).map(u64::from);
        Counts {
            voxels_total: self.grid.dims.as_u64vec3().element_product(),
            voxels_in_range: self.lists.len(),
            voxels_shaded: tally.voxels_shaded.into(),
            sections_total,
            sections_rasterized: tally.sections_rasterized.into(),
            sheets,
            tiles_total: columns * rows * sheets,
            tiles_composited: (plan.groups.iter().zip(tiles))
                .map(|(group, &tiles)| u64::from(tiles) * sheets_of(group.first_slab))
                .sum(),
            quads: tally.quads.into(),
            bricks_tested: tally.bricks_tested.into(),
            bricks_visited: tally.bricks_visited.into(),
        }
    }
}

/// A frame whose buffers are all allocated and filled: recording it cannot fail, and can be repeated.
#[derive(Debug)]
pub struct PreparedFrame {
    /// What the frame draws.
    pub plan: FramePlan,
    form: FootprintForm,
    targets: Targets,
    sheet_views: Vec<TextureView>,
    tally: Buffer,
    tile_lists: TileLists,
    lists: Vec<PreparedList>,
    group_stride: u32,
    clear_group: BindGroup,
    composite_groups: Vec<BindGroup>,
    occlude_groups: [BindGroup; 2],
    resolve_groups: Vec<BindGroup>,
    gpu_bytes: u64,
}

#[derive(Debug)]
struct PreparedList {
    cull: CullList,
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
        let sheets = options.sheets_per_group.unwrap_or(device::sheets_per_group(device, sheet_format));
        Ok(Self {
            sheet_format,
            sheets,
            cull: Cull::new(device, sheets),
            tiles: Tiles::new(device),
            splat: Splat::new(device, sheet_format, sheets),
            composite: Composite::new(device),
            occlude: Occlude::new(device),
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
        let targets = Targets::new(device, size, self.sheet_format, self.sheets)?;
        let kernel = Kernel::new(splatting.radius, splatting.falloff);
        let view = View::new(&volume.grid, &scene.camera, splatting, size)?;
        let lists = volume.lists.lists.iter().map(|list| list.bricks.as_slice());
        let plan = FramePlan::new(lists, view, self.sheets, splatting.order);

        let table = FootprintTable::new(splatting.footprint, &kernel, view.slabs.width);
        let footprints = FootprintTexture::upload(device, queue, &table);
        let frame = uniforms::frame(&view, &kernel, &volume.grid, &volume.ramps, scene);
        let frame = init(device, "sheetsplat.frame", bytemuck::bytes_of(&frame), BufferUsages::UNIFORM);
        let alignment = device.limits().min_uniform_buffer_offset_alignment as usize;
        let group_stride = size_of::<Group>().next_multiple_of(alignment);
        let groups = init(device, "sheetsplat.groups", &uniforms::groups(&plan, group_stride), BufferUsages::UNIFORM);
        let tally = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("sheetsplat.tally"),
            size: size_of::<Tally>() as u64 + targets.opaque_tiles.size(),
            usage: BufferUsages::STORAGE | BufferUsages::COPY_DST | BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let shared = CullBuffers {
            frame: &frame,
            groups: &groups,
            control_points: &volume.control_points,
            occluded: &targets.occluded,
            tally: &tally,
        };
        let lists: Vec<PreparedList> = (volume.lists.lists.iter().zip(&plan.orders).enumerate())
            .map(|(at, (list, order))| {
                let (most_bricks, most_voxels) = most(plan.groups.iter().map(|group| {
                    let bricks = group.bricks[at].clone();
                    order[bricks.start as usize..bricks.end as usize]
                        .iter()
                        .map(|&brick| list.bricks[brick as usize].count)
                }));
                let order = init(device, "sheetsplat.order", bytemuck::cast_slice(order), BufferUsages::STORAGE);
                let cull = self.cull.prepare(device, shared, list, &order, most_bricks, most_voxels);
                let splat_group = self.splat.bind(device, &frame, &groups, &cull, &footprints);
                PreparedList { cull, splat_group }
            })
            .collect();
        let tile_lists = self.tiles.prepare(device, &frame, &groups, &tally, &targets, plan.groups.len());
        let sheets = targets.sheets.create_view(&wgpu::TextureViewDescriptor {
            dimension: Some(wgpu::TextureViewDimension::D2Array),
            ..wgpu::TextureViewDescriptor::default()
        });
        let sheet_view = |layer| {
            targets.sheets.create_view(&wgpu::TextureViewDescriptor {
                dimension: Some(wgpu::TextureViewDimension::D2),
                base_array_layer: layer,
                array_layer_count: Some(1),
                ..wgpu::TextureViewDescriptor::default()
            })
        };
        let list_bytes: u64 = lists.iter().map(|list| list.cull.gpu_bytes()).sum();
        let other_bytes = frame.size() + groups.size() + volume.control_points.size() + tally.size();
        let tiles = &tile_lists.composited;
        let composite = |band| self.composite.bind(device, &frame, band, &sheets, tiles, &targets);
        Ok(PreparedFrame {
            form: splatting.footprint,
            gpu_bytes: volume.lists.gpu_bytes() + targets.gpu_bytes() + footprints.gpu_bytes + list_bytes + other_bytes,
            clear_group: self.splat.bind_clear(device, &frame, tiles),
            composite_groups: targets.bands.iter().map(composite).collect(),
            occlude_groups: self.occlude.bind(device, &frame, &tile_lists.occluding, &targets),
            resolve_groups: targets.bands.iter().map(|band| self.resolve.bind(device, &frame, band)).collect(),
            sheet_views: (0..self.sheets).map(sheet_view).collect(),
            group_stride: group_stride as u32,
            plan,
            targets,
            tally,
            tile_lists,
            lists,
        })
    }

    /// Records a whole frame. The target must have the renderer's target format and the scene's image size.
    pub fn record(&self, encoder: &mut CommandEncoder, frame: &PreparedFrame, target: &TextureView) {
        let PreparedFrame { targets, tile_lists, .. } = frame;
        let masks = [&targets.opaque, &targets.opaque_columns, &targets.occluded, &targets.opaque_tiles, &frame.tally];
        let accs = targets.bands.iter().map(|band| &band.acc);
        for buffer in accs.chain(masks).chain(frame.lists.iter().map(|list| &list.cull.states)) {
            encoder.clear_buffer(buffer, 0, None);
        }
        let mut offsets = (0..).step_by(frame.group_stride as usize);
        for group in &frame.plan.groups {
            // (list, offset of its group uniform) for the lists that reach into the group.
            let lists: Vec<(&PreparedList, u32)> = (frame.lists.iter().zip(&mut offsets).zip(&group.bricks))
                .filter(|(_, bricks)| !bricks.is_empty())
                .map(|(list, _)| list)
                .collect();
            let Some(&(_, any_offset)) = lists.first() else { continue };

            let mut pass = encoder.begin_compute_pass(&compute("sheetsplat.cull"));
            for &(list, offset) in &lists {
                self.cull.record(&mut pass, &list.cull, offset);
            }
            self.tiles.record(&mut pass, tile_lists, any_offset);
            drop(pass);

            let clear = (&frame.clear_group, &tile_lists.composited);
            let draws = lists.iter().map(|(list, offset)| (&list.splat_group, *offset, &list.cull.draw_args));
            self.splat.record(encoder, frame.form, &frame.sheet_views, clear, draws);

            let mut pass = encoder.begin_compute_pass(&compute("sheetsplat.composite"));
            self.composite.record(&mut pass, &frame.composite_groups, &tile_lists.composited);
            self.occlude.record(&mut pass, &frame.occlude_groups, &tile_lists.occluding);
        }
        let bands = targets.bands.iter().map(|band| band.band);
        self.resolve.record(encoder, target, targets.size[0], frame.resolve_groups.iter().zip(bands));
    }
}

impl PreparedFrame {
    /// The counts that a drawn frame left on the GPU: a [`Tally`].
    pub fn tally(&self) -> &Buffer {
        &self.tally
    }

    /// Tiles composited by every group, `[u32]`.
    pub fn tile_counts(&self) -> &Buffer {
        &self.tile_lists.counts
    }

    /// Bytes of GPU memory that the frame and its volume hold.
    pub fn gpu_bytes(&self) -> u64 {
        self.gpu_bytes
    }
}

/// The most bricks and voxels that any group can visit, from the voxel counts of every group's bricks.
fn most<C: ExactSizeIterator<Item = u32>>(groups: impl Iterator<Item = C>) -> (u32, u32) {
    groups.fold((0, 0), |(bricks, voxels), counts| (bricks.max(counts.len() as u32), voxels.max(counts.sum())))
}

fn compute(label: &str) -> wgpu::ComputePassDescriptor<'_> {
    wgpu::ComputePassDescriptor { label: Some(label), timestamp_writes: None }
}

fn init(device: &Device, label: &str, contents: &[u8], usage: BufferUsages) -> Buffer {
    device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: Some(label), contents, usage })
}
