//! A kernel in any view, with or without an eye, in slabs or in slices: its splat record, its sections by the f64 evaluation, and the error
//! bounds of the stages that draw it.

use glam::{DVec2, DVec4, UVec3};
use sheetsplat::internals::footprint::{SECTION_SIZE, SECTIONS, section_extent, section_spacing};
use sheetsplat::internals::gpu::layout;
use sheetsplat::internals::reference::footprint::Ray;
use sheetsplat::internals::reference::{self, Section};
use sheetsplat::scene::Scene;
use sheetsplat::settings::{FootprintForm, Method};
use sheetsplat::volume::Grid;

use crate::common::{F32, Random, SPACINGS, random_eye, scene};
use crate::stages::section::{AMOUNT, AMOUNT_BA, AMOUNT_RG, KERNELS, Seen};

/// The error of the arctangent that rotates footprints to their axes: that of Mesa's polynomial.
const AXIS: f64 = 1.0 / (1 << 18) as f64;

/// A grid, and a view of it from any eye or, for slices, along any direction.
pub(crate) fn random_view(random: &mut Random, method: Method, form: FootprintForm) -> (Grid, Scene) {
    let grid = Grid::new(UVec3::new(9, 8, 11), random.pick(&SPACINGS).into());
    let mut scene = scene(70, 45);
    (scene.splatting.method, scene.splatting.footprint) = (method, form);
    (scene.splatting.radius, scene.splatting.falloff) = random.pick(&KERNELS);
    scene.splatting.slab_width = random.pick(&[0.3, 1.0, 3.7]);
    scene.camera.direction = random.direction();
    if method == Method::ImageAligned || !random.bits().is_multiple_of(3) {
        scene.camera = random_eye(random, &grid);
    }
    (grid, scene)
}

/// One kernel.
pub(crate) struct KernelInView<'a> {
    seen: &'a Seen,
    pub(crate) record: layout::Splat,
    twin: reference::Splat,
    /// The kernel's slice.
    pub(crate) slice: i32,
    ray: Ray,
}

impl<'a> KernelInView<'a> {
    /// A kernel near the screen, beyond the near plane. The f64 evaluation uses the record's f32 coordinates.
    pub(crate) fn random(seen: &'a Seen, random: &mut Random) -> Self {
        let Seen { geometry, view, .. } = seen;
        let [x_px, y_px] = [geometry.size.x, geometry.size.y].map(|side| random.uniform(-3.0, side + 3.0) as f32);
        let center = DVec2::new(x_px.into(), y_px.into());
        let eye = geometry.eye;
        let from_eye = eye.map_or(1.0, |eye| eye.near * 1.001 + 10.0_f64.powf(random.uniform(-1.0, 1.7))) as f32;
        let slice = random.uniform(-20.0, 20.0) as i32;
        let depth = match geometry.method {
            Method::ImageAligned => (f64::from(from_eye) + view.slabs.origin) as f32,
            Method::AxisAligned => slice as f32,
            Method::CompositeEverySample => 0.0,
            other => unreachable!("{other:?}"),
        };
        let r = eye.map_or(geometry.basis.w, |eye| {
            let slope = (center - geometry.size / 2.0) * eye.pixel_per_depth;
            (slope.x * geometry.basis.u - slope.y * geometry.basis.v + geometry.basis.w).normalize()
        });
        let ray = Ray::new(r, &geometry.basis, geometry.grid.aspect());
        // If sections have their own low-pass amplitudes, these are applied with them.
        let amplitude = if eye.is_some() { 1.0 } else { geometry.amplitude };
        let amount = AMOUNT * (amplitude / ray.lambda);
        Self {
            seen,
            record: layout::Splat { x_px, y_px, depth, from_eye, rg: AMOUNT_RG, ba: AMOUNT_BA },
            twin: reference::Splat { center, depth: from_eye.into(), amount, alpha: 1.0 },
            slice,
            ray,
        }
    }

    /// The sheets that it reaches.
    pub(crate) fn sheets(&self) -> std::ops::Range<i32> {
        match self.seen.geometry.method {
            Method::ImageAligned => self.seen.geometry.slabs(&self.twin, self.seen.kernel.radius()),
            Method::AxisAligned => self.slice..self.slice + 1,
            Method::CompositeEverySample => 0..1,
            other => unreachable!("{other:?}"),
        }
    }

    /// Its section in a sheet.
    pub(crate) fn section(&self, k: i32) -> Option<Section> {
        let Seen { geometry, kernel, .. } = self.seen;
        self.sheets().contains(&k).then(|| geometry.section(&self.twin, k, kernel)).flatten()
    }

    /// Whether the near plane cuts it.
    pub(crate) fn is_cut(&self) -> bool {
        let Seen { geometry, kernel, .. } = self.seen;
        let reach = kernel.radius() * self.ray.depth_per_warped;
        geometry.eye.is_some_and(|eye| self.twin.depth - reach < eye.near)
    }

    /// The positions of a slab's planes relative to the centre, without any cut; for slices, of the rim.
    fn planes(&self, k: i32) -> (f64, f64) {
        let Seen { geometry, kernel, .. } = self.seen;
        if geometry.method != Method::ImageAligned {
            return (-kernel.radius(), kernel.radius());
        }
        let at = |k: i32| (f64::from(k) * geometry.slab_width - self.twin.depth) / self.ray.depth_per_warped;
        (at(k), at(k + 1))
    }

    /// The f32 error of a slab's planes and of the near plane in grid units: coordinates and planes are rounded and subtracted, and the
    /// difference is multiplied by a length with four roundings.
    fn plane_error(&self, k: i32) -> f64 {
        let Seen { geometry, view, kernel, .. } = self.seen;
        let near = geometry.eye.map_or(0.0, |eye| eye.near + self.twin.depth);
        let slab = match geometry.method {
            Method::ImageAligned => {
                view.slabs.plane(k).abs() + f64::from(self.record.depth).abs() + 8.0 * view.slabs.width
            }
            // Whole kernels end before their planes.
            _ => 0.0,
        };
        4.0 * F32 * (near + slab) / self.ray.depth_per_warped + 8.0 * F32 * kernel.radius()
    }

    /// The maximum amount that f32 may draw into a sheet that the kernel does not reach, because planes are slightly displaced.
    pub(crate) fn rounding(&self, k: i32) -> f64 {
        let kernel = &self.seen.kernel;
        let whole = kernel.section(0.0, -kernel.radius(), kernel.radius());
        (F32 * whole + self.plane_error(k) * kernel.value(0.0)) * self.twin.amount.w
    }

    /// The section that the stage draws instead: the nearest stored one. `None` if f32 decides which one that is.
    pub(crate) fn stored(&self, section: Section, k: i32) -> Option<Section> {
        let Seen { view, kernel, .. } = self.seen;
        let (t0, t1) = self.planes(k);
        let (spacing, error) = (section_spacing(kernel, view.section_width()), self.plane_error(k));
        let middle = (t0 + t1) / 2.0;
        let layer = (middle.abs() / spacing).round();
        let is_sure = (middle.abs() / spacing - layer).abs() < 0.5 - error / spacing && section.t1 - section.t0 > error;
        let middle = layer * spacing * middle.signum();
        let half = if layer < f64::from(SECTIONS) { view.section_width() / 2.0 } else { 0.0 };
        is_sure.then_some(Section { t0: middle - half, t1: middle + half, ..section })
    }

    /// The error bound of a section drawn by the stage at a pixel, relative to the section's amount.
    fn tolerance(&self, section: &Section, k: i32, form: FootprintForm, pixel: DVec2) -> f64 {
        let Seen { geometry, kernel, .. } = self.seen;
        let (Section { t0, t1, .. }, radius) = (*section, kernel.radius());
        let offset = pixel - section.center;
        let rho = (section.footprint.from_pixels * offset).length();
        let plane_error = self.plane_error(k);
        let (pix, pix_error) = geometry.eye.map_or((geometry.pix, 0.0), |eye| {
            let middle = match geometry.method {
                Method::ImageAligned => (t0.max(-radius) + t1.min(radius)) / 2.0,
                _ => 0.0,
            };
            let depth = self.twin.depth + middle * self.ray.depth_per_warped;
            (eye.pix(depth), plane_error * self.ray.depth_per_warped / depth)
        });
        // An offset is at most as long in the warped grid as in the other; its cross product with the ray is accurate to some roundings. Along a
        // wrong axis it is off by a fraction of the larger of the two.
        let rho_error = (16.0 * F32 * pix + AXIS * pix.min(1.0)) * offset.length() + (pix_error + 4.0 * F32) * rho;
        let between = |rho: f64| kernel.section(rho.max(0.0).powi(2), t0, t1);
        let by = |error: f64| (between(rho - error) - between(rho)).max(between(rho) - between(rho + error));
        let whole = kernel.section(0.0, -radius, radius);
        // The errors of amounts, 1/λ, and the low-pass amplitude where it differs from 1.
        let factor_error = between(rho) * (16.0 + 32.0 * pix) * F32;
        match form {
            FootprintForm::SummedArea => {
                let nearest = if t0 * t1 < 0.0 { 0.0 } else { t0.abs().min(t1.abs()) - plane_error };
                let planes = F32 * whole + plane_error * kernel.value(nearest.max(0.0));
                // The bound of SPEC §4.
                1e-3 * between(0.0) + planes + by(rho_error) + factor_error
            }
            FootprintForm::Sections => {
                let texel = section_extent(kernel, t0, t1) / f64::from(SECTION_SIZE - 1);
                // A section falls off from its centre, so the values at a cell's corners lie between its values a diagonal away.
                by(2.0_f64.sqrt() * texel + rho_error) + 8.0 * F32 * whole + factor_error
            }
        }
    }

    /// Calls `blend` with the section's amount and its error bound at every pixel.
    pub(crate) fn draw(&self, section: &Section, k: i32, mut blend: impl FnMut(usize, DVec4, f64)) {
        let form = self.seen.scene.splatting.footprint;
        let Seen { geometry, kernel, .. } = self.seen;
        let width = geometry.size.x as usize;
        for at in 0..width * geometry.size.y as usize {
            let pixel = DVec2::new((at % width) as f64, (at / width) as f64) + 0.5;
            let rho_squared = (section.footprint.from_pixels * (pixel - section.center)).length_squared();
            let amount = kernel.section(rho_squared, section.t0, section.t1) * section.amount;
            blend(at, amount, self.tolerance(section, k, form, pixel) * section.amount.w);
        }
    }
}
