//! What depends on the image's size alone: sheet buffer and compositing buffer.

use wgpu::util::DeviceExt;
use wgpu::{Buffer, BufferUsages, Device, Texture, TextureFormat, TextureUsages};

use super::layout::Band;
use crate::error::RenderError;

/// Buffers of one image size.
#[derive(Debug)]
pub struct Targets {
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// The sheet buffer.
    pub sheet: Texture,
    /// The compositing buffer, in bands of rows that each fit one storage binding.
    pub bands: Vec<BandBuffer>,
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

/// Bytes of a pixel in the compositing buffer.
const ACC_BYTES: u64 = 16;

impl Targets {
    /// # Errors
    /// If the image is larger than the device's textures may be, or a row of it than a binding.
    pub fn new(device: &Device, size: [u32; 2], sheet_format: TextureFormat) -> Result<Self, RenderError> {
        let limits = device.limits();
        let limit = |what, limit, required: u64, actual: u64| {
            if required > actual { Err(RenderError::Limit { what, limit, required, actual }) } else { Ok(()) }
        };
        let [width, height] = size;
        let row_bytes = u64::from(width) * ACC_BYTES;
        let binding = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        let texture = limits.max_texture_dimension_2d.into();
        limit("image.width", "max_texture_dimension_2d", width.into(), texture)?;
        limit("image.height", "max_texture_dimension_2d", height.into(), texture)?;
        limit("a row of image.width", "max_storage_buffer_binding_size", row_bytes, binding)?;

        let rows_per_band = (binding / row_bytes).min(height.into()) as u32;
        let bands = (0..height)
            .step_by(rows_per_band as usize)
            .map(|first_row| BandBuffer::new(device, width, first_row, rows_per_band.min(height - first_row)))
            .collect();
        let sheet = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("sheetsplat.sheet"),
            size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: sheet_format,
            usage: TextureUsages::RENDER_ATTACHMENT
                | TextureUsages::TEXTURE_BINDING
                | TextureUsages::COPY_SRC
                | TextureUsages::COPY_DST,
            view_formats: &[],
        });
        Ok(Self { size, sheet, bands })
    }

    /// Bytes of GPU memory.
    pub fn gpu_bytes(&self) -> u64 {
        let pixels = u64::from(self.size[0]) * u64::from(self.size[1]);
        let sheet = pixels * u64::from(self.sheet.format().block_copy_size(None).unwrap_or(0));
        sheet + self.bands.iter().map(|band| band.acc.size() + band.uniform.size()).sum::<u64>()
    }
}

impl BandBuffer {
    fn new(device: &Device, width: u32, first_row: u32, rows: u32) -> Self {
        let band = Band { first_row, rows };
        Self {
            band,
            uniform: device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
                label: Some("sheetsplat.band"),
                contents: bytemuck::bytes_of(&band),
                usage: BufferUsages::UNIFORM,
            }),
            acc: device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("sheetsplat.acc"),
                size: u64::from(width) * u64::from(rows) * ACC_BYTES,
                usage: BufferUsages::STORAGE | BufferUsages::COPY_DST | BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            }),
        }
    }
}
