//! A frame request: everything about a frame that is known, and can be refused, before anything is allocated.

use std::ops::Range;

use wgpu::Device;

use super::kind::{RasterizerKind, check_hits};
use crate::after::brick_ranges::Bearing;
use crate::after::normalization::Normalization;
use crate::error::RenderError;
use crate::geometry::means;
use crate::geometry::plane_geometry::PlaneGeometry;
use crate::geometry::surfaces::SurfaceDepths;
use crate::geometry::view_geometry::ViewGeometry;
use crate::gpu::classified_volume::{ClassifiedVolume, Layer};
use crate::gpu::hiding::Hiding;
use crate::gpu::layout::{Band, FieldPlanes};
use crate::gpu::ramps::{Integration, Ramps, Stored};
use crate::gpu::shaders::Lanes;
use crate::gpu::shown_bricks::BrickNeeds;
use crate::gpu::targets::CompositingBuffer;
use crate::gpu::uniforms;
use crate::gpu::volume_texture::ValueFormat;
use crate::image::channels::Joining;
use crate::kernel::Kernel;
use crate::lists::patch_bins::SHEETS;
use crate::pass::composite::RayMode;
use crate::pass::gather::most_workgroup_bytes;
use crate::pass::lanes::{lanes, least_lanes};
use crate::scene::Scene;
use crate::settings::camera::Camera;
use crate::settings::shading::Gradient;
use crate::settings::splatting::{Classification, Rasterizer, Splatting};
use crate::settings::window::Window;

/// A frame of a view, in the channels that share sheets (SPEC §10).
#[derive(Debug)]
pub(crate) struct FrameRequest {
    /// The channels.
    pub(crate) layer: Layer,
    /// Where their labels and colours are.
    pub(crate) stored: Vec<Stored>,
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
    /// What ends rays, and the texel of the image's first pixel.
    pub(crate) surfaces: Option<(SurfaceDepths, [u32; 2])>,
    pub(crate) kind: RasterizerKind,
    /// Why the device does not draw by tiles.
    pub(crate) fallback: Option<RenderError>,
    /// The threads that draw a patch by tiles, and their least number.
    pub(crate) lanes: Lanes,
    pub(crate) least_lanes: u32,
    /// The bytes of workgroup memory that tiles may use.
    pub(crate) workgroup_bytes: u32,
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
    /// What the values of each of the request's channels are splatted as.
    pub(crate) numbers: Vec<Normalization>,
    pub(crate) needs: BrickNeeds,
    pub(crate) gradient: Gradient,
}

impl After {
    fn new(
        (volume, layer): (&ClassifiedVolume, &Layer),
        scene: &Scene,
        seen: &ViewGeometry,
    ) -> Result<Self, RenderError> {
        let splatting = &scene.splatting;
        let planes = PlaneGeometry::new(seen, volume.grid());
        let coefficients = match splatting.is_exact() {
            false => None,
            true => Some(volume.gpu_volume().coefficients((splatting.radius, splatting.falloff))?),
        };
        let numbers = coefficients.as_ref().map_or_else(|| volume.gpu_volume().numbers(), |exact| &exact.numbers);
        let numbers = numbers[layer.channels.clone()].to_vec();
        let mut view = *seen;
        if let Some(perspective) = &mut view.perspective {
            // There is no plane at the eye.
            let slab = (perspective.eye.near / seen.slabs.width).floor();
            perspective.eye.near = if slab >= 1.0 { slab } else { 0.5 } * seen.slabs.width;
        }
        let bearing = Bearing::of(splatting.compositing);
        let reach = planes.reach(seen).sharing(layer.channels.len());
        let needs = BrickNeeds { reach, coefficients, bearing };
        Ok(Self { view, planes, numbers, needs, gradient: scene.shading.gradient })
    }
}

impl FrameRequest {
    /// Makes the request for one of a volume's layers, whose images are joined if there are several. The camera is the scene's with all values that depend
    /// on an object filled in.
    ///
    /// # Errors
    /// If the scene needs something that is not implemented or that exceeds the device's limits.
    pub(crate) fn new(
        device: &Device,
        (volume, layer, joining): (&ClassifiedVolume, &Layer, Option<Joining>),
        (scene, camera): (&Scene, &Camera),
        (hiding, first_hit, window): (Option<&Hiding>, Option<f64>, Option<&Window>),
        rasterizer: Rasterizer,
    ) -> Result<Self, RenderError> {
        let splatting = scene.splatting;
        let (grid, size) = (volume.grid(), [scene.image.width, scene.image.height]);
        let seen = ViewGeometry::new(grid, camera, &splatting, size)?;
        let stored = volume.stored(layer);
        let is_after = splatting.classification == Classification::After;
        let of_pixel = |stored: &[Stored]| records(stored) + sheet_records(stored, &splatting);
        let records = if is_after { of_pixel(&volume.gpu_volume().stored()) } else { 1 };
        let bands = CompositingBuffer::bands_for(&device.limits(), size, records)?;
        let is_cut = hiding.is_some() || !scene.clip.is_empty() || window.is_some();
        let rays = RayMode { cut: is_cut, first_hit: first_hit.is_some() };
        let drawn = window.map_or_else(|| Window::whole(size), |window| window.opened(&seen.slabs_of(grid)));
        splatting.check_rays(rays.cut, first_hit)?;
        let first_hit = joining.map_or(first_hit, |joining| joining.first_hit(first_hit));
        let rays = RayMode { first_hit: first_hit.is_some(), ..rays };
        check_hits(device, rays, size)?;
        let surfaces = hiding.map(|hiding| hiding.depths(&seen, grid)).transpose()?;
        let (kind, fallback) = RasterizerKind::of(device, &splatting, stored.len(), rasterizer)?;
        let after = is_after.then(|| After::new((volume, layer), scene, &seen)).transpose()?;
        let integration = after.as_ref().map(|after| Integration { splatting: &splatting, numbers: &after.numbers });
        let first_channel = layer.channels.start;
        let transfer = &volume.transfer()[first_channel..];
        let ramps = Ramps::of_channels(transfer, &stored, first_channel as u32, integration);
        Ok(Self {
            layer: layer.clone(),
            stored,
            after,
            kind,
            fallback,
            lanes: lanes(device),
            least_lanes: least_lanes(device),
            workgroup_bytes: most_workgroup_bytes(device),
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

    /// What one of the request's channels is drawn onto slab planes by, given by its number among them, in a volume whose values are stored in a
    /// format.
    pub(crate) fn planes(&self, after: &After, channel: usize, format: ValueFormat) -> FieldPlanes {
        let planes = uniforms::planes(&after.planes, self.stage_view(), format, &after.numbers[channel]);
        FieldPlanes { channel: channel as u32, colors: self.stored[channel].colors, ..planes }
    }

    /// The number of the request's channels with colours of voxels' own.
    pub(crate) fn colored(&self) -> u32 {
        colored(&self.stored)
    }

    /// The records that every pixel carries from plane to plane.
    pub(crate) fn records(&self) -> u32 {
        records(&self.stored)
    }

    /// The records of a pixel's sheets that tiles add up over channels.
    pub(crate) fn sheet_records(&self) -> u32 {
        sheet_records(&self.stored, &self.splatting)
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

/// The number of channels with colours of voxels' own.
fn colored(stored: &[Stored]) -> u32 {
    stored.iter().filter(|stored| stored.colors > 0).count() as u32
}

/// The records that every pixel carries from plane to plane: one for each channel, and one for each with colours.
fn records(stored: &[Stored]) -> u32 {
    stored.len() as u32 + colored(stored)
}

/// The records of a pixel's sheets that tiles add up over channels, if there are several: one for each segment of a slab of a sheet group but the first.
fn sheet_records(stored: &[Stored], splatting: &Splatting) -> u32 {
    if stored.len() > 1 { splatting.segments() * SHEETS - 1 } else { 0 }
}
