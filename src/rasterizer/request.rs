//! What a frame asks for: everything about it that is known before anything is allocated, and can be refused.

use std::ops::Range;

use wgpu::Device;

use super::kind::{RasterizerKind, check_rays, insists_on_tiles};
use crate::after::normalization::Normalization;
use crate::after::plane_geometry::PlaneGeometry;
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
use crate::settings::camera::Camera;
use crate::settings::shading::Gradient;
use crate::settings::splatting::{Classification, Rasterizer, Splatting};

/// A frame of a view.
#[derive(Debug)]
pub(crate) struct FrameRequest {
    /// With the renderer's rasterizer where the scene leaves the choice.
    pub(crate) splatting: Splatting,
    pub(crate) gradient: Gradient,
    pub(crate) view: ViewGeometry,
    pub(crate) kernel: Kernel,
    pub(crate) ramps: Ramps,
    /// How kernels lie on slab planes, and the numbers that values are splatted as, where classification comes after splatting.
    pub(crate) planes: Option<(PlaneGeometry, Normalization)>,
    /// The sheet depths whose slabs count even where they hold nothing: [`means::covered`].
    pub(crate) covered: Range<f64>,
    pub(crate) rays: RayMode,
    /// The opacity of first hits.
    pub(crate) first_hit: Option<f64>,
    /// A host's surfaces, and the texel that is the image's first.
    pub(crate) surfaces: Option<(SurfaceDepths, [u32; 2])>,
    pub(crate) kind: RasterizerKind,
    /// Why the device does not draw by tiles.
    pub(crate) fallback: Option<RenderError>,
    /// Those of the compositing buffer.
    pub(crate) bands: Vec<Band>,
}

impl FrameRequest {
    /// The camera is the scene's with what it leaves to an object filled in.
    ///
    /// # Errors
    /// If the scene asks for something not implemented, or for more than the device's limits allow.
    pub(crate) fn new(
        device: &Device,
        volume: &ClassifiedVolume,
        (scene, camera): (&Scene, &Camera),
        (surfaces, first_hit): (Option<&Surfaces>, Option<f64>),
        rasterizer: Rasterizer,
    ) -> Result<Self, RenderError> {
        let splatting = settled(scene.splatting, rasterizer);
        splatting.check()?;
        let (grid, size) = (volume.grid(), [scene.image.width, scene.image.height]);
        let seen = ViewGeometry::new(grid, camera, &splatting, size)?;
        let bands = CompositingBuffer::bands(&device.limits(), size)?;
        let rays = RayMode { cut: surfaces.is_some() || !scene.clip.is_empty(), first_hit: first_hit.is_some() };
        check_rays(device, &splatting, rays, first_hit, size)?;
        let surfaces = match surfaces {
            Some(surfaces) => Some((surfaces.depths(&seen, grid)?, surfaces.origin)),
            None => None,
        };
        let (kind, fallback) = RasterizerKind::of(device, &splatting)?;
        let planes = match splatting.classification {
            Classification::Before => None,
            Classification::After => Some((PlaneGeometry::new(&seen, grid), volume.gpu_volume().numbers())),
        };
        Ok(Self {
            kind,
            fallback,
            covered: means::covered(&seen, grid, &splatting),
            kernel: Kernel::new(splatting.radius, splatting.falloff),
            ramps: match &planes {
                Some((_, numbers)) => Ramps::with_integrals(volume.transfer(), splatting.compositing, numbers),
                None => Ramps::new(volume.transfer()),
            },
            planes,
            first_hit,
            gradient: scene.shading.gradient,
            view: seen,
            splatting,
            rays,
            surfaces,
            bands,
        })
    }

    /// Pixels of the image.
    pub(crate) fn pixels(&self) -> u64 {
        self.view.size.map(u64::from).iter().product()
    }

    /// Bytes of first hits, a word or a depth per pixel; none, if they are not asked for.
    pub(crate) fn hit_bytes(&self) -> u64 {
        if self.rays.first_hit { 4 * self.pixels() } else { 0 }
    }
}

/// The settings, with the renderer's rasterizer where they leave the choice.
fn settled(splatting: Splatting, rasterizer: Rasterizer) -> Splatting {
    let is_open = splatting.rasterizer == Rasterizer::Auto && !insists_on_tiles(&splatting);
    Splatting { rasterizer: if is_open { rasterizer } else { splatting.rasterizer }, ..splatting }
}
