//! What hides the part of a volume behind it: a host's surfaces, or what was drawn before.

use wgpu::{Device, Queue, TextureFormat, TextureUsages, TextureView, TextureViewDescriptor};

use crate::error::RenderError;
use crate::geometry::surfaces::{SurfaceDepths, Surfaces};
use crate::geometry::view_geometry::ViewGeometry;
use crate::settings::window::Region;
use crate::volume::Grid;

/// What ends pixels' rays.
#[derive(Debug)]
pub(crate) enum Hiding {
    /// A host's surfaces.
    Surfaces(Surfaces),
    /// Pixels that are opaque before the frame is drawn.
    Closed(ClosedPixels),
}

/// Pixels of a region to which nothing is drawn.
#[derive(Debug)]
pub(crate) struct ClosedPixels {
    /// A depth for every pixel of the region: 0 for closed ones, 1 for others.
    depth: TextureView,
    region: Region,
}

impl Hiding {
    /// The texture of depths.
    pub(crate) fn depth(&self) -> &TextureView {
        match self {
            Self::Surfaces(surfaces) => &surfaces.depth,
            Self::Closed(closed) => &closed.depth,
        }
    }

    /// What its depths mean, and the texel of the image's first pixel.
    ///
    /// # Errors
    /// If a host's surfaces are not those of the view.
    pub(crate) fn depths(&self, view: &ViewGeometry, grid: &Grid) -> Result<(SurfaceDepths, [u32; 2]), RenderError> {
        match self {
            Self::Surfaces(surfaces) => Ok((surfaces.depths(view, grid)?, surfaces.origin)),
            // The texel of a pixel is their sum, and integers wrap around.
            Self::Closed(ClosedPixels { region: Region { x, y, .. }, .. }) => {
                Ok((SurfaceDepths::IN_FRONT, [x.wrapping_neg(), y.wrapping_neg()]))
            }
        }
    }
}

impl ClosedPixels {
    /// Uploads which pixels of a region are closed, row by row.
    pub(crate) fn upload(device: &Device, queue: &Queue, region: &Region, closed: &[bool]) -> Self {
        let size = wgpu::Extent3d { width: region.width, height: region.height, depth_or_array_layers: 1 };
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("sheetsplat.closed_pixels"),
            size,
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            // The only format of depths that all devices copy to.
            format: TextureFormat::Depth16Unorm,
            usage: TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let depths: Vec<u16> = closed.iter().map(|&closed| if closed { 0 } else { u16::MAX }).collect();
        let bytes_per_row = Some(size_of::<u16>() as u32 * region.width);
        let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row, rows_per_image: None };
        queue.write_texture(texture.as_image_copy(), bytemuck::cast_slice(&depths), layout, size);
        Self { depth: texture.create_view(&TextureViewDescriptor::default()), region: *region }
    }
}
