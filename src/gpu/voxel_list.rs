//! The voxel list on the GPU (Table 1's iso-voxel arrays), split where a binding would pass the device's limit.

use wgpu::util::DeviceExt;
use wgpu::{Buffer, BufferDescriptor, BufferUsages, Device, Queue};

use super::layout::{Brick, BrickState, Entry, Splat, Visit, Voxel};
use crate::brick::{self, BRICK_VOXELS, BrickList};
use crate::volume::Grid;

/// All voxels that take part, in lists that each fit one storage binding.
#[derive(Debug)]
pub struct VoxelLists {
    /// The lists; their order does not matter, sheets add up.
    pub lists: Vec<VoxelList>,
    /// The bricks of all lists.
    bricks: BrickList,
    /// Voxels that entered since the upload and are not on the GPU yet.
    entering: Vec<Entry>,
    /// Bricks that a list has room for.
    capacity: usize,
    changed: bool,
}

/// One list.
#[derive(Debug)]
pub struct VoxelList {
    /// The list's bricks in [`VoxelLists::bricks`].
    range: std::ops::Range<usize>,
    /// `[Voxel]`, [`BRICK_VOXELS`] for every brick; places without a voxel hold anything.
    pub voxel_buffer: Buffer,
    /// `[Brick]`.
    pub brick_buffer: Buffer,
}

impl VoxelLists {
    /// Uploads classified voxels.
    pub fn upload(device: &Device, grid: &Grid, voxels: &[Voxel]) -> Self {
        let bricks = BrickList::new(grid, voxels.iter().map(|voxel| voxel.index));
        let longest = max_list_length(&device.limits());
        let count = bricks.bricks().len();
        // Room for voxels that enter later.
        let capacity = longest.min(count + count / 8 + 16);
        let mut slots = vec![bytemuck::Zeroable::zeroed(); count * BRICK_VOXELS as usize];
        for voxel in voxels {
            if let Some(place) = bricks.place(voxel.index) {
                slots[place as usize] = *voxel;
            }
        }
        let lists = (0..count)
            .step_by(capacity)
            .map(|first| VoxelList::upload(device, first..count.min(first + capacity), capacity, &bricks, &slots))
            .collect();
        Self { lists, bricks, entering: Vec::new(), capacity, changed: false }
    }

    /// Bricks of every list.
    pub fn bricks(&self) -> impl Iterator<Item = &[Brick]> {
        self.lists.iter().map(|list| &self.bricks.bricks()[list.range.clone()])
    }

    /// Whether a voxel is in a list.
    pub fn contains(&self, voxel: u32) -> bool {
        self.bricks.contains(voxel)
    }

    /// Lets voxels enter and leave; nothing reaches the GPU before [`Self::flush`]. `false` where they do not fit one list: then
    /// all must be uploaded again before that.
    pub fn change(&mut self, entering: &[Voxel], leaving: &[u32]) -> bool {
        for voxel in entering {
            let at = self.bricks.enter(voxel.index);
            self.entering.push(Entry { at, voxel: *voxel });
        }
        leaving.iter().for_each(|&voxel| self.bricks.leave(voxel));
        let [list] = &mut self.lists[..] else { return false };
        list.range.end = self.bricks.bricks().len();
        self.changed = true;
        list.range.end <= self.capacity && self.entering.len() <= self.capacity * BRICK_VOXELS as usize
    }

    /// Brings the bricks on the GPU up to date. The voxels that entered are returned, for the `enter` stage.
    pub fn flush(&mut self, device: &Device, queue: &Queue) -> Option<Buffer> {
        if std::mem::take(&mut self.changed) {
            for list in &self.lists {
                let bricks = &self.bricks.bricks()[list.range.clone()];
                queue.write_buffer(&list.brick_buffer, 0, bytemuck::cast_slice(bricks));
            }
        }
        let entering = std::mem::take(&mut self.entering);
        (!entering.is_empty()).then(|| {
            device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
                label: Some("sheetsplat.entering"),
                contents: bytemuck::cast_slice(&entering),
                usage: BufferUsages::STORAGE,
            })
        })
    }

    /// Number of voxels in all lists.
    pub fn len(&self) -> u64 {
        self.bricks.bricks().iter().map(|brick| u64::from(brick::present(brick).count_ones())).sum()
    }

    /// Whether no voxel takes part.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Bytes of GPU memory.
    pub fn gpu_bytes(&self) -> u64 {
        self.lists.iter().map(|list| list.voxel_buffer.size() + list.brick_buffer.size()).sum()
    }
}

impl VoxelList {
    fn upload(
        device: &Device,
        range: std::ops::Range<usize>,
        capacity: usize,
        bricks: &BrickList,
        voxels: &[Voxel],
    ) -> Self {
        let places = range.start * BRICK_VOXELS as usize..range.end * BRICK_VOXELS as usize;
        Self {
            voxel_buffer: filled(device, "sheetsplat.voxels", &voxels[places], capacity * BRICK_VOXELS as usize),
            brick_buffer: filled(device, "sheetsplat.bricks", &bricks.bricks()[range.clone()], capacity),
            range,
        }
    }

    /// Its places for voxels.
    pub fn places(&self) -> usize {
        self.range.len() * BRICK_VOXELS as usize
    }

    /// Number of its bricks.
    pub fn brick_count(&self) -> usize {
        self.range.len()
    }
}

/// A buffer with room for `capacity` records, the first of them given.
fn filled<T: bytemuck::Pod>(device: &Device, label: &str, records: &[T], capacity: usize) -> Buffer {
    let buffer = device.create_buffer(&BufferDescriptor {
        label: Some(label),
        size: (capacity * size_of::<T>()) as u64,
        usage: BufferUsages::STORAGE | BufferUsages::COPY_DST,
        mapped_at_creation: true,
    });
    let bytes: &[u8] = bytemuck::cast_slice(records);
    if let Ok(mut mapped) = buffer.get_mapped_range_mut(..bytes.len() as u64) {
        mapped.copy_from_slice(bytes);
    }
    buffer.unmap();
    buffer
}

/// The most bricks of a list: all records of its bricks, and of their places for voxels, must fit one binding.
fn max_list_length(limits: &wgpu::Limits) -> usize {
    let bytes = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
    let records = [
        size_of::<Brick>(),
        size_of::<Visit>(),
        size_of::<BrickState>(),
        size_of::<Splat>() * BRICK_VOXELS as usize,
        size_of::<Voxel>() * BRICK_VOXELS as usize,
    ];
    let record = records.into_iter().max().unwrap_or(1);
    // Places are counted in 32 bits.
    (bytes / record as u64).clamp(1, u64::from(u32::MAX / BRICK_VOXELS)) as usize
}
