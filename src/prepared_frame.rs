//! A prepared frame: the buffers that recording needs, and what of them the next frame can take over.

use wgpu::util::DeviceExt;
use wgpu::{BindGroup, Buffer, BufferUsages, Device, TextureView};

use crate::brick;
use crate::classified_volume::ClassifiedVolume;
use crate::gpu::footprint_texture::FootprintTexture;
use crate::gpu::targets::Targets;
use crate::gpu::timer::Timer;
use crate::kernel::Kernel;
use crate::pass::cull::CullList;
use crate::pass::tiles::TileLists;
use crate::plan::{FramePlan, View};
use crate::splatting::Order;
use crate::stats::Totals;

/// A frame whose buffers are all allocated and filled: recording it cannot fail.
#[derive(Debug)]
pub(crate) struct PreparedFrame {
    pub(crate) planned: Planned,
    pub(crate) targets: Targets,
    /// And the kernel and slab width they are for.
    pub(crate) footprints: (FootprintTexture, (Kernel, Option<f64>)),
    pub(crate) uniform: Buffer,
    pub(crate) groups: Buffer,
    pub(crate) group_stride: u32,
    pub(crate) control_points: Buffer,
    pub(crate) tally: Buffer,
    pub(crate) tile_lists: TileLists,
    pub(crate) lists: Vec<PreparedList>,
    pub(crate) timer: Option<Timer>,
    pub(crate) sheet_views: Vec<TextureView>,
    pub(crate) clear_group: BindGroup,
    pub(crate) composite_groups: Vec<BindGroup>,
    pub(crate) occlude_groups: [BindGroup; 2],
    pub(crate) resolve_groups: Vec<BindGroup>,
    pub(crate) gpu_bytes: u64,
    /// Where a recorded frame leaves its counts; gone when somebody waits for them.
    pub(crate) staging: Option<Staging>,
}

/// What only changes with the view, or with the bricks: the buckets.
#[derive(Debug)]
pub(crate) struct Planned {
    pub(crate) plan: FramePlan,
    pub(crate) totals: Option<Totals>,
    pub(crate) order: Order,
    /// [`ClassifiedVolume::revision`].
    pub(crate) revision: u64,
    /// For every list its bricks in bucket order, `[u32]`.
    pub(crate) orders: Vec<Buffer>,
    /// For every list the most bricks and voxels that any group can visit.
    pub(crate) most: Vec<(u32, u32)>,
}

/// A frame's counts: a [`Tally`](crate::gpu::layout::Tally), for every group the tiles it composited, `[u32]`, and timestamps from `timestamps` on.
#[derive(Debug)]
pub(crate) struct Staging {
    pub(crate) buffer: Buffer,
    pub(crate) timestamps: u64,
    /// The stage of every pass that was timed.
    pub(crate) stages: Vec<&'static str>,
    /// Nanoseconds of a timestamp's tick.
    pub(crate) period: f32,
}

#[derive(Debug)]
pub(crate) struct PreparedList {
    pub(crate) cull: CullList,
    pub(crate) splat_group: BindGroup,
}

impl PreparedFrame {
    /// Bytes of GPU memory that the frame and its volume hold.
    pub(crate) fn gpu_bytes(&self) -> u64 {
        self.gpu_bytes
    }
}

impl Planned {
    pub(crate) fn new(device: &Device, volume: &ClassifiedVolume, view: View, sheets: u32, order: Order) -> Self {
        let plan = FramePlan::new(volume.lists.bricks(), view, sheets, order);
        let most = (volume.lists.bricks().zip(&plan.orders).enumerate())
            .map(|(at, (bricks, order))| {
                let voxels = |&brick: &u32| brick::present(&bricks[brick as usize]).count_ones();
                most(plan.groups.iter().map(|group| {
                    let bricks = group.bricks[at].clone();
                    order[bricks.start as usize..bricks.end as usize].iter().map(voxels)
                }))
            })
            .collect();
        let upload = |order: &Vec<u32>| {
            device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
                label: Some("sheetsplat.order"),
                contents: bytemuck::cast_slice(order),
                usage: BufferUsages::STORAGE,
            })
        };
        Self {
            order,
            revision: volume.revision,
            orders: plan.orders.iter().map(upload).collect(),
            most,
            plan,
            totals: None,
        }
    }
}

/// What a new frame can take from the one before it.
#[derive(Default)]
pub(crate) struct Previous {
    pub(crate) planned: Option<Planned>,
    pub(crate) targets: Option<Targets>,
    pub(crate) footprints: Option<(FootprintTexture, (Kernel, Option<f64>))>,
    pub(crate) uniform: Option<Buffer>,
    pub(crate) groups: Option<Buffer>,
    pub(crate) control_points: Option<Buffer>,
    pub(crate) tally: Option<Buffer>,
    pub(crate) tile_lists: Option<TileLists>,
    pub(crate) lists: Vec<PreparedList>,
}

impl Previous {
    pub(crate) fn of(frame: Option<PreparedFrame>) -> Self {
        let Some(frame) = frame else { return Self::default() };
        Self {
            planned: Some(frame.planned),
            targets: Some(frame.targets),
            footprints: Some(frame.footprints),
            uniform: Some(frame.uniform),
            groups: Some(frame.groups),
            control_points: Some(frame.control_points),
            tally: Some(frame.tally),
            tile_lists: Some(frame.tile_lists),
            lists: frame.lists,
        }
    }
}

/// The most bricks and voxels that any group can visit, from the voxel counts of every group's bricks.
fn most<C: ExactSizeIterator<Item = u32>>(groups: impl Iterator<Item = C>) -> (u32, u32) {
    groups.fold((0, 0), |(bricks, voxels), counts| (bricks.max(counts.len() as u32), voxels.max(counts.sum())))
}
