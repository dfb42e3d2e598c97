//! Kernel sections by the f64 evaluation, and the error bounds of the stages that draw them.

use std::ops::Range;

use glam::{DVec2, DVec3, DVec4};
use sheetsplat::internals::kernel::Kernel;
use sheetsplat::internals::reference::{self, Geometry};
use sheetsplat::internals::view_geometry::ViewGeometry;
use sheetsplat::scene::Scene;
use sheetsplat::settings::FootprintForm;
use sheetsplat::volume::Grid;

use crate::common::compare::{apart, assert_at_most};
use crate::common::{F32, camera, scene};

/// `(C·m, m)` of the splats that are drawn.
pub(crate) const AMOUNT: DVec4 = DVec4::new(1.0, 0.5, 0.25, 1.0);
/// The same as f16, as in a record, which the drawing stages multiply by the amplitude divided by λ.
pub(crate) const AMOUNT_RG: u32 = 0x3800_3c00;
/// See [`AMOUNT_RG`].
pub(crate) const AMOUNT_BA: u32 = 0x3c00_3400;

/// Radii and falloffs.
pub(crate) const KERNELS: [(f64, f64); 9] =
    [(2.0, 2.0), (1.4, 2.0), (1.0, 2.0), (4.0, 2.0), (1.0, 0.1), (4.0, 0.1), (3.0, 0.5), (2.0, 16.0), (4.0, 16.0)];

/// Direction, spacing, and `unit`s per pixel: head-on and oblique, with sheared footprints, magnified, minified, and minified along only
/// one singular direction.
pub(crate) const VIEWS: [([f64; 3], [f64; 3], f64); 8] = [
    ([0.0, 1.0, 0.0], [1.0, 1.0, 1.0], 0.25),
    ([0.3, 0.9, -0.2], [1.0, 1.0, 1.0], 0.6),
    ([0.6, 0.5, 0.6], [1.0, 1.0, 5.0], 0.4),
    ([0.6, 0.5, 0.6], [3.2, 3.2, 1.5], 0.1),
    ([-0.7, 0.2, 0.4], [1.0, 1.0, 2.0], 0.03),
    ([0.6, 0.5, 0.6], [1.0, 1.0, 5.0], 2.0),
    ([0.0, 1.0, 0.1], [1.0, 1.0, 1.0], 7.0),
    ([0.2, 0.1, 0.9], [1.0, 3.0, 1.0], 30.0),
];

/// The view with slabs of `width` in the warped grid, in which the footprint tables are defined.
pub(crate) fn view_scene(
    view: ([f64; 3], [f64; 3], f64),
    kernel: (f64, f64),
    width: f64,
    form: FootprintForm,
) -> Scene {
    let (direction, spacing, units_per_pixel) = view;
    let mut scene = scene(70, 45);
    let unit = spacing.into_iter().fold(f64::INFINITY, f64::min);
    scene.camera = camera(direction, units_per_pixel * unit * 45.0);
    (scene.splatting.radius, scene.splatting.falloff) = kernel;
    scene.splatting.footprint = form;
    let warped = scene.camera.basis().w / (DVec3::from(spacing) / unit);
    scene.splatting.slab_width = width / warped.length();
    scene
}

/// One view of one kernel.
#[derive(Debug)]
pub(crate) struct Seen {
    pub(crate) scene: Scene,
    pub(crate) kernel: Kernel,
    pub(crate) view: ViewGeometry,
    pub(crate) geometry: Geometry,
}

impl Seen {
    pub(crate) fn new(grid: &Grid, scene: Scene) -> Self {
        let size = [scene.image.width, scene.image.height];
        Self {
            kernel: Kernel::new(scene.splatting.radius, scene.splatting.falloff),
            view: ViewGeometry::new(grid, &scene.camera, &scene.splatting, size).unwrap(),
            geometry: Geometry::new(grid, &scene).unwrap(),
            scene,
        }
    }

    /// The f64 sheet buffer of one slab.
    pub(crate) fn twin(&self, splats: &[reference::Splat], slab: i32) -> Vec<DVec4> {
        reference::splat::sheet(splats, slab, &self.geometry, &self.kernel).pixels
    }

    /// The slabs that a splat's kernel overlaps.
    pub(crate) fn touched(&self, splat: &reference::Splat) -> Range<i32> {
        self.view.slabs.touched(splat.depth - self.kernel.radius(), splat.depth + self.kernel.radius())
    }

    /// The low-pass amplitude divided by λ.
    pub(crate) fn amplitude(&self) -> f64 {
        self.geometry.amplitude / self.geometry.lambda
    }

    /// The depths of a slab's planes relative to a splat.
    pub(crate) fn planes(&self, splat: &reference::Splat, slab: i32) -> (f64, f64) {
        let t0 = f64::from(slab) * self.view.slabs.width - splat.depth;
        (t0, t0 + self.view.slabs.width)
    }

    /// The peak of the whole footprint, per unit of a splat's amount.
    pub(crate) fn whole(&self) -> f64 {
        self.kernel.section(0.0, -self.kernel.radius(), self.kernel.radius())
    }

    /// The error bound of the summed-area form in a section (SPEC §4): a thousandth of its peak, but no less than the precision of an f32
    /// that also holds whole footprints. In addition the slab's planes and the splat's depth are rounded to f32, which contributes in
    /// proportion to the kernel's value there. Planes are counted from that of slab `first`.
    pub(crate) fn summed_area_tolerance(&self, splat: &reference::Splat, first: i32, k: i32) -> f64 {
        let (t0, t1) = self.planes(splat, k);
        let plane_error = self.plane_error(splat, first, k);
        let nearest = if t0 * t1 < 0.0 { 0.0 } else { t0.abs().min(t1.abs()) - plane_error };
        1e-3 * self.kernel.section(0.0, t0, t1) + F32 * self.whole() + plane_error * self.kernel.value(nearest.max(0.0))
    }

    /// The f32 error of a slab's planes relative to a splat: the group's first plane, the slab's width and its multiple are rounded, and so
    /// are their sums and differences from the depth, none of which exceeds these numbers.
    fn plane_error(&self, splat: &reference::Splat, first: i32, k: i32) -> f64 {
        let width = self.view.slabs.width;
        let plane = f64::from(first).abs() * width;
        4.0 * F32 * (plane.max((f64::from(first) * width - splat.depth).abs()) + f64::from(k - first + 1) * width)
    }

    /// The distance of a pixel's centre from a splat, in footprint coordinates.
    pub(crate) fn rho(&self, splat: &reference::Splat, pixel: usize) -> f64 {
        let width = self.scene.image.width as usize;
        let center = DVec2::new((pixel % width) as f64, (pixel / width) as f64) + 0.5;
        (self.geometry.footprint_from_pixels * (center - splat.center)).length()
    }

    /// `tolerance` is for a kernel of amount 1, before the amplitude.
    #[track_caller]
    pub(crate) fn assert_close(
        &self,
        sheet: &[DVec4],
        expected: &[DVec4],
        tolerance: impl Fn(usize) -> f64,
        what: &str,
    ) {
        assert_eq!(sheet.len(), expected.len());
        for (pixel, (actual, expected)) in sheet.iter().zip(expected).enumerate() {
            let error = apart(*actual, *expected) / self.amplitude();
            let (Self { kernel, view, .. }, tolerance) = (self, tolerance(pixel));
            let what = format_args!("{what}, {kernel:?}, {view:?}, pixel {pixel}: {actual}, not {expected}");
            assert_at_most(error, tolerance, what);
        }
    }
}
