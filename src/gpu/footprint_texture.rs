//! Footprint tables as texture arrays.

use wgpu::util::{DeviceExt, TextureDataOrder};
use wgpu::{Device, Queue, TextureFormat, TextureView};

use crate::geometry::footprint::FootprintTable;
use crate::settings::splatting::FootprintForm;

/// A footprint table on the GPU.
#[derive(Debug)]
pub struct FootprintTexture {
    /// The form of the table.
    pub form: FootprintForm,
    /// All layers.
    pub view: TextureView,
    /// Bytes of GPU memory.
    pub gpu_bytes: u64,
}

impl FootprintTexture {
    /// Uploads a table.
    pub fn upload(device: &Device, queue: &Queue, table: &FootprintTable) -> Self {
        let format = match table.form {
            FootprintForm::Sections => TextureFormat::R32Float,
            FootprintForm::SummedArea => TextureFormat::Rg32Float,
        };
        let descriptor = wgpu::TextureDescriptor {
            label: Some("sheetsplat.footprints"),
            size: wgpu::Extent3d { width: table.size, height: table.size, depth_or_array_layers: table.layers },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        };
        let bytes: &[u8] = bytemuck::cast_slice(&table.texels);
        let texture = device.create_texture_with_data(queue, &descriptor, TextureDataOrder::LayerMajor, bytes);
        let view = texture.create_view(&wgpu::TextureViewDescriptor {
            label: Some("sheetsplat.footprints"),
            dimension: Some(wgpu::TextureViewDimension::D2Array),
            ..wgpu::TextureViewDescriptor::default()
        });
        Self { form: table.form, view, gpu_bytes: bytes.len() as u64 }
    }
}
