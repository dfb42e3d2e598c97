//! Pages of a volume that is read while it is drawn: cubes of its voxels in slots of textures, in which they stay as long as there is room. A box of the volume is drawn from
//! the pages in it that bear on its image, wherever they are, by the slots that `shaders/shared/texels.wgsl` looks up.

use std::collections::HashMap;
use std::ops::Range;

use glam::UVec3;
use wgpu::{Device, Extent3d, Origin3d, Queue, Texture, TextureFormat};

use crate::after::normalization::Normalization;
use crate::error::RenderError;
use crate::gpu::fault::scoped;
use crate::gpu::gpu_volume::Paged;
use crate::gpu::volume_texture::{ValueFormat, VolumeTexture};
use crate::lists::brick::BrickList;
use crate::volume::{HollowChannel, Texel, ValueSlice, Volume};

/// The number of colours that stands for 1.
const FULL_COLOR: u32 = u16::MAX as u32;

/// The pages that are written before the queue gives back its copies of them.
const SENT: u32 = 256;

/// The bytes that slots take at least, with which a few pixels can be drawn.
const LEAST_BYTES: u64 = 1 << 16;

/// A page of a channel: the channel's number among those that are drawn, and the page's place along each axis.
pub(super) type ChannelPage = (usize, UVec3);

/// What the voxels of a page are, x fastest; beyond the volume's end they are any.
#[derive(Clone, Debug)]
pub(super) struct PageTexels {
    /// In the pool's format.
    values: Vec<u8>,
    labels: Vec<u16>,
    colors: Vec<Texel>,
}

/// A page in a slot, and when it was last needed.
#[derive(Clone, Copy, Debug)]
struct Held {
    slot: u32,
    used: u64,
}

/// Textures of slots. The first slot stands for all pages that are not needed: where values are stored by their bits, it is a page of holes.
#[derive(Debug)]
pub(super) struct PagePool {
    device: Device,
    queue: Queue,
    /// The bits of a voxel's place in its page along each axis.
    bits: u32,
    channels: Vec<HollowChannel>,
    /// How values are stored.
    format: ValueFormat,
    /// The bytes that slots may take, and the number of pages that there are.
    room: (u64, u64),
    values: (Texture, VolumeTexture),
    labels: Option<(Texture, VolumeTexture)>,
    colors: Option<(Texture, VolumeTexture)>,
    held: HashMap<ChannelPage, Held>,
    free: Vec<u32>,
    /// The number of slots without the first.
    capacity: usize,
    /// Counts what is drawn.
    clock: u64,
    /// The pages written since the queue gave back copies.
    sent: u32,
}

impl PagePool {
    /// Slots for pages of these channels, whose values are stored in a format, in some bytes, but no more than for so many pages, and no more than the device has
    /// memory for.
    ///
    /// # Errors
    /// If the device has not even room for a few pages, or fails.
    pub(super) fn new(
        (device, queue): (&Device, &Queue),
        bits: u32,
        (channels, format): (Vec<HollowChannel>, ValueFormat),
        room: (u64, u64),
    ) -> Result<Self, RenderError> {
        let (slots, [values, labels, colors]) = textures(device, bits, (&channels, format), room, 1)?;
        let Some(values) = values else { unreachable!() };
        let mut pool = Self {
            device: device.clone(),
            queue: queue.clone(),
            bits,
            channels,
            format,
            room,
            values,
            labels,
            colors,
            held: HashMap::new(),
            free: Vec::new(),
            capacity: 0,
            clock: 0,
            sent: 0,
        };
        pool.empty(slots);
        Ok(pool)
    }

    /// Drops all pages, and stores values by their bits from now on, in at least so many slots.
    ///
    /// # Errors
    /// As for [`Self::new`].
    pub(super) fn widen(&mut self, least: usize) -> Result<(), RenderError> {
        let old = [Some(&self.values), self.labels.as_ref(), self.colors.as_ref()];
        old.into_iter().flatten().for_each(|(texture, _)| texture.destroy());
        let of = (&self.channels[..], ValueFormat::Bits);
        let (slots, [values, labels, colors]) = textures(&self.device, self.bits, of, self.room, least as u64 + 1)?;
        let Some(values) = values else { unreachable!() };
        (self.values, self.labels, self.colors, self.format) = (values, labels, colors, ValueFormat::Bits);
        self.held.clear();
        self.empty(slots);
        Ok(())
    }

    /// Begins with so many empty slots.
    fn empty(&mut self, slots: u32) {
        self.free = (1..slots).rev().collect();
        self.capacity = slots as usize - 1;
        let channel = HollowChannel { labels: self.labels.is_some(), colors: self.colors.is_some(), holes: false };
        if let Some(none) = PageTexels::of(ValueSlice::F32(&[]), &[], self.bits, self.format) {
            self.write(0, &none.with_parts(channel, self.bits));
        }
    }

    /// How values are stored.
    pub(super) fn format(&self) -> ValueFormat {
        self.format
    }

    /// The most pages that can be held at a time.
    pub(super) fn capacity(&self) -> usize {
        self.capacity
    }

    /// The bytes of all slots.
    pub(super) fn bytes(&self) -> u64 {
        [Some(&self.values), self.labels.as_ref(), self.colors.as_ref()]
            .into_iter()
            .flatten()
            .map(|it| it.1.gpu_bytes)
            .sum()
    }

    pub(super) fn device(&self) -> &Device {
        &self.device
    }

    /// What a channel has.
    pub(super) fn channel(&self, number: usize) -> HollowChannel {
        self.channels[number]
    }

    /// Begins to draw from some pages, which stay until the next call, and tells which of them are not held.
    pub(super) fn need(&mut self, pages: &[ChannelPage]) -> Vec<ChannelPage> {
        self.clock += 1;
        let mut missing = Vec::new();
        for page in pages {
            match self.held.get_mut(page) {
                Some(held) => held.used = self.clock,
                None => missing.push(*page),
            }
        }
        missing
    }

    /// Takes a page up, if it is not held already, in place of those that were not needed for the longest time; does nothing if all are needed.
    pub(super) fn put(&mut self, page: ChannelPage, texels: &PageTexels) {
        if self.held.contains_key(&page) {
            return;
        }
        if self.free.is_empty() {
            self.drop_oldest();
        }
        let Some(slot) = self.free.pop() else { return };
        self.write(slot, texels);
        self.held.insert(page, Held { slot, used: self.clock });
    }

    /// Frees a quarter of the slots whose pages are not needed.
    fn drop_oldest(&mut self) {
        let old = self.held.iter().filter(|(_, held)| held.used < self.clock);
        let mut old: Vec<(u64, u32, ChannelPage)> = old.map(|(&page, held)| (held.used, held.slot, page)).collect();
        old.sort_unstable_by_key(|&(used, slot, _)| (used, slot));
        for &(_, slot, page) in &old[..old.len().div_ceil(4)] {
            self.held.remove(&page);
            self.free.push(slot);
        }
    }

    fn write(&mut self, slot: u32, texels: &PageTexels) {
        fill_slot(&self.queue, &self.values.0, (slot, self.bits), &texels.values);
        if let Some((labels, _)) = &self.labels {
            fill_slot(&self.queue, labels, (slot, self.bits), &texels.labels);
        }
        if let Some((colors, _)) = &self.colors {
            fill_slot(&self.queue, colors, (slot, self.bits), &texels.colors);
        }
        self.sent += 1;
        if self.sent == SENT {
            self.queue.submit([]);
            self.sent = 0;
        }
    }

    /// A box of pages, given by its first one and the number of them along each axis, as it is drawn from those that are needed of it.
    ///
    /// # Errors
    /// If the device has no room for the slots' numbers, or fails.
    pub(super) fn paged(
        &self,
        (low, across): (UVec3, UVec3),
        needed: &[ChannelPage],
        (numbers, lists): (Vec<Normalization>, Vec<BrickList>),
    ) -> Result<Paged, RenderError> {
        let count = across.element_product() as usize;
        let mut slots = vec![0; count * self.channels.len()];
        for page @ &(channel, at) in needed {
            let at = at - low;
            let place = at.x + across.x * (at.y + across.y * at.z);
            slots[channel * count + place as usize] = self.held.get(page).map_or(0, |held| held.slot);
        }
        let own = |has: fn(&HollowChannel) -> bool| {
            let channels = self.channels.iter().zip(slots.chunks_exact(count)).filter(move |(channel, _)| has(channel));
            channels.flat_map(|(_, slots)| slots).copied()
        };
        let all: Vec<u32> =
            slots.iter().copied().chain(own(|channel| channel.labels)).chain(own(|channel| channel.colors)).collect();
        let upload =
            || VolumeTexture::upload_words(&self.device, &self.queue, ("sheetsplat.pages", "the slots of pages"), &all);
        Ok(Paged {
            slots: scoped(&self.device, upload)??,
            bits: self.bits,
            values: self.values.1.clone(),
            labels: self.labels.as_ref().map(|(_, labels)| labels.clone()),
            colors: self.colors.as_ref().map(|(_, colors)| (colors.clone(), FULL_COLOR)),
            numbers,
            lists,
        })
    }
}

/// The number of slots, and the textures of values, labels and colours, in at most so many bytes and for at most so many pages, but for at least so many slots.
#[expect(clippy::type_complexity, reason = "one caller takes it apart")]
fn textures(
    device: &Device,
    bits: u32,
    (channels, format): (&[HollowChannel], ValueFormat),
    (bytes, pages): (u64, u64),
    least: u64,
) -> Result<(u32, [Option<(Texture, VolumeTexture)>; 3]), RenderError> {
    let formats = [
        Some((format, format.texture())),
        channels.iter().any(|channel| channel.labels).then_some((ValueFormat::Bits, TextureFormat::R16Uint)),
        channels.iter().any(|channel| channel.colors).then_some((ValueFormat::Bits, TextureFormat::Rgba16Uint)),
    ];
    let texel = |(_, texels): &(ValueFormat, TextureFormat)| u64::from(texels.block_copy_size(None).unwrap_or(0));
    let voxel: u64 = formats.iter().flatten().map(texel).sum();
    let least = least.max(LEAST_BYTES / (voxel << (3 * bits)));
    let mut slots = (bytes / (voxel << (3 * bits))).min(pages.saturating_add(1)).max(least);
    loop {
        let make = |of: Option<(ValueFormat, TextureFormat)>| {
            of.map(|of| VolumeTexture::with_room(device, "sheetsplat.pages_of_voxels", of, slots << (3 * bits)))
                .transpose()
        };
        let [values, labels, colors] = formats;
        let make = || Ok([make(values)?, make(labels)?, make(colors)?]);
        match scoped(device, make).map_err(RenderError::from).flatten() {
            Err(_) if slots > least => slots = (slots / 2).max(least),
            made => return Ok((slots as u32, made?)),
        }
    }
}

impl PageTexels {
    /// The page that begins at a voxel of a box, in a format; `None` if that cannot store a value.
    pub(super) fn cut_out(volume: &Volume, from: UVec3, bits: u32, format: ValueFormat) -> Option<Self> {
        let (side, grid) = (1 << bits, volume.grid());
        let dims = (grid.dims - from).min(UVec3::splat(side));
        let rows = (0..dims.y * dims.z).map(|row| {
            let at = UVec3::new(0, row % dims.y, row / dims.y);
            let (first, to) = (grid.index_of(from + at) as usize, ((at.z * side + at.y) * side) as usize);
            (first..first + dims.x as usize, to)
        });
        let rows: Vec<(Range<usize>, usize)> = rows.collect();
        let channel =
            HollowChannel { labels: volume.labels().is_some(), colors: volume.colors().is_some(), holes: false };
        let mut page = Self::of(volume.values(), &rows, bits, format)?.with_parts(channel, bits);
        for (range, to) in rows {
            let to = to..to + range.len();
            if let Some(labels) = volume.labels() {
                page.labels[to.clone()].copy_from_slice(&labels[range.clone()]);
            }
            if let Some(colors) = volume.colors() {
                page.colors[to].copy_from_slice(&colors[range]);
            }
        }
        Some(page)
    }

    /// Some rows of values, each with the place of the first one in the page; `None` if the format cannot store one of them.
    fn of(values: ValueSlice<'_>, rows: &[(Range<usize>, usize)], bits: u32, format: ValueFormat) -> Option<Self> {
        fn rows_of<T: bytemuck::NoUninit>(
            values: ValueSlice<'_>,
            rows: &[(Range<usize>, usize)],
            mut page: Vec<T>,
            texel: impl Fn(f32) -> Option<T>,
        ) -> Option<Vec<u8>> {
            for (range, to) in rows {
                for (to, value) in page[*to..].iter_mut().zip(values.slice(range.clone()).iter()) {
                    *to = texel(value)?;
                }
            }
            Some(bytemuck::cast_slice(&page).to_vec())
        }
        let count = 1 << (3 * bits);
        let values = match format {
            ValueFormat::Offset8(least) => rows_of(values, rows, vec![0_u8; count], |value| {
                let texel = (value - least) as u8;
                (f32::from(texel) == value - least).then_some(texel)
            }),
            ValueFormat::Offset16(least) => rows_of(values, rows, vec![0_u16; count], |value| {
                let texel = (value - least) as u16;
                (f32::from(texel) == value - least).then_some(texel)
            }),
            ValueFormat::Bits => rows_of(values, rows, vec![f32::NAN.to_bits(); count], |value| Some(value.to_bits())),
        };
        Some(Self { values: values?, labels: Vec::new(), colors: Vec::new() })
    }

    /// With the parts that a channel has, of nothing.
    fn with_parts(self, channel: HollowChannel, bits: u32) -> Self {
        let of = |has: bool| if has { 1 << (3 * bits) } else { 0 };
        Self { labels: vec![0; of(channel.labels)], colors: vec![Texel::default(); of(channel.colors)], ..self }
    }
}

/// Writes the texels of a slot, if a channel has any.
fn fill_slot<T: bytemuck::NoUninit>(queue: &Queue, texture: &Texture, (slot, bits): (u32, u32), texels: &[T]) {
    if texels.is_empty() {
        return;
    }
    let (side, count) = (u64::from(texture.width()), 1_u64 << (3 * bits));
    let (row, width) = (u64::from(slot) * count / side, side.min(count) as u32);
    let origin =
        Origin3d { x: (u64::from(slot) * count % side) as u32, y: (row % side) as u32, z: (row / side) as u32 };
    let texel = texture.format().block_copy_size(None).unwrap_or(0);
    queue.write_texture(
        wgpu::TexelCopyTextureInfo { origin, ..texture.as_image_copy() },
        bytemuck::cast_slice(texels),
        wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(width * texel), rows_per_image: None },
        Extent3d { width, height: count as u32 / width, depth_or_array_layers: 1 },
    );
}
