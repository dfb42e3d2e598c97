//! The control points of the ramps, and the tables of their integrals, as a texture.
//!
//! A texture and not a storage buffer: a software driver reads storage lane by lane and component by component, which takes more than ten times as
//! long where lanes read different elements.

use wgpu::{
    Device, Extent3d, Limits, Queue, TexelCopyBufferLayout, Texture, TextureDescriptor, TextureDimension,
    TextureFormat, TextureUsages, TextureView, TextureViewDescriptor,
};

use super::layout::POINTS_PER_ROW;
use crate::error::RenderError;

/// The texture, which `control_point` in `shaders/shared/ramps.wgsl` reads.
#[derive(Debug)]
pub struct ControlPoints {
    texture: Texture,
    /// The whole texture.
    pub view: TextureView,
}

impl ControlPoints {
    /// A texture of these points; the old one is reused if it has the right size.
    ///
    /// # Errors
    /// If there are more than a texture holds.
    pub fn written(
        device: &Device,
        queue: &Queue,
        old: Option<Self>,
        points: &[[f32; 4]],
    ) -> Result<Self, RenderError> {
        let rows = rows(&device.limits(), points.len())?;
        let size = Extent3d { width: POINTS_PER_ROW, height: rows, depth_or_array_layers: 1 };
        let own = old.filter(|old| old.texture.size() == size).unwrap_or_else(|| {
            let texture = device.create_texture(&TextureDescriptor {
                label: Some("sheetsplat.control_points"),
                size,
                mip_level_count: 1,
                sample_count: 1,
                dimension: TextureDimension::D2,
                format: TextureFormat::Rgba32Float,
                usage: TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST,
                view_formats: &[],
            });
            let view = texture.create_view(&TextureViewDescriptor::default());
            Self { texture, view }
        });
        let mut texels = points.to_vec();
        texels.resize((rows * POINTS_PER_ROW) as usize, [0.0; 4]);
        let bytes_per_row = Some(POINTS_PER_ROW * POINT_BYTES);
        let layout = TexelCopyBufferLayout { offset: 0, bytes_per_row, rows_per_image: None };
        queue.write_texture(own.texture.as_image_copy(), bytemuck::cast_slice(&texels), layout, size);
        Ok(own)
    }

    /// Bytes of GPU memory for this many points.
    ///
    /// # Errors
    /// As for [`Self::written`].
    pub fn estimate(limits: &Limits, points: usize) -> Result<u64, RenderError> {
        Ok(u64::from(rows(limits, points)?) * u64::from(POINTS_PER_ROW * POINT_BYTES))
    }

    /// Bytes of GPU memory.
    pub fn gpu_bytes(&self) -> u64 {
        u64::from(self.texture.height()) * u64::from(POINTS_PER_ROW * POINT_BYTES)
    }
}

/// Bytes of a control point.
const POINT_BYTES: u32 = 16;

/// The number of rows that hold some points; at least one, because textures may not be empty.
fn rows(limits: &Limits, points: usize) -> Result<u32, RenderError> {
    let (required, actual) = (points.div_ceil(POINTS_PER_ROW as usize).max(1) as u64, limits.max_texture_dimension_2d);
    if required > actual.into() {
        let (what, limit) = ("the control points of the transfer function", "max_texture_dimension_2d");
        return Err(RenderError::Limit { what, limit, required, actual: actual.into() });
    }
    Ok(required as u32)
}
