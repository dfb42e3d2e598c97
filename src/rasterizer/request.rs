//! A frame request: everything about a frame that is known, and can be refused, before anything is allocated.

use std::ops::Range;

use wgpu::Device;

use super::kind::{RasterizerKind, check_rays};
use crate::error::RenderError;
use crate::geometry::kernel::Kernel;
use crate::geometry::means;
use crate::geometry::surfaces::{SurfaceDepths, Surfaces};
use crate::geometry::view_geometry::ViewGeometry;
use crate::gpu::classified_volume::ClassifiedVolume;
use crate::gpu::layout::Band;
use crate::gpu::targets::CompositingBuffer;
use crate::gpu::uniforms::Ramps;
use crate::pass::composite::RayMode;
use crate::scene::Scene;
use crate::setting_error::SettingError;
use crate::settings::camera::Camera;
use crate::settings::splatting::{Classification, Rasterizer, Splatting};

/// A frame of a view.
#[derive(Debug)]
pub(crate) struct FrameRequest {
    pub(crate) splatting: Splatting,
    pub(crate) view: ViewGeometry,
    pub(crate) kernel: Kernel,
    pub(crate) ramps: Ramps,
    /// The sheet depths whose slabs count even if they are empty: [`means::covered`].
    pub(crate) covered: Range<f64>,
    pub(crate) rays: RayMode,
    /// The opacity of first hits.
    pub(crate) first_hit: Option<f64>,
    /// A host's surfaces, and the texel of the image's first pixel.
    pub(crate) surfaces: Option<(SurfaceDepths, [u32; 2])>,
    pub(crate) kind: RasterizerKind,
    /// Why the device does not draw by tiles.
    pub(crate) fallback: Option<RenderError>,
    /// The bands of the compositing buffer.
    pub(crate) bands: Vec<Band>,
}

impl FrameRequest {
    /// Makes the request. The camera is the scene's with all values that depend on an object filled in.
    ///
    /// # Errors
    /// If the scene needs something that is not implemented or that exceeds the device's limits.
    pub(crate) fn new(
        device: &Device,
        volume: &ClassifiedVolume,
        (scene, camera): (&Scene, &Camera),
        (surfaces, first_hit): (Option<&Surfaces>, Option<f64>),
        rasterizer: Rasterizer,
    ) -> Result<Self, RenderError> {
        let splatting = scene.splatting;
        splatting.check()?;
        if splatting.classification == Classification::After {
            let (found, allowed) = ("\"after\" on the GPU", "\"before\", or the reference backend");
            return Err(SettingError::new("splatting.classification", found, allowed).into());
        }
        let (grid, size) = (volume.grid(), [scene.image.width, scene.image.height]);
        let seen = ViewGeometry::new(grid, camera, &splatting, size)?;
        let bands = CompositingBuffer::bands(&device.limits(), size)?;
        let rays = RayMode { cut: surfaces.is_some() || !scene.clip.is_empty(), first_hit: first_hit.is_some() };
        check_rays(device, &splatting, rays, first_hit, size)?;
        let surfaces = match surfaces {
            Some(surfaces) => Some((surfaces.depths(&seen, grid)?, surfaces.origin)),
            None => None,
        };
        let (kind, fallback) = RasterizerKind::of(device, &splatting, rasterizer)?;
        Ok(Self {
            kind,
            fallback,
            covered: means::covered(&seen, grid, &splatting),
            kernel: Kernel::new(splatting.radius, splatting.falloff),
            ramps: Ramps::new(volume.transfer()),
            first_hit,
            view: seen,
            splatting,
            rays,
            surfaces,
            bands,
        })
    }

    /// The number of pixels in the image.
    pub(crate) fn pixels(&self) -> u64 {
        self.view.size.map(u64::from).iter().product()
    }

    /// The size of first hits in bytes, one word or depth per pixel; 0 if they are not requested.
    pub(crate) fn hit_bytes(&self) -> u64 {
        if self.rays.first_hit { 4 * self.pixels() } else { 0 }
    }
}
