//! Buffers that depend only on the image's size: the compositing buffer, sheet buffers, opacity and occlusion buffers.

use wgpu::{
    Buffer, BufferUsages, CommandEncoder, Device, Limits, Texture, TextureFormat, TextureUsages, TextureView,
    TextureViewDescriptor, TextureViewDimension,
};

use super::bindings::{BufferSpec, buffer_spec, grown, sizes, uploaded};
use super::layout::Band;
use crate::error::RenderError;
use crate::lists::quad_plan::{TILE, tile_grid};

/// The compositing buffer.
#[derive(Debug)]
pub struct CompositingBuffer {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Bands of rows that each fit one storage binding.
    pub bands: Vec<BandBuffer>,
}

/// The buffers that quads are drawn into and tested against.
#[derive(Debug)]
pub struct Targets {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// The sheet buffers of a group, one per layer.
    pub sheets: Texture,
    /// The opacity buffer clamped to the threshold: one bit per pixel, 32 pixels of a row per word.
    pub opaque: Buffer,
    /// The opacity buffer eroded along the columns, half way to the occlusion buffer.
    pub opaque_columns: Buffer,
    /// The occlusion buffer (§6).
    pub occluded: Buffer,
    /// A word per tile: 1 where all its pixels are opaque.
    pub opaque_tiles: Buffer,
    /// One word per tile: [`SheetGroup::number`](super::layout::SheetGroup::number) of the last group that composited it, or 0.
    pub last_groups: Buffer,
}

/// One band of the compositing buffer.
#[derive(Debug)]
pub struct BandBuffer {
    /// Its rows.
    pub band: Band,
    /// `Band` as a uniform.
    pub uniform: Buffer,
    /// `[vec4f]`, premultiplied RGBA, row by row.
    pub acc: Buffer,
}

/// The size of a pixel in the compositing buffer in bytes.
const ACC_BYTES: u64 = 16;

impl CompositingBuffer {
    /// The bands of an image, as few as the limits allow.
    ///
    /// # Errors
    /// If the image exceeds the maximum texture size, or 32 of its rows exceed a binding.
    pub fn bands(limits: &Limits, size: [u32; 2]) -> Result<Vec<Band>, RenderError> {
        Self::bands_for(limits, size, 1)
    }

    /// The bands of an image for which one binding holds a number of records, each of a compositing buffer's size.
    ///
    /// # Errors
    /// As for [`Self::bands`].
    pub fn bands_for(limits: &Limits, size: [u32; 2], records: u32) -> Result<Vec<Band>, RenderError> {
        let limit = |what, limit, required: u64, actual: u64| {
            if required > actual { Err(RenderError::Limit { what, limit, required, actual }) } else { Ok(()) }
        };
        let [width, height] = size;
        let row_bytes = u64::from(width) * ACC_BYTES * u64::from(records);
        let binding = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        let texture = limits.max_texture_dimension_2d.into();
        limit("image.width", "max_texture_dimension_2d", width.into(), texture)?;
        limit("image.height", "max_texture_dimension_2d", height.into(), texture)?;
        // Bands end at tile boundaries.
        limit("32 rows of image.width", "max_storage_buffer_binding_size", row_bytes * u64::from(TILE), binding)?;

        let rows_per_band = (binding / row_bytes / u64::from(TILE)).min(height.div_ceil(TILE).into()) as u32 * TILE;
        let first_rows = (0..height).step_by(rows_per_band as usize);
        Ok(first_rows.map(|first_row| Band { first_row, rows: rows_per_band.min(height - first_row) }).collect())
    }

    /// Allocates these bands.
    pub fn new(device: &Device, size: [u32; 2], bands: &[Band]) -> Self {
        Self { size, bands: bands.iter().map(|&band| BandBuffer::new(device, size[0], band)).collect() }
    }

    /// Clears all bands.
    pub fn clear(&self, encoder: &mut CommandEncoder) {
        self.bands.iter().for_each(|band| encoder.clear_buffer(&band.acc, 0, None));
    }

    /// The size in bytes of `bands` bands.
    pub fn estimate([width, height]: [u32; 2], bands: usize) -> u64 {
        (bands * size_of::<Band>()) as u64 + u64::from(width) * u64::from(height) * ACC_BYTES
    }

    /// Bytes of GPU memory.
    pub fn gpu_bytes(&self) -> u64 {
        self.bands.iter().map(|band| band.acc.size() + band.uniform.size()).sum()
    }
}

impl Targets {
    /// Targets for groups of `sheets` sheets. The compositing buffer of that size must have been allocated successfully.
    ///
    /// # Errors
    /// If one bit per pixel exceeds a binding.
    pub fn new(device: &Device, size: [u32; 2], sheet_format: TextureFormat, sheets: u32) -> Result<Self, RenderError> {
        let [width, height] = size;
        let sheet_buffers = || {
            device.create_texture(&wgpu::TextureDescriptor {
                label: Some("sheetsplat.sheets"),
                size: wgpu::Extent3d { width, height, depth_or_array_layers: sheets },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: sheet_format,
                usage: TextureUsages::RENDER_ATTACHMENT
                    | TextureUsages::TEXTURE_BINDING
                    | TextureUsages::COPY_SRC
                    | TextureUsages::COPY_DST,
                view_formats: &[],
            })
        };
        let [opaque, opaque_columns, occluded, opaque_tiles, last_groups] =
            masks(size).map(|mask| grown(device, None, &mask));
        Ok(Self {
            size,
            opaque: opaque?,
            opaque_columns: opaque_columns?,
            occluded: occluded?,
            opaque_tiles: opaque_tiles?,
            last_groups: last_groups?,
            sheets: sheet_buffers(),
        })
    }

    /// The size of these targets in bytes.
    ///
    /// # Errors
    /// If one bit per pixel exceeds a binding.
    pub fn estimate(
        limits: &Limits,
        size: [u32; 2],
        sheet_format: TextureFormat,
        sheets: u32,
    ) -> Result<u64, RenderError> {
        let texel = u64::from(sheet_format.block_copy_size(None).unwrap_or(0));
        let texels = size.map(u64::from).iter().product::<u64>() * u64::from(sheets);
        Ok(texels * texel + sizes(limits, &masks(size))?)
    }

    /// The number of sheet buffers.
    pub fn layers(&self) -> u32 {
        self.sheets.depth_or_array_layers()
    }

    /// The number of tiles.
    pub fn tiles(&self) -> u32 {
        tile_grid(self.size).iter().product()
    }

    /// All sheet buffers, for compositing.
    pub fn sheets_view(&self) -> TextureView {
        self.sheets.create_view(&TextureViewDescriptor {
            dimension: Some(TextureViewDimension::D2Array),
            ..TextureViewDescriptor::default()
        })
    }

    /// One sheet buffer, to draw into.
    pub fn sheet_view(&self, layer: u32) -> TextureView {
        self.sheets.create_view(&TextureViewDescriptor {
            dimension: Some(TextureViewDimension::D2),
            base_array_layer: layer,
            array_layer_count: Some(1),
            ..TextureViewDescriptor::default()
        })
    }

    /// The buffers that are zeroed at the start of a frame.
    pub fn masks(&self) -> [&Buffer; 5] {
        let Self { opaque, opaque_columns, occluded, opaque_tiles, last_groups, .. } = self;
        [opaque, opaque_columns, occluded, opaque_tiles, last_groups]
    }

    /// Bytes of GPU memory.
    pub fn gpu_bytes(&self) -> u64 {
        let pixels = u64::from(self.size[0]) * u64::from(self.size[1]);
        let texel = u64::from(self.sheets.format().block_copy_size(None).unwrap_or(0));
        let sheets = pixels * texel * u64::from(self.layers());
        sheets + self.masks().map(Buffer::size).iter().sum::<u64>()
    }
}

/// The buffers of [`Targets`], in its order.
fn masks(size: [u32; 2]) -> [BufferSpec; 5] {
    let [columns, rows] = tile_grid(size);
    let mask = |label, words: u32| {
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST | BufferUsages::COPY_SRC;
        buffer_spec(label, u64::from(words) * 4, usage)
    };
    [
        mask("sheetsplat.opaque", columns * size[1]),
        mask("sheetsplat.opaque_columns", columns * size[1]),
        mask("sheetsplat.occluded", columns * size[1]),
        mask("sheetsplat.opaque_tiles", columns * rows),
        mask("sheetsplat.last_groups", columns * rows),
    ]
}

/// A depth texture that is never read, used where the host has none.
pub fn no_surfaces(device: &Device) -> TextureView {
    let texture = device.create_texture(&wgpu::TextureDescriptor {
        label: Some("sheetsplat.no_surfaces"),
        size: wgpu::Extent3d { width: 1, height: 1, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: TextureFormat::Depth32Float,
        usage: TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    });
    texture.create_view(&TextureViewDescriptor::default())
}

impl BandBuffer {
    fn new(device: &Device, width: u32, band: Band) -> Self {
        Self {
            band,
            uniform: uploaded(
                device,
                "sheetsplat.band",
                bytemuck::bytes_of(&band),
                size_of::<Band>() as u64,
                BufferUsages::UNIFORM,
            ),
            acc: device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("sheetsplat.acc"),
                size: u64::from(width) * u64::from(band.rows) * ACC_BYTES,
                usage: BufferUsages::STORAGE | BufferUsages::COPY_DST | BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            }),
        }
    }
}
