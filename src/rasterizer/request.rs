//! A frame request: everything about a frame that is known, and can be refused, before anything is allocated.

use std::ops::Range;

use wgpu::Device;

use super::kind::{RasterizerKind, check_rays};
use crate::after::brick_ranges::Bearing;
use crate::after::normalization::Normalization;
use crate::error::RenderError;
use crate::geometry::means;
use crate::geometry::plane_geometry::PlaneGeometry;
use crate::geometry::surfaces::{SurfaceDepths, Surfaces};
use crate::geometry::view_geometry::ViewGeometry;
use crate::gpu::classified_volume::{BrickNeeds, ClassifiedVolume};
use crate::gpu::layout::Band;
use crate::gpu::targets::CompositingBuffer;
use crate::gpu::uniforms::Ramps;
use crate::kernel::Kernel;
use crate::pass::composite::RayMode;
use crate::scene::Scene;
use crate::settings::camera::Camera;
use crate::settings::shading::Gradient;
use crate::settings::splatting::{Classification, Interpolation, Rasterizer, Splatting};
use crate::settings::window::Window;

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
    /// What is drawn (SPEC §11).
    pub(crate) window: Window,
    /// The opacity of first hits.
    pub(crate) first_hit: Option<f64>,
    /// A host's surfaces, and the texel of the image's first pixel.
    pub(crate) surfaces: Option<(SurfaceDepths, [u32; 2])>,
    pub(crate) kind: RasterizerKind,
    /// Why the device does not draw by tiles.
    pub(crate) fallback: Option<RenderError>,
    /// The number of threads in the device's smallest subgroups.
    pub(crate) subgroup_threads: u32,
    /// The bands of the compositing buffer.
    pub(crate) bands: Vec<Band>,
    /// Of classification after splatting.
    pub(crate) after: Option<After>,
}

/// What a frame asks for whose values are classified after splatting (SPEC §9).
#[derive(Debug)]
pub(crate) struct After {
    /// The view, with the plane that the slab of its near plane begins at for a near plane.
    pub(crate) view: ViewGeometry,
    pub(crate) planes: PlaneGeometry,
    pub(crate) numbers: Normalization,
    pub(crate) needs: BrickNeeds,
    pub(crate) gradient: Gradient,
}

impl After {
    fn new(volume: &ClassifiedVolume, scene: &Scene, seen: &ViewGeometry) -> Result<Self, RenderError> {
        let splatting = &scene.splatting;
        let planes = PlaneGeometry::new(seen, volume.grid());
        let coefficients = match splatting.interpolation {
            Interpolation::Smooth => None,
            Interpolation::Exact => Some(volume.gpu_volume().coefficients((splatting.radius, splatting.falloff))?),
        };
        let numbers = coefficients.as_ref().map_or_else(|| volume.gpu_volume().numbers(), |exact| exact.numbers);
        let mut view = *seen;
        if let Some(perspective) = &mut view.perspective {
            // There is no plane at the eye.
            let slab = (perspective.eye.near / seen.slabs.width).floor();
            perspective.eye.near = if slab >= 1.0 { slab } else { 0.5 } * seen.slabs.width;
        }
        let bearing = Bearing::of(splatting.compositing);
        let needs = BrickNeeds { reach: planes.reach(seen), coefficients, bearing };
        Ok(Self { view, planes, numbers, needs, gradient: scene.shading.gradient })
    }
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
        (surfaces, first_hit, window): (Option<&Surfaces>, Option<f64>, Option<&Window>),
        rasterizer: Rasterizer,
    ) -> Result<Self, RenderError> {
        let splatting = scene.splatting;
        splatting.check()?;
        let (grid, size) = (volume.grid(), [scene.image.width, scene.image.height]);
        let seen = ViewGeometry::new(grid, camera, &splatting, size)?;
        let bands = CompositingBuffer::bands(&device.limits(), size)?;
        let is_cut = surfaces.is_some() || !scene.clip.is_empty() || window.is_some();
        let rays = RayMode { cut: is_cut, first_hit: first_hit.is_some() };
        let drawn = window.map_or_else(|| Window::whole(size), |window| window.opened(&seen.slabs_of(grid)));
        check_rays(device, &splatting, rays, first_hit, size)?;
        let surfaces = match surfaces {
            Some(surfaces) => Some((surfaces.depths(&seen, grid)?, surfaces.origin)),
            None => None,
        };
        let (kind, fallback) = RasterizerKind::of(device, &splatting, rasterizer)?;
        let is_after = splatting.classification == Classification::After;
        let after = is_after.then(|| After::new(volume, scene, &seen)).transpose()?;
        let ramps = match &after {
            None => Ramps::new(volume.transfer()),
            Some(after) => Ramps::with_integrals(volume.transfer(), splatting.compositing, &after.numbers),
        };
        Ok(Self {
            after,
            kind,
            fallback,
            subgroup_threads: device.adapter_info().subgroup_min_size,
            covered: means::covered(&seen, grid, &splatting),
            kernel: Kernel::new(splatting.radius, splatting.falloff),
            ramps,
            first_hit,
            window: drawn.with_lead(splatting.compositing, splatting.classification),
            view: seen,
            splatting,
            rays,
            surfaces,
            bands,
        })
    }

    /// The view that stages know, whose near plane is where they begin.
    pub(crate) fn stage_view(&self) -> &ViewGeometry {
        self.after.as_ref().map_or(&self.view, |after| &after.view)
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
