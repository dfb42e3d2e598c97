//! The volume's values and labels on the GPU, as texture arrays: unlike a buffer's, their size is not limited by what one binding
//! may hold.

use wgpu::{Device, Extent3d, Queue, TextureDescriptor, TextureDimension, TextureFormat, TextureUsages, TextureView};

use crate::error::RenderError;

/// Texels along both sides of a layer, as `shaders/shared/volume.wgsl` folds indices.
pub const SIDE: u32 = 2048;

/// One number per voxel, x fastest, folded into rows and layers of a power of two: that of voxel i is texel i mod 2048 of row
/// ⌊i/2048⌋.
#[derive(Debug)]
pub struct VolumeTexture {
    /// All layers.
    pub view: TextureView,
    /// Bytes of GPU memory.
    pub gpu_bytes: u64,
}

impl VolumeTexture {
    /// Uploads a volume's values, `R32Float`.
    ///
    /// # Errors
    /// If they need more layers than the device's textures have.
    pub fn upload(device: &Device, queue: &Queue, values: &[f32]) -> Result<Self, RenderError> {
        let what = ("sheetsplat.values", "the volume's values, 4194304 a layer");
        Self::fold(device, queue, what, TextureFormat::R32Float, values)
    }

    /// Uploads a segmented volume's labels, `R16Uint`.
    ///
    /// # Errors
    /// If they need more layers than the device's textures have.
    pub fn upload_labels(device: &Device, queue: &Queue, labels: &[u16]) -> Result<Self, RenderError> {
        let what = ("sheetsplat.labels", "the volume's labels, 4194304 a layer");
        Self::fold(device, queue, what, TextureFormat::R16Uint, labels)
    }

    /// Bytes of GPU memory that the values of so many voxels will take, and their labels.
    pub fn estimate(voxels: u64) -> [u64; 2] {
        [TextureFormat::R32Float, TextureFormat::R16Uint].map(|format| bytes(format, folded(voxels)))
    }

    /// A texture of one label, for stages of volumes that have none.
    pub fn no_labels(device: &Device) -> Self {
        Self::new(device, "sheetsplat.no_labels", TextureFormat::R16Uint, [1; 3]).1
    }

    fn new(
        device: &Device,
        label: &str,
        format: TextureFormat,
        [width, height, layers]: [u32; 3],
    ) -> (wgpu::Texture, Self) {
        let texture = device.create_texture(&TextureDescriptor {
            label: Some(label),
            size: Extent3d { width, height, depth_or_array_layers: layers },
            mip_level_count: 1,
            sample_count: 1,
            dimension: TextureDimension::D2,
            format,
            usage: TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let view = texture.create_view(&wgpu::TextureViewDescriptor {
            label: Some(label),
            dimension: Some(wgpu::TextureViewDimension::D2Array),
            ..wgpu::TextureViewDescriptor::default()
        });
        (texture, Self { view, gpu_bytes: bytes(format, [width, height, layers]) })
    }

    fn fold<T: bytemuck::NoUninit>(
        device: &Device,
        queue: &Queue,
        (label, what): (&str, &'static str),
        format: TextureFormat,
        values: &[T],
    ) -> Result<Self, RenderError> {
        let size @ [_, _, layers] = folded(values.len() as u64);
        let actual = device.limits().max_texture_array_layers;
        if layers > actual {
            let limit = "max_texture_array_layers";
            return Err(RenderError::Limit { what, limit, required: layers.into(), actual: actual.into() });
        }
        let (texture, uploaded) = Self::new(device, label, format, size);
        let write = |values: &[T], width: u32, row: u32| {
            let origin = wgpu::Origin3d { x: 0, y: row % SIDE, z: row / SIDE };
            let height = values.len() as u32 / width;
            queue.write_texture(
                wgpu::TexelCopyTextureInfo { origin, ..texture.as_image_copy() },
                bytemuck::cast_slice(values),
                wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(width * size_of::<T>() as u32),
                    rows_per_image: None,
                },
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
        Ok(uploaded)
    }
}

/// Width, height and layers for one number per voxel.
fn folded(voxels: u64) -> [u32; 3] {
    let rows = voxels.div_ceil(SIDE.into()) as u32;
    [SIDE, rows.min(SIDE), rows.div_ceil(SIDE)]
}

fn bytes(format: TextureFormat, size: [u32; 3]) -> u64 {
    u64::from(format.block_copy_size(None).unwrap_or(0)) * size.map(u64::from).iter().product::<u64>()
}
