//! The bricks on the GPU (Table 1's iso-voxel arrays), split into lists where their records would exceed the device's limits.

use std::ops::Range;

use wgpu::{Buffer, BufferUsages, Device, Queue};

use super::bindings::uploaded;
use super::layout::{Brick, BrickState, Splat, Visit};
use crate::lists::brick::{self, BRICK_VOXELS, BrickList};

/// The bricks of all voxels that take part, in lists whose records each fit one storage binding.
#[derive(Debug)]
pub struct BrickLists {
    /// The lists. Their order does not matter, because sheets add up.
    pub lists: Vec<BrickBuffer>,
    /// The bricks of all lists.
    bricks: BrickList,
    state: State,
}

/// Whether the buffers are up to date.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Current,
    /// Bricks have changed or were added.
    Changed,
    /// More bricks were added than the buffers have room for.
    Full,
}

/// One list's bricks on the GPU.
#[derive(Debug)]
pub struct BrickBuffer {
    /// The indices of the bricks in [`BrickLists::bricks`].
    range: Range<usize>,
    /// `[Brick]`, with room for more.
    pub buffer: Buffer,
}

impl BrickLists {
    /// Lists bricks, which the next [`Self::flush`] uploads.
    pub fn new(bricks: BrickList) -> Self {
        Self { lists: Vec::new(), bricks, state: State::Full }
    }

    /// Uploads bricks.
    pub fn upload(device: &Device, bricks: BrickList) -> Self {
        let (ranges, capacity) = split(&device.limits(), bricks.bricks().len());
        let lists = ranges.map(|range| BrickBuffer::upload(device, range, capacity, &bricks)).collect();
        Self { lists, bricks, state: State::Current }
    }

    /// The lists that [`Self::upload`] would make of these bricks.
    pub fn settled(&self, limits: &wgpu::Limits) -> SettledBricks {
        SettledBricks::of(limits, self.bricks.compacted())
    }

    /// The bricks of every list.
    pub fn bricks(&self) -> impl Iterator<Item = &[Brick]> {
        self.lists.iter().map(|list| &self.bricks.bricks()[list.range.clone()])
    }

    /// The bricks of all lists together.
    pub fn all(&self) -> &[Brick] {
        self.bricks.bricks()
    }

    /// The voxels that are in a list.
    pub fn list(&self) -> &BrickList {
        &self.bricks
    }

    /// Adds and removes voxels; nothing is uploaded before [`Self::flush`].
    pub fn change(&mut self, entering: &[u32], leaving: &[u32]) {
        self.bricks.change(entering, leaving);
        let count = self.bricks.bricks().len();
        self.state = match &mut self.lists[..] {
            [list] if self.state != State::Full && count <= list.capacity() => {
                list.range.end = count;
                State::Changed
            }
            _ => State::Full,
        };
    }

    /// Takes other bricks instead; the next [`Self::flush`] uploads them all.
    pub fn replace(&mut self, bricks: BrickList) {
        self.bricks = bricks;
        self.lists.truncate(1);
        self.lists.iter_mut().for_each(|list| list.range = 0..self.bricks.bricks().len());
        self.state = State::Full;
    }

    /// Whether there is room for the added bricks; otherwise all will be uploaded again.
    pub fn has_room(&self) -> bool {
        self.state != State::Full
    }

    /// Makes the next [`Self::flush`] upload everything again, because the buffers may have been lost.
    pub fn forget(&mut self) {
        self.state = State::Full;
    }

    /// Uploads what has changed.
    pub fn flush(&mut self, device: &Device, queue: &Queue) {
        match self.state {
            State::Current => {}
            State::Changed => {
                for list in &self.lists {
                    let bricks = &self.bricks.bricks()[list.range.clone()];
                    queue.write_buffer(&list.buffer, 0, bytemuck::cast_slice(bricks));
                }
            }
            State::Full => *self = Self::upload(device, self.bricks.compacted()),
        }
        self.state = State::Current;
    }

    /// The number of voxels in all lists.
    pub fn len(&self) -> u64 {
        self.bricks.bricks().iter().map(|brick| u64::from(brick::present(brick).count_ones())).sum()
    }

    /// Whether no voxel takes part.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The size of the buffers in bytes.
    pub fn gpu_bytes(&self) -> u64 {
        self.lists.iter().map(|list| list.buffer.size()).sum()
    }
}

/// Bricks divided into lists, before they are uploaded.
#[derive(Debug)]
pub struct SettledBricks {
    bricks: BrickList,
    ranges: Vec<Range<usize>>,
    capacity: usize,
}

impl SettledBricks {
    /// The lists that some bricks are divided among.
    pub fn of(limits: &wgpu::Limits, bricks: BrickList) -> Self {
        let (ranges, capacity) = split(limits, bricks.bricks().len());
        Self { ranges: ranges.collect(), capacity, bricks }
    }

    /// The bricks of every list.
    pub fn lists(&self) -> Vec<&[Brick]> {
        self.ranges.iter().map(|range| &self.bricks.bricks()[range.clone()]).collect()
    }

    /// The bricks of all lists together.
    pub fn all(&self) -> &[Brick] {
        self.bricks.bricks()
    }

    /// The size of the buffers in bytes.
    pub fn gpu_bytes(&self) -> u64 {
        (self.ranges.len() * self.capacity * size_of::<Brick>()) as u64
    }
}

impl BrickBuffer {
    fn upload(device: &Device, range: Range<usize>, capacity: usize, bricks: &BrickList) -> Self {
        let bytes = bytemuck::cast_slice(&bricks.bricks()[range.clone()]);
        let size = (capacity * size_of::<Brick>()) as u64;
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST;
        let buffer = uploaded(device, "sheetsplat.bricks", bytes, size, usage);
        Self { range, buffer }
    }

    /// The number of bricks that the buffer has room for.
    fn capacity(&self) -> usize {
        self.buffer.size() as usize / size_of::<Brick>()
    }

    /// The number of its bricks.
    pub fn brick_count(&self) -> usize {
        self.range.len()
    }
}

/// The maximum size of a list's binding, even if the device allows more: WebGPU's default. The boundaries of lists determine the order in
/// which a sheet's footprints are added, and so the last bit of their sum, which is thus the same on all devices with at least the
/// default.
const MOST_BYTES: u64 = 128 << 20;

/// The lists of `count` bricks, and the capacity of each, which leaves room for more bricks.
fn split(limits: &wgpu::Limits, count: usize) -> (impl Iterator<Item = Range<usize>> + use<>, usize) {
    let capacity = max_list_length(limits).min(count + count / 8 + 16);
    ((0..count).step_by(capacity).map(move |first| first..count.min(first + capacity)), capacity)
}

/// The maximum number of bricks in a list, such that every record of its bricks and slots fits one binding.
fn max_list_length(limits: &wgpu::Limits) -> usize {
    let bytes = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size).min(MOST_BYTES);
    let records =
        [size_of::<Brick>(), size_of::<Visit>(), size_of::<BrickState>(), size_of::<Splat>() * BRICK_VOXELS as usize];
    let record = records.into_iter().max().unwrap_or(1);
    // Places are counted in 32 bits.
    (bytes / record as u64).clamp(1, u64::from(u32::MAX / BRICK_VOXELS)) as usize
}
