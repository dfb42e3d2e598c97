//! Early splat elimination (§6): the bricks that a sheet group visits, the voxels of these that it draws, their list without gaps, and the
//! shading of those that were not shaded before.

use wgpu::{BindGroup, Buffer, BufferUsages, ComputePass, Device, ShaderStages, TextureView};

use crate::error::RenderError;
use crate::gpu::bindings::{BufferSpec, ComputeStage, at_offset, buffer_spec, grown, storage, uniform};
use crate::gpu::brick_lists::BrickBuffer;
use crate::gpu::layout::{Brick, BrickState, Culled, Frame, Indirect, SheetGroup, Splat, Visit};
use crate::gpu::shaders;
use crate::gpu::volume_texture::{OwnColors, Pages};
use crate::lists::brick::BRICK_VOXELS;
use crate::pass::shade::{Shade, ShadeBuffers, ShadeGroup};
use crate::pass::values::{PlaneBuffers, Values, ValuesBuffers, ValuesGroup};

/// The four stages' pipelines.
#[derive(Debug)]
pub struct Cull {
    bricks: ComputeStage,
    voxels: ComputeStage,
    compact: ComputeStage,
    prepared: VoxelStage,
}

/// What becomes of voxels that are drawn for the first time.
#[derive(Debug)]
enum VoxelStage {
    Shade(Box<Shade>),
    Values(Box<Values>),
}

/// One list's buffers and bind groups.
#[derive(Debug)]
pub struct CullList {
    /// `[BrickState]`, zeroed at the start of a frame.
    pub states: Buffer,
    /// `[Splat]`, or for planes `[FieldVoxel]`, one per slot of the list, written when its voxel is first drawn.
    pub splats: Buffer,
    /// `[u32]`: the splats that the current group draws.
    pub instances: Buffer,
    /// [`Indirect`]: the number of instances.
    pub draw_args: Buffer,
    visits: Buffer,
    visit_args: Buffer,
    fresh: Buffer,
    fresh_args: Buffer,
    groups: [BindGroup; 3],
    prepared_group: VoxelGroup,
}

/// Bound buffers of a [`VoxelStage`].
#[derive(Debug)]
enum VoxelGroup {
    Shade(ShadeGroup),
    Values(ValuesGroup),
}

/// The buffers that all lists share.
#[derive(Clone, Copy, Debug)]
pub struct CullBuffers<'a> {
    /// One [`Frame`].
    pub frame: &'a Buffer,
    /// One [`SheetGroup`] at every dynamic offset.
    pub groups: &'a Buffer,
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
    /// The light sheets, if voxels are shaded by any.
    pub light: Option<&'a TextureView>,
    /// The control points of the ramps.
    pub control_points: &'a Buffer,
    /// The occlusion buffer.
    pub occluded: &'a Buffer,
    /// One [`Culled`].
    pub culled: &'a Buffer,
    /// What voxels are drawn onto planes by; for stages of planes.
    pub planes: Option<PlaneBuffers<'a>>,
}

impl Cull {
    /// Compiles the stages for groups of `sheets` sheets.
    pub fn new(device: &Device, sheets: u32) -> Self {
        Self::compiled(device, sheets, VoxelStage::Shade(Box::new(Shade::new(device))))
    }

    /// Compiles the stages for groups that are single planes (SPEC §9).
    pub fn of_planes(device: &Device) -> Self {
        Self::compiled(device, 1, VoxelStage::Values(Box::default()))
    }

    fn compiled(device: &Device, sheets: u32, prepared: VoxelStage) -> Self {
        let stage = ShaderStages::COMPUTE;
        let is_plane = matches!(prepared, VoxelStage::Values(_));
        let sheets = [("SHEETS", f64::from(sheets)), ("PLANE", f64::from(u8::from(is_plane)))];
        let bricks = [
            ("frames", uniform::<Frame>(stage, false)),
            ("sheet_group", uniform::<SheetGroup>(stage, true)),
            ("bricks", storage::<Brick>(stage, true)),
            ("order", storage::<u32>(stage, true)),
            ("states", storage::<BrickState>(stage, true)),
            ("occluded", storage::<u32>(stage, true)),
            ("visits", storage::<Visit>(stage, false)),
            ("args", storage::<Indirect>(stage, false)),
            ("culled", storage::<Culled>(stage, false)),
        ];
        let voxels = [
            ("frames", uniform::<Frame>(stage, false)),
            ("sheet_group", uniform::<SheetGroup>(stage, true)),
            ("bricks", storage::<Brick>(stage, true)),
            ("occluded", storage::<u32>(stage, true)),
            ("visits", storage::<Visit>(stage, false)),
            ("states", storage::<BrickState>(stage, false)),
            ("culled", storage::<Culled>(stage, false)),
            ("visit_args", storage::<Indirect>(stage, true)),
        ];
        let compact = [
            ("visits", storage::<Visit>(stage, true)),
            ("visit_args", storage::<Indirect>(stage, true)),
            ("instances", storage::<u32>(stage, false)),
            ("draw_args", storage::<Indirect>(stage, false)),
            ("fresh", storage::<u32>(stage, false)),
            ("fresh_args", storage::<Indirect>(stage, false)),
            ("culled", storage::<Culled>(stage, false)),
        ];
        Self {
            bricks: ComputeStage::new(device, shaders::CULL_BRICKS, "main", &bricks, &sheets),
            voxels: ComputeStage::new(device, shaders::CULL_VOXELS, "main", &voxels, &sheets),
            compact: ComputeStage::new(device, shaders::COMPACT, "main", &compact, &[]),
            prepared,
        }
    }

    /// The specs of a list's buffers, in [`CullList`]'s order, for `bricks` bricks of which a group visits at most `most_bricks`, with at most
    /// `most_voxels` voxels.
    pub fn buffer_specs(bricks: usize, (most_bricks, most_voxels): (u32, u32)) -> [BufferSpec; 8] {
        let buffer = |label, count: usize, record: usize, usage| {
            buffer_spec(label, (count.max(1) * record) as u64, BufferUsages::STORAGE | usage)
        };
        let (none, indirect) = (BufferUsages::empty(), BufferUsages::INDIRECT);
        let (most_bricks, most_voxels) = (most_bricks as usize, most_voxels as usize);
        let places = bricks * BRICK_VOXELS as usize;
        [
            buffer("sheetsplat.states", bricks, size_of::<BrickState>(), BufferUsages::COPY_DST),
            buffer("sheetsplat.splats", places, size_of::<Splat>(), BufferUsages::COPY_SRC),
            buffer("sheetsplat.instances", most_voxels, size_of::<u32>(), none),
            buffer("sheetsplat.draw_args", 1, size_of::<Indirect>(), indirect),
            buffer("sheetsplat.visits", most_bricks, size_of::<Visit>(), none),
            buffer("sheetsplat.visit_args", 1, size_of::<Indirect>(), indirect),
            buffer("sheetsplat.fresh", most_voxels, size_of::<u32>(), none),
            buffer("sheetsplat.fresh_args", 1, size_of::<Indirect>(), indirect),
        ]
    }

    /// Allocates a list's buffers, or reuses those of the `previous` frame. `order` is the list's bricks by first group; `most` is as in
    /// [`Self::buffer_specs`].
    ///
    /// # Errors
    /// If they exceed the device's maximum size of buffers.
    pub fn prepare(
        &self,
        device: &Device,
        shared: CullBuffers<'_>,
        list: &BrickBuffer,
        order: &Buffer,
        most: (u32, u32),
        previous: Option<CullList>,
    ) -> Result<CullList, RenderError> {
        let mut old = previous.map_or_else(Vec::new, CullList::buffers).into_iter();
        let buffers = Self::buffer_specs(list.brick_count(), most).map(|spec| grown(device, old.next(), &spec));
        let [states, splats, instances, draw_args, visits, visit_args, fresh, fresh_args] = buffers;
        let (states, splats, instances, draw_args) = (states?, splats?, instances?, draw_args?);
        let (visits, visit_args, fresh, fresh_args) = (visits?, visit_args?, fresh?, fresh_args?);

        let CullBuffers { frame, groups, occluded, culled, .. } = shared;
        let (frame, group) = (frame.as_entire_binding(), at_offset::<SheetGroup>(groups));
        let whole = Buffer::as_entire_binding;
        let bricks = [
            ("frames", frame.clone()),
            ("sheet_group", group.clone()),
            ("bricks", whole(&list.buffer)),
            ("order", whole(order)),
            ("states", whole(&states)),
            ("occluded", whole(occluded)),
            ("visits", whole(&visits)),
            ("args", whole(&visit_args)),
            ("culled", whole(culled)),
        ];
        let voxels = [
            ("frames", frame.clone()),
            ("sheet_group", group),
            ("bricks", whole(&list.buffer)),
            ("occluded", whole(occluded)),
            ("visits", whole(&visits)),
            ("states", whole(&states)),
            ("culled", whole(culled)),
            ("visit_args", whole(&visit_args)),
        ];
        let compact = [
            ("visits", whole(&visits)),
            ("visit_args", whole(&visit_args)),
            ("instances", whole(&instances)),
            ("draw_args", whole(&draw_args)),
            ("fresh", whole(&fresh)),
            ("fresh_args", whole(&fresh_args)),
            ("culled", whole(culled)),
        ];
        let prepared_group = match &self.prepared {
            VoxelStage::Shade(shade) => VoxelGroup::Shade(shade.bind(
                device,
                ShadeBuffers {
                    frame: shared.frame,
                    bricks: &list.buffer,
                    values: shared.values,
                    pages: shared.pages,
                    has_holes: shared.has_holes,
                    channels: shared.channels,
                    colors: shared.colors,
                    labels: shared.labels,
                    membership: shared.membership,
                    light: shared.light,
                    control_points: shared.control_points,
                    places: &fresh,
                    args: &fresh_args,
                    splats: &splats,
                },
            )),
            VoxelStage::Values(values) => {
                // Stages of planes have planes.
                let Some(planes) = shared.planes else { unreachable!() };
                let buffers = ValuesBuffers {
                    frame: shared.frame,
                    bricks: &list.buffer,
                    values: shared.values,
                    pages: shared.pages,
                    has_holes: shared.has_holes,
                    planes,
                    places: &fresh,
                    args: &fresh_args,
                    voxels: &splats,
                };
                VoxelGroup::Values(values.bind(device, buffers))
            }
        };
        let groups =
            [self.bricks.bind(device, &bricks), self.voxels.bind(device, &voxels), self.compact.bind(device, &compact)];
        let list = CullList {
            states,
            splats,
            instances,
            draw_args,
            visits,
            visit_args,
            fresh,
            fresh_args,
            groups,
            prepared_group,
        };
        Ok(list)
    }

    /// Determines what the group at `offset` draws of a list.
    pub fn record(&self, pass: &mut ComputePass<'_>, list: &CullList, offset: u32) {
        let [bricks, voxels, compact] = &list.groups;
        self.bricks.dispatch(pass, bricks, &[offset], 1);
        self.voxels.dispatch_indirect(pass, voxels, &[offset], &list.visit_args);
        self.compact.dispatch(pass, compact, &[], 1);
        match (&self.prepared, &list.prepared_group) {
            (VoxelStage::Shade(shade), VoxelGroup::Shade(group)) => shade.record(pass, group, &list.fresh_args),
            (VoxelStage::Values(values), VoxelGroup::Values(group)) => values.record(pass, group, &list.fresh_args),
            _ => {}
        }
    }
}

impl CullList {
    fn buffers(self) -> Vec<Buffer> {
        let Self { states, splats, instances, draw_args, visits, visit_args, fresh, fresh_args, .. } = self;
        vec![states, splats, instances, draw_args, visits, visit_args, fresh, fresh_args]
    }

    /// Bytes of GPU memory.
    pub fn gpu_bytes(&self) -> u64 {
        let args = [&self.draw_args, &self.visit_args, &self.fresh_args];
        let lists = [&self.states, &self.splats, &self.instances, &self.visits, &self.fresh];
        args.into_iter().chain(lists).map(Buffer::size).sum()
    }
}
