//! The voxel list on the GPU (Table 1's iso-voxel arrays), split where a binding would pass the device's limit.

use wgpu::util::DeviceExt;
use wgpu::{Buffer, BufferUsages, Device};

use super::layout::{Brick, BrickState, Splat, Visit, Voxel};

/// All voxels that take part, in lists that each fit one storage binding.
#[derive(Debug)]
pub struct VoxelLists {
    /// The lists; their order does not matter, sheets add up.
    pub lists: Vec<VoxelList>,
}

/// One list.
#[derive(Debug)]
pub struct VoxelList {
    /// Where each voxel is, for counting sections.
    pub indices: Vec<u32>,
    /// Its bricks; their voxels follow one another.
    pub bricks: Vec<Brick>,
    /// `[Voxel]`.
    pub voxel_buffer: Buffer,
    /// `[Brick]`.
    pub brick_buffer: Buffer,
}

impl VoxelLists {
    /// Uploads classified voxels, sorted by brick.
    pub fn upload(device: &Device, voxels: &[Voxel], bricks: &[Brick]) -> Self {
        let longest = max_list_length(&device.limits());
        let mut lists = Vec::new();
        let mut rest = bricks;
        while let Some(first) = rest.first().map(|brick| brick.first) {
            let (these, later) =
                rest.split_at(rest.partition_point(|brick| brick.first + brick.count - first <= longest));
            let end = these.last().map_or(first, |brick| brick.first + brick.count);
            lists.push(VoxelList::upload(device, &voxels[first as usize..end as usize], these, first));
            rest = later;
        }
        Self { lists }
    }

    /// Number of voxels in all lists.
    pub fn len(&self) -> u64 {
        self.lists.iter().map(|list| list.indices.len() as u64).sum()
    }

    /// Whether no voxel takes part.
    pub fn is_empty(&self) -> bool {
        self.lists.is_empty()
    }

    /// Bytes of GPU memory.
    pub fn gpu_bytes(&self) -> u64 {
        self.lists.iter().map(|list| list.voxel_buffer.size() + list.brick_buffer.size()).sum()
    }
}

impl VoxelList {
    fn upload(device: &Device, voxels: &[Voxel], bricks: &[Brick], first: u32) -> Self {
        let bricks: Vec<Brick> = bricks.iter().map(|brick| Brick { first: brick.first - first, ..*brick }).collect();
        let buffer = |label, contents: &[u8]| {
            let descriptor =
                wgpu::util::BufferInitDescriptor { label: Some(label), contents, usage: BufferUsages::STORAGE };
            device.create_buffer_init(&descriptor)
        };
        Self {
            indices: voxels.iter().map(|voxel| voxel.index).collect(),
            voxel_buffer: buffer("sheetsplat.voxels", bytemuck::cast_slice(voxels)),
            brick_buffer: buffer("sheetsplat.bricks", bytemuck::cast_slice(&bricks)),
            bricks,
        }
    }
}

/// Where every brick holds one voxel, a list has as many bricks as voxels: then all records of either must fit one binding.
fn max_list_length(limits: &wgpu::Limits) -> u32 {
    let bytes = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
    let records =
        [size_of::<Brick>(), size_of::<Visit>(), size_of::<BrickState>(), size_of::<Splat>(), size_of::<Voxel>()];
    let record = records.into_iter().max().unwrap_or(1);
    (bytes / record as u64).clamp(64, u64::from(u32::MAX)) as u32
}
