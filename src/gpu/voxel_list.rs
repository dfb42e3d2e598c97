//! The voxel list on the GPU (Table 1's iso-voxel arrays), split where a binding would pass the device's limit.

use wgpu::util::DeviceExt;
use wgpu::{Buffer, BufferUsages, Device};

use super::layout::{Splat, Voxel};

/// All voxels that take part, in lists that each fit one storage binding.
#[derive(Debug)]
pub struct VoxelLists {
    /// The lists; their order does not matter, sheets add up.
    pub lists: Vec<VoxelList>,
}

/// One list.
#[derive(Debug)]
pub struct VoxelList {
    /// Where each voxel is, for bucketing.
    pub indices: Vec<u32>,
    /// `[Voxel]`, in the order of `indices`.
    pub voxels: Buffer,
}

impl VoxelLists {
    /// Uploads classified voxels.
    pub fn upload(device: &Device, voxels: &[Voxel]) -> Self {
        let lists = voxels
            .chunks(max_list_length(&device.limits()))
            .map(|voxels| VoxelList {
                indices: voxels.iter().map(|voxel| voxel.index).collect(),
                voxels: device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
                    label: Some("sheetsplat.voxels"),
                    contents: bytemuck::cast_slice(voxels),
                    usage: BufferUsages::STORAGE,
                }),
            })
            .collect();
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
        self.lists.iter().map(|list| list.voxels.size()).sum()
    }
}

/// The splats of a list are its largest buffer: they must fit one binding, one buffer, and one dispatch.
fn max_list_length(limits: &wgpu::Limits) -> usize {
    let bytes = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
    let dispatch = u64::from(limits.max_compute_workgroups_per_dimension).pow(2) * 256;
    (bytes / size_of::<Splat>() as u64).min(dispatch).max(1) as usize
}
