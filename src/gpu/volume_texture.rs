//! The volume's values and labels on the GPU, as texture arrays: unlike a buffer's, their size is not limited by what one binding
//! may hold. Layers have 2048 texels a side, or 4096 or 8192 where a volume would need more layers than the device has: with WebGPU's
//! default limits there is room for any.

use wgpu::{
    Device, Extent3d, Limits, Queue, TextureDescriptor, TextureDimension, TextureFormat, TextureUsages, TextureView,
};

use crate::error::RenderError;

/// The least of [`SIDES`].
pub const LEAST_SIDE: u32 = 2048;

/// Texels that a layer may have along both sides.
pub const SIDES: [u32; 3] = [LEAST_SIDE, 4096, 8192];

/// One number per voxel, x fastest, folded into rows and layers of a power of two, the side: that of voxel i is texel i mod side of row
/// ⌊i/side⌋, as `shaders/shared/volume.wgsl` unfolds it.
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
        let side = side(&device.limits(), "the volume's values", values.len() as u64)?;
        Ok(Self::upload_folded(device, queue, values, side))
    }

    /// The same with layers of a given side, whether they need it or not.
    pub fn upload_folded(device: &Device, queue: &Queue, values: &[f32], side: u32) -> Self {
        Self::fold(device, queue, "sheetsplat.values", TextureFormat::R32Float, values, side)
    }

    /// Uploads a segmented volume's labels, `R16Uint`.
    ///
    /// # Errors
    /// If they need more layers than the device's textures have.
    pub fn upload_labels(device: &Device, queue: &Queue, labels: &[u16]) -> Result<Self, RenderError> {
        let side = side(&device.limits(), "the volume's labels", labels.len() as u64)?;
        Ok(Self::fold(device, queue, "sheetsplat.labels", TextureFormat::R16Uint, labels, side))
    }

    /// Bytes of GPU memory that the values of so many voxels will take, and their labels.
    ///
    /// # Errors
    /// If they need more layers than textures may have.
    pub fn estimate(limits: &Limits, voxels: u64) -> Result<[u64; 2], RenderError> {
        let side = side(limits, "the volume's values", voxels)?;
        Ok([TextureFormat::R32Float, TextureFormat::R16Uint].map(|format| bytes(format, folded(voxels, side))))
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
        label: &str,
        format: TextureFormat,
        values: &[T],
        side: u32,
    ) -> Self {
        let (texture, uploaded) = Self::new(device, label, format, folded(values.len() as u64, side));
        let write = |values: &[T], width: u32, row: u32| {
            let origin = wgpu::Origin3d { x: 0, y: row % side, z: row / side };
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
        for (layer, values) in (0..).zip(values.chunks((side * side) as usize)) {
            let (whole, rest) = values.split_at(values.len() / side as usize * side as usize);
            if !whole.is_empty() {
                write(whole, side, layer * side);
            }
            if !rest.is_empty() {
                write(rest, rest.len() as u32, layer * side + whole.len() as u32 / side);
            }
        }
        uploaded
    }
}

/// The least side with which so many voxels have layers enough.
///
/// # Errors
/// If none has.
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

/// Width, height and layers for one number per voxel.
fn folded(voxels: u64, side: u32) -> [u32; 3] {
    let rows = voxels.div_ceil(side.into()) as u32;
    [side, rows.min(side), rows.div_ceil(side)]
}

fn bytes(format: TextureFormat, size: [u32; 3]) -> u64 {
    u64::from(format.block_copy_size(None).unwrap_or(0)) * size.map(u64::from).iter().product::<u64>()
}
