//! The volume's values on the GPU, as a texture array: unlike a buffer's, its size is not limited by what one binding may hold.

use wgpu::{Device, Extent3d, Queue, TextureDescriptor, TextureDimension, TextureFormat, TextureUsages, TextureView};

use crate::error::RenderError;

/// Texels along both sides of a layer, as `shaders/shared/volume.wgsl` folds indices.
pub const SIDE: u32 = 2048;

/// A volume's values, x fastest, folded into rows and layers of a power of two: value i is texel i mod 2048 of row ⌊i/2048⌋.
#[derive(Debug)]
pub struct VolumeTexture {
    /// All layers, `R32Float`.
    pub view: TextureView,
    /// Bytes of GPU memory.
    pub gpu_bytes: u64,
}

impl VolumeTexture {
    /// Uploads a volume's values.
    ///
    /// # Errors
    /// If they need more layers than the device's textures have.
    pub fn upload(device: &Device, queue: &Queue, values: &[f32]) -> Result<Self, RenderError> {
        let rows = (values.len() as u64).div_ceil(SIDE.into()) as u32;
        let (height, layers) = (rows.min(SIDE), rows.div_ceil(SIDE));
        let actual = device.limits().max_texture_array_layers;
        if layers > actual {
            let (what, limit) = ("the volume's values, 4194304 a layer", "max_texture_array_layers");
            return Err(RenderError::Limit { what, limit, required: layers.into(), actual: actual.into() });
        }
        let texture = device.create_texture(&TextureDescriptor {
            label: Some("sheetsplat.values"),
            size: Extent3d { width: SIDE, height, depth_or_array_layers: layers },
            mip_level_count: 1,
            sample_count: 1,
            dimension: TextureDimension::D2,
            format: TextureFormat::R32Float,
            usage: TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let write = |values: &[f32], width: u32, row: u32| {
            let origin = wgpu::Origin3d { x: 0, y: row % SIDE, z: row / SIDE };
            let height = values.len() as u32 / width;
            queue.write_texture(
                wgpu::TexelCopyTextureInfo { origin, ..texture.as_image_copy() },
                bytemuck::cast_slice(values),
                wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(width * 4), rows_per_image: None },
                Extent3d { width, height, depth_or_array_layers: 1 },
            );
        };
        for (layer, values) in (0..).zip(values.chunks((SIDE * SIDE) as usize)) {
            let (whole, rest) = values.split_at(values.len() / SIDE as usize * SIDE as usize);
            if !whole.is_empty() {
                write(whole, SIDE, layer * SIDE);
            }
            if !rest.is_empty() {
                write(rest, rest.len() as u32, layer * SIDE + whole.len() as u32 / SIDE);
            }
        }
        let view = texture.create_view(&wgpu::TextureViewDescriptor {
            label: Some("sheetsplat.values"),
            dimension: Some(wgpu::TextureViewDimension::D2Array),
            ..wgpu::TextureViewDescriptor::default()
        });
        Ok(Self { view, gpu_bytes: 4 * u64::from(SIDE) * u64::from(height) * u64::from(layers) })
    }
}
