//! The volume's values, labels and colours on the GPU, as texture arrays, whose size is not limited by one binding. Layers have 2048 texels a side, or
//! 4096 or 8192 if a volume would need more layers than the device has; with WebGPU's default limits 2048 suffice.

use std::ops::Range;

use wgpu::{
    Device, Extent3d, Limits, Queue, TextureDescriptor, TextureDimension, TextureFormat, TextureUsages, TextureView,
};

use crate::error::RenderError;
use crate::parallel::prelude::*;
use crate::volume::{Texel, ValueSlice};

/// The smallest of [`SIDES`].
pub const LEAST_SIDE: u32 = 2048;

/// The possible sides of a layer in texels.
pub const SIDES: [u32; 3] = [LEAST_SIDE, 4096, 8192];

/// How values are stored: in as few bits as reproduce each of them exactly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ValueFormat {
    /// `R8Uint`: a whole number minus the volume's minimum, which this is.
    Offset8(f32),
    /// `R16Uint`: the same with 16 bits.
    Offset16(f32),
    /// `R32Uint`: the bits of the `f32`; NaN for a hole.
    Bits,
}

impl ValueFormat {
    /// The format with the fewest bits for these values. Examines all of them.
    pub fn of(values: ValueSlice<'_>) -> Self {
        // Up to this limit `f32` represents every whole number, so neither the difference nor the sum is rounded.
        let range = values.whole_range().filter(|ends| ends.iter().all(|end| end.unsigned_abs() <= 1 << 24));
        match range.map(|[least, greatest]| (least as f32, greatest - least)) {
            Some((least, 0..=0xff)) => Self::Offset8(least),
            Some((least, 0x100..=0xffff)) => Self::Offset16(least),
            _ => Self::Bits,
        }
    }

    /// The format of texels.
    pub(crate) fn texture(self) -> TextureFormat {
        match self {
            Self::Offset8(_) => TextureFormat::R8Uint,
            Self::Offset16(_) => TextureFormat::R16Uint,
            Self::Bits => TextureFormat::R32Uint,
        }
    }
}

/// Colours of voxels' own on the GPU (SPEC §10).
#[derive(Clone, Copy, Debug)]
pub struct OwnColors<'a> {
    /// Red, green, blue and A.
    pub view: &'a TextureView,
    /// The number that stands for 1.
    pub full: u32,
}

/// The slots of pages, where voxels are in pages (`headless::boxed::page_pool`).
#[derive(Clone, Copy, Debug)]
pub struct Pages<'a> {
    /// `R32Uint`, a slot for every page, folded as voxels are: the pages of each channel's values, x fastest, then those of labels, then those of colours.
    pub view: &'a TextureView,
    /// The bits of a voxel's place in its page along each axis.
    pub bits: u32,
}

/// The bits of a voxel's place in its page along each axis; 0 where voxels are not in pages.
pub fn page_bits(pages: Option<Pages<'_>>) -> u32 {
    pages.map_or(0, |pages| pages.bits)
}

/// The format of four numbers for each voxel.
const COLOR_BITS: TextureFormat = TextureFormat::Rgba32Uint;

/// The format of labels, whose texels are the labels themselves.
const LABELS: ValueFormat = ValueFormat::Offset16(0.0);

/// One number per voxel, x fastest, folded into square layers whose side is a power of two: voxel i is texel i mod side of row ⌊i/side⌋.
/// `shaders/shared/volume.wgsl` unfolds it.
#[derive(Clone, Debug)]
pub struct VolumeTexture {
    /// All layers.
    pub view: TextureView,
    /// The format of its texels.
    pub format: ValueFormat,
    /// Bytes of GPU memory.
    pub gpu_bytes: u64,
}

impl VolumeTexture {
    /// Uploads a volume's values in the format that [`ValueFormat`] chooses.
    ///
    /// # Errors
    /// If they need more layers than the device's textures have.
    pub fn upload(device: &Device, queue: &Queue, values: ValueSlice<'_>) -> Result<Self, RenderError> {
        Self::upload_in_chunks(device, queue, values, &|| {})
    }

    /// Like [`Self::upload`], for a caller that is notified of every chunk that was written.
    ///
    /// # Errors
    /// As for [`Self::upload`].
    pub fn upload_in_chunks(
        device: &Device,
        queue: &Queue,
        values: ValueSlice<'_>,
        written: &dyn Fn(),
    ) -> Result<Self, RenderError> {
        let side = side(&device.limits(), "the volume's values", values.len() as u64)?;
        Ok(Self::fold(device, queue, values, side, written))
    }

    /// Uploads the bits of as many numbers as the volume has values.
    ///
    /// # Errors
    /// See [`Self::upload`].
    pub fn upload_bits(device: &Device, queue: &Queue, numbers: &[f32]) -> Result<Self, RenderError> {
        let side = side(&device.limits(), "the volume's coefficients", numbers.len() as u64)?;
        let size = folded(numbers.len() as u64, side);
        let (texture, uploaded) = Self::new(device, "sheetsplat.coefficients", ValueFormat::Bits, size);
        fill_from(queue, &texture, numbers, f32::to_bits);
        Ok(uploaded)
    }

    /// Uploads the bits of four numbers for each voxel, `Rgba32Uint`.
    ///
    /// # Errors
    /// See [`Self::upload`].
    pub fn upload_color_bits(device: &Device, queue: &Queue, numbers: &[[f32; 4]]) -> Result<Self, RenderError> {
        let side = side(&device.limits(), "the coefficients of the volume's colours", numbers.len() as u64)?;
        let size = folded(numbers.len() as u64, side);
        let (texture, uploaded) =
            Self::new_as(device, "sheetsplat.color_coefficients", ValueFormat::Bits, COLOR_BITS, size);
        fill_from(queue, &texture, numbers, |color| color.map(f32::to_bits));
        Ok(uploaded)
    }

    /// The size in bytes of four numbers for each voxel.
    ///
    /// # Errors
    /// If they need more layers than textures may have.
    pub fn estimate_color_bits(limits: &Limits, voxels: u64) -> Result<u64, RenderError> {
        let side = side(limits, "the coefficients of the volume's colours", voxels)?;
        Ok(bytes_as(COLOR_BITS, folded(voxels, side)))
    }

    /// Like [`Self::upload`], with layers of a given side, necessary or not.
    pub fn upload_folded(device: &Device, queue: &Queue, values: ValueSlice<'_>, side: u32) -> Self {
        Self::fold(device, queue, values, side, &|| {})
    }

    fn fold(device: &Device, queue: &Queue, values: ValueSlice<'_>, side: u32, written: &dyn Fn()) -> Self {
        let format = ValueFormat::of(values);
        let (texture, uploaded) = Self::new(device, "sheetsplat.values", format, folded(values.len() as u64, side));
        match format {
            ValueFormat::Offset8(least) => fill_values(queue, &texture, values, |value| (value - least) as u8, written),
            ValueFormat::Offset16(least) => {
                fill_values(queue, &texture, values, |value| (value - least) as u16, written);
            }
            ValueFormat::Bits => fill_values(queue, &texture, values, f32::to_bits, written),
        }
        uploaded
    }

    /// Uploads any words: slots of pages, or gradients of membership. `what` names them in errors.
    ///
    /// # Errors
    /// If they need more layers than the device's textures have.
    pub(crate) fn upload_words(
        device: &Device,
        queue: &Queue,
        (label, what): (&str, &'static str),
        words: &[u32],
    ) -> Result<Self, RenderError> {
        let side = side(&device.limits(), what, words.len() as u64)?;
        let (texture, uploaded) = Self::new(device, label, ValueFormat::Bits, folded(words.len() as u64, side));
        fill_from(queue, &texture, words, |word| word);
        Ok(uploaded)
    }

    /// A texture with room for a number of texels, and itself.
    ///
    /// # Errors
    /// If it needs more layers than the device's textures have.
    #[cfg(not(target_arch = "wasm32"))]
    pub(crate) fn with_room(
        device: &Device,
        label: &'static str,
        (format, texels): (ValueFormat, TextureFormat),
        count: u64,
    ) -> Result<(wgpu::Texture, Self), RenderError> {
        let side = side(&device.limits(), label, count)?;
        Ok(Self::new_as(device, label, format, texels, folded(count, side)))
    }

    /// Uploads the labels of segmented channels, one channel after the other, `R16Uint`.
    ///
    /// # Errors
    /// If they need more layers than the device's textures have.
    pub fn upload_labels(device: &Device, queue: &Queue, labels: &[u16]) -> Result<Self, RenderError> {
        let side = side(&device.limits(), "the volume's labels", labels.len() as u64)?;
        let (texture, uploaded) = Self::new(device, "sheetsplat.labels", LABELS, folded(labels.len() as u64, side));
        fill_from(queue, &texture, labels, |label| label);
        Ok(uploaded)
    }

    /// Uploads colours of voxels' own, one channel after the other, with the number that stands for 1: `Rgba8Uint` if that reproduces them, else `Rgba16Uint`.
    ///
    /// # Errors
    /// If they need more layers than the device's textures have.
    pub fn upload_colors(device: &Device, queue: &Queue, colors: &[Texel]) -> Result<(Self, u32), RenderError> {
        let side = side(&device.limits(), "the volume's colours", colors.len() as u64)?;
        let format = color_format(colors);
        let size = folded(colors.len() as u64, side);
        let (texture, uploaded) = Self::new_as(device, "sheetsplat.colors", ValueFormat::Bits, format, size);
        let full = match format {
            TextureFormat::Rgba8Uint => {
                fill_from(queue, &texture, colors, |texel| texel.map(|number| (number / BYTE) as u8));
                u32::from(u8::MAX)
            }
            _ => {
                fill_from(queue, &texture, colors, |texel| texel);
                u32::from(u16::MAX)
            }
        };
        Ok((uploaded, full))
    }

    /// The size in bytes of colours of voxels' own.
    ///
    /// # Errors
    /// If they need more layers than textures may have.
    pub fn estimate_colors(limits: &Limits, colors: &[Texel]) -> Result<u64, RenderError> {
        let side = side(limits, "the volume's colours", colors.len() as u64)?;
        Ok(bytes_as(color_format(colors), folded(colors.len() as u64, side)))
    }

    /// A texture of one colour, for volumes without colours.
    pub fn no_colors(device: &Device) -> Self {
        Self::new_as(device, "sheetsplat.no_colors", ValueFormat::Bits, TextureFormat::Rgba8Uint, [1; 3]).1
    }

    /// The sizes in bytes of `voxels` values in a format, and of as many labels.
    ///
    /// # Errors
    /// If they need more layers than textures may have.
    pub fn estimate(limits: &Limits, voxels: u64, format: ValueFormat) -> Result<[u64; 2], RenderError> {
        let side = side(limits, "the volume's values", voxels)?;
        Ok([format, LABELS].map(|format| bytes(format, folded(voxels, side))))
    }

    /// A texture of one label, for volumes without labels.
    pub fn no_labels(device: &Device) -> Self {
        Self::new(device, "sheetsplat.no_labels", LABELS, [1; 3]).1
    }

    fn new(device: &Device, label: &str, format: ValueFormat, size: [u32; 3]) -> (wgpu::Texture, Self) {
        Self::new_as(device, label, format, format.texture(), size)
    }

    fn new_as(
        device: &Device,
        label: &str,
        format: ValueFormat,
        texels: TextureFormat,
        [width, height, layers]: [u32; 3],
    ) -> (wgpu::Texture, Self) {
        let texture = device.create_texture(&TextureDescriptor {
            label: Some(label),
            size: Extent3d { width, height, depth_or_array_layers: layers },
            mip_level_count: 1,
            sample_count: 1,
            dimension: TextureDimension::D2,
            format: texels,
            usage: TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let view = texture.create_view(&wgpu::TextureViewDescriptor {
            label: Some(label),
            dimension: Some(wgpu::TextureViewDimension::D2Array),
            ..wgpu::TextureViewDescriptor::default()
        });
        (texture, Self { view, format, gpu_bytes: bytes_as(texels, [width, height, layers]) })
    }
}

/// A step of colours that were bytes.
const BYTE: u16 = u16::MAX / u8::MAX as u16;

/// The smallest format that reproduces colours.
fn color_format(colors: &[Texel]) -> TextureFormat {
    let are_bytes = colors.par_iter().all(|texel| texel.iter().all(|number| number.is_multiple_of(BYTE)));
    if are_bytes { TextureFormat::Rgba8Uint } else { TextureFormat::Rgba16Uint }
}

/// The number of values converted and sent at a time: whole rows of a layer, whatever its side.
const CHUNK: usize = (LEAST_SIDE * LEAST_SIDE) as usize;

/// Writes a number of texels, chunk by chunk; `append` appends those of a range. There is never a second volume in memory, except for the queue's own copies of what is
/// not submitted yet.
fn fill<T: bytemuck::NoUninit>(
    queue: &Queue,
    texture: &wgpu::Texture,
    count: usize,
    append: impl Fn(&mut Vec<T>, Range<usize>),
    written: &dyn Fn(),
) {
    let side = texture.width();
    let write = |texels: &[T], width: u32, row: u32| {
        let origin = wgpu::Origin3d { x: 0, y: row % side, z: row / side };
        let height = texels.len() as u32 / width;
        queue.write_texture(
            wgpu::TexelCopyTextureInfo { origin, ..texture.as_image_copy() },
            bytemuck::cast_slice(texels),
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(width * size_of::<T>() as u32),
                rows_per_image: None,
            },
            Extent3d { width, height, depth_or_array_layers: 1 },
        );
    };
    let mut texels = Vec::with_capacity(CHUNK.min(count));
    for first in (0..count).step_by(CHUNK) {
        texels.clear();
        append(&mut texels, first..(first + CHUNK).min(count));
        let row = (first / side as usize) as u32;
        let (whole, rest) = texels.split_at(texels.len() / side as usize * side as usize);
        if !whole.is_empty() {
            write(whole, side, row);
        }
        if !rest.is_empty() {
            write(rest, rest.len() as u32, row + whole.len() as u32 / side);
        }
        written();
    }
}

/// Writes a texel for each of some values.
fn fill_values<T: bytemuck::NoUninit>(
    queue: &Queue,
    texture: &wgpu::Texture,
    values: ValueSlice<'_>,
    texel: impl Fn(f32) -> T,
    written: &dyn Fn(),
) {
    let append = |texels: &mut Vec<T>, range: Range<usize>| {
        values.slice(range).iter().for_each(|value| texels.push(texel(value)));
    };
    fill(queue, texture, values.len(), append, written);
}

/// Writes a texel for each of some numbers.
fn fill_from<V: Copy, T: bytemuck::NoUninit>(
    queue: &Queue,
    texture: &wgpu::Texture,
    numbers: &[V],
    texel: impl Fn(V) -> T,
) {
    let append =
        |texels: &mut Vec<T>, range: Range<usize>| texels.extend(numbers[range].iter().map(|&number| texel(number)));
    fill(queue, texture, numbers.len(), append, &|| {});
}

/// The smallest side with which the device has enough layers for `voxels` voxels.
///
/// # Errors
/// If no side suffices.
pub fn side(limits: &Limits, what: &'static str, voxels: u64) -> Result<u32, RenderError> {
    let mut required = 0;
    for side in SIDES.into_iter().filter(|&side| side <= limits.max_texture_dimension_2d) {
        let [_, _, layers] = folded(voxels, side);
        if layers <= limits.max_texture_array_layers {
            return Ok(side);
        }
        required = layers.into();
    }
    let (limit, actual) = ("max_texture_array_layers", limits.max_texture_array_layers.into());
    Err(RenderError::Limit { what, limit, required, actual })
}

/// Width, height and number of layers for one number per voxel.
fn folded(voxels: u64, side: u32) -> [u32; 3] {
    let rows = voxels.div_ceil(side.into()) as u32;
    [side, rows.min(side), rows.div_ceil(side)]
}

fn bytes(format: ValueFormat, size: [u32; 3]) -> u64 {
    bytes_as(format.texture(), size)
}

fn bytes_as(texels: TextureFormat, size: [u32; 3]) -> u64 {
    u64::from(texels.block_copy_size(None).unwrap_or(0)) * size.map(u64::from).iter().product::<u64>()
}
