//! The geometry of SPEC §§2 and 5 as written: pixel coordinates, depths, slabs and slices, and kernel sections.

use std::ops::Range;

use glam::{DMat2, DVec2, DVec3, UVec3};

use super::footprint::{Footprint, Ray};
use super::{Section, Splat};
use crate::error::RenderError;
use crate::error::setting::{SettingError, scaled};
use crate::geometry::slab::SlabGrid;
use crate::kernel::Kernel;
use crate::scene::Scene;
use crate::settings::camera::{Camera, Eye, ViewBasis};
use crate::settings::clip::HalfSpace;
use crate::settings::economies::Economies;
use crate::settings::splatting::Method;
use crate::volume::Grid;

/// The maximum image size in pixels along a side, as on the largest GPUs.
const MAX_SIZE: u32 = 32768;

/// A view of a grid.
///
/// Orthographic rays are parallel. In perspective `pix`, `ro`, `lambda`, `footprint_from_pixels` and `amplitude` belong to the central ray
/// at the camera's `center`, and every voxel and section has its own: [`Geometry::section`].
#[derive(Clone, Debug)]
pub struct Geometry {
    /// The viewing coordinate system.
    pub basis: ViewBasis,
    /// The image size in pixels.
    pub size: DVec2,
    /// The grid.
    pub grid: Grid,
    /// The world point at the image's centre, in `unit`s.
    pub center: DVec3,
    /// The eye; `None` for an orthographic view.
    pub eye: Option<Eye>,
    /// The method, which decides which part of a kernel goes into which sheet.
    pub method: Method,
    /// The size of a pixel in `unit`s.
    pub pix: f64,
    /// `ro = rw/λ`; orthographic, it is also the slab normal `wo`.
    pub ro: DVec3,
    /// `λ = |rw|`.
    pub lambda: f64,
    /// The economies (§8), except `beta`, which depends on what was drawn before.
    pub economies: Economies,
    /// The slab width in the units of [`Geometry::depth`]: orthographic `Δ·λw`, perspective Δ.
    pub slab_width: f64,
    /// Maps a pixel offset to footprint coordinates, after the low-pass rule.
    pub footprint_from_pixels: DMat2,
    /// The low-pass rule's amplitude.
    pub amplitude: f64,
    /// The half spaces that clip planes keep.
    pub clip: Vec<HalfSpace>,
    /// The kernel's radius in grid units.
    pub radius: f64,
}

impl Geometry {
    /// # Errors
    /// If the scene needs more than can be computed.
    pub fn new(grid: &Grid, scene: &Scene) -> Result<Self, RenderError> {
        let (width, height) = (scene.image.width, scene.image.height);
        for (key, found) in [("image.width", width), ("image.height", height)] {
            if found > MAX_SIZE {
                return Err(SettingError::new(key, f64::from(found), format!("at most {MAX_SIZE}")).into());
            }
        }
        scene.check()?;
        grid.check()?;
        let (camera, splatting) = (&scene.camera, &scene.splatting);
        let (basis, aspect) = (camera.basis(), grid.aspect());
        let eye = camera.eye(grid, splatting.radius, height)?;
        let pix = match (&eye, camera.orthographic_height(grid, splatting.radius, width, height)) {
            (None, Some(height_world)) => Camera::pixel_size(height_world, grid, height)?,
            (eye, _) => eye.map_or(1.0, |eye| eye.pix(eye.distance)),
        };
        let ray = Ray::new(basis.w, &basis, aspect);
        let footprint = ray.footprint(pix);
        let geometry = Self {
            basis,
            size: DVec2::new(f64::from(width), f64::from(height)),
            grid: *grid,
            center: camera.middle_from(grid) / grid.unit(),
            eye,
            method: splatting.method,
            economies: splatting.experimental,
            pix,
            ro: ray.ro,
            lambda: ray.lambda,
            slab_width: if eye.is_some() { splatting.slab_width } else { splatting.slab_width * ray.lambda },
            footprint_from_pixels: footprint.from_pixels,
            amplitude: footprint.amplitude,
            clip: scene.clip.half_spaces(grid),
            radius: splatting.radius,
        };
        if splatting.method == Method::ImageAligned {
            geometry.check_slabs(splatting.radius, splatting.slab_width)?;
        }
        Ok(geometry)
    }

    /// The geometry of a scene's light sheets towards the unit vector `to_light` (SPEC §14).
    ///
    /// # Errors
    /// If there are too many slabs.
    pub fn of_light(grid: &Grid, scene: &Scene, to_light: DVec3) -> Result<Self, RenderError> {
        let (splatting, step) = (&scene.splatting, scene.shading.light_step);
        let up = scaled(scene.camera.up).normalize();
        // The first of the axes that are least along the light.
        let along = |axis: &DVec3| axis.dot(to_light).abs();
        let least = DVec3::AXES.into_iter().min_by(|a, b| along(a).total_cmp(&along(b)));
        let up = least.filter(|_| up.cross(to_light).length() < 0.1).unwrap_or(up);
        let camera = Camera { direction: -to_light, up, center: None, ..Camera::default() };
        let (basis, aspect) = (camera.basis(), grid.aspect());
        let ray = Ray::new(basis.w, &basis, aspect);
        let footprint = ray.footprint(step);
        let side = 2.0 * (grid.bounding_radius(splatting.radius) / grid.unit() / step).ceil() + 1.0;
        let geometry = Self {
            basis,
            size: DVec2::splat(side),
            grid: *grid,
            center: camera.middle_from(grid) / grid.unit(),
            eye: None,
            method: Method::ImageAligned,
            economies: Economies::default(),
            pix: step,
            ro: ray.ro,
            lambda: ray.lambda,
            slab_width: step * ray.lambda,
            footprint_from_pixels: footprint.from_pixels,
            amplitude: footprint.amplitude,
            clip: Vec::new(),
            radius: splatting.radius,
        };
        geometry.check_slabs(splatting.radius, step)?;
        Ok(geometry)
    }

    /// Checks that the number of slabs and their indices are in range.
    fn check_slabs(&self, radius: f64, slab_width: f64) -> Result<(), RenderError> {
        let origin = 0.0;
        let Some(eye) = self.eye else {
            let slabs = SlabGrid { origin, width: self.slab_width };
            return slabs.check(self.ro.abs().dot(self.grid.center()) + radius, slab_width);
        };
        let half_extents = self.grid.center() * self.grid.aspect();
        // A kernel reaches `radius·(r·w)/λ` units of depth from its voxel. This is the maximum.
        let reach = radius * (self.basis.w * self.grid.aspect()).length();
        SlabGrid { origin, width: slab_width }.check(self.basis.w.abs().dot(half_extents) + reach, slab_width)?;
        eye.check_slabs(&self.grid, slab_width)
    }

    /// A voxel's position relative to the eye (orthographic: to the world point at the image's centre), in `unit`s.
    fn position(&self, voxel: UVec3) -> DVec3 {
        self.grid.world_position(voxel) / self.grid.unit() - self.eye.map_or(self.center, |eye| eye.position)
    }

    /// Whether a voxel's depth, not its distance, is beyond the near plane (SPEC §2). Every voxel that takes part then lies in front of the
    /// eye, `r·w > 0`, even if it is far to the side.
    pub fn is_beyond_near(&self, voxel: UVec3) -> bool {
        self.eye.is_none_or(|eye| self.position(voxel).dot(self.basis.w) > eye.near)
    }

    /// Whether a voxel's kernel, a ball in the warped grid, reaches inside every clip plane taken by itself.
    pub fn is_inside(&self, voxel: UVec3) -> bool {
        let (p, aspect) = (self.grid.world_position(voxel) / self.grid.unit(), self.grid.aspect());
        let reaches = |HalfSpace { normal, offset }: &HalfSpace| {
            (normal.dot(p) + offset) / (*normal * aspect).length() + self.radius >= 0.0
        };
        self.clip.iter().all(reaches)
    }

    /// Whether a voxel's cell, half a voxel around its centre, meets one of the first few clip planes, or a face of the crop box that the others bound (SPEC §3).
    pub fn is_cut(&self, voxel: UVec3, planes: usize) -> bool {
        let (p, half) = (self.grid.world_position(voxel) / self.grid.unit(), self.grid.aspect() / 2.0);
        // The least and the greatest distance from a plane within the cell; the slack is for cells that end at it.
        let ends = |HalfSpace { normal, offset }: &HalfSpace| {
            let (middle, spread) = (normal.dot(p) + offset, normal.abs().dot(half) * (1.0 + 2e-9));
            [middle - spread, middle + spread]
        };
        let meets = |half_space: &HalfSpace| ends(half_space)[0] <= 0.0 && ends(half_space)[1] >= 0.0;
        let (planes, faces) = self.clip.split_at(planes);
        planes.iter().any(meets) || faces.iter().any(meets) && faces.iter().all(|face| ends(face)[1] >= 0.0)
    }

    /// The local ray at a voxel, a unit vector: `w`, or in perspective `normalize(p - e)`.
    pub fn ray(&self, voxel: UVec3) -> DVec3 {
        if self.eye.is_some() { self.position(voxel).normalize() } else { self.basis.w }
    }

    /// Half the width and height in pixels of the screen box around a footprint of the given radius (grid units).
    pub fn half_box(&self, radius: f64) -> DVec2 {
        self.footprint().half_box(radius)
    }

    fn footprint(&self) -> Footprint {
        Footprint { from_pixels: self.footprint_from_pixels, amplitude: self.amplitude }
    }

    /// The pixel coordinates of a voxel beyond the near plane.
    pub fn pixel(&self, voxel: UVec3) -> DVec2 {
        let p = self.position(voxel);
        let pix = self.eye.map_or(self.pix, |eye| eye.pix(p.dot(self.basis.w)));
        DVec2::new(self.size.x / 2.0 + self.basis.u.dot(p) / pix, self.size.y / 2.0 - self.basis.v.dot(p) / pix)
    }

    /// A voxel's depth in the units of slabs: orthographic in the warped grid, from the world's origin; perspective in `unit`s along w, from
    /// the eye.
    pub fn depth(&self, voxel: UVec3) -> f64 {
        if self.eye.is_some() {
            return self.position(voxel).dot(self.basis.w);
        }
        self.orthographic_depth(self.grid.world_position(voxel) / self.grid.unit())
    }

    /// The depth, in the units of slabs, of a position in `unit`s from the grid's centre in an orthographic view.
    pub fn orthographic_depth(&self, position: DVec3) -> f64 {
        ((position + self.grid.place() / self.grid.unit()) / self.grid.aspect()).dot(self.ro)
    }

    /// A voxel's depth along w in the unwarped space, in `unit`s, by which voxels composited one by one are sorted.
    pub fn depth_along_w(&self, voxel: UVec3) -> f64 {
        self.position(voxel).dot(self.basis.w)
    }

    /// The slice of a voxel along the axis with the largest |w| component (§3.1; ties: x, then y, then z), counted along w.
    ///
    /// In perspective this one order serves the whole image. It is wrong for a ray that runs against w along that axis, which only rays more
    /// than asin |w_axis|, so at least 35.3°, from the image's centre can do.
    pub fn slice(&self, voxel: UVec3) -> i32 {
        let (axis, sign) = self.slice_axis();
        sign as i32 * voxel[axis] as i32
    }

    /// The axis of slices, and whether they are counted up (1) or down (-1) along it.
    pub fn slice_axis(&self) -> (usize, f64) {
        let w = self.basis.w.abs();
        let axis = if w.x >= w.y && w.x >= w.z {
            0
        } else if w.y >= w.z {
            1
        } else {
            2
        };
        (axis, if self.basis.w[axis] < 0.0 { -1.0 } else { 1.0 })
    }

    /// The factor for a voxel's `(C·m, m)`: `1/λ`, times the low-pass amplitude where that is the same for all sections.
    pub fn scale(&self, voxel: UVec3) -> f64 {
        if self.eye.is_some() {
            (self.ray(voxel) / self.grid.aspect()).length().recip()
        } else {
            self.amplitude / self.lambda
        }
    }

    /// The local ray of a splat in perspective, from its position on the screen.
    fn local(&self, splat: &Splat, eye: &Eye) -> Ray {
        let offset = (splat.center - self.size / 2.0) * eye.pix(splat.depth);
        let p = offset.x * self.basis.u - offset.y * self.basis.v + splat.depth * self.basis.w;
        Ray::new(p.normalize(), &self.basis, self.grid.aspect())
    }

    /// Whether a voxel is projected as a whole kernel because of its low opacity (§8).
    fn is_whole(&self, splat: &Splat) -> bool {
        splat.alpha < self.economies.whole_below
    }

    /// The slabs that a kernel is drawn into: those that it overlaps, or the one that contains its centre.
    pub fn drawn_slabs(&self, splat: &Splat, radius: f64) -> Range<i32> {
        let slabs = self.slabs(splat, radius);
        if !self.is_whole(splat) || slabs.is_empty() {
            return slabs;
        }
        let slab = ((splat.depth / self.slab_width).floor() as i32).clamp(slabs.start, slabs.end - 1);
        slab..slab + 1
    }

    /// The slabs that a kernel overlaps by more than rounding errors, without the part nearer than the near plane.
    pub fn slabs(&self, splat: &Splat, radius: f64) -> Range<i32> {
        const ROUNDING: f64 = 1e-9;
        let (first, end) = match &self.eye {
            None => (splat.depth - radius, splat.depth + radius),
            Some(eye) => {
                let reach = radius * self.local(splat, eye).depth_per_warped;
                ((splat.depth - reach).max(eye.near), splat.depth + reach)
            }
        };
        let first = (first / self.slab_width + ROUNDING).floor() as i32;
        first..(end / self.slab_width - ROUNDING).ceil() as i32
    }

    /// The part of a splat in a sheet: between the planes of slab `sheet`, or the whole kernel if sheets are slices, without anything nearer
    /// than the near plane. `None` if it is empty.
    ///
    /// In perspective (§3.3.2, end of §4.2):
    ///
    /// - The near plane cuts first, and then the middle of the rest is taken. So a section's mid depth is never nearer than `near`, and `pix`
    ///   there is positive, however far off the axis the voxel or however wide the view.
    /// - Planes cut the kernel perpendicular to its own ray, where that ray meets them: `t` grows by `λ/(r·w)` per `unit` of depth. For a
    ///   voxel far off the axis a slab is thick, and the whole kernel lies in one or two.
    /// - All of a kernel is projected along its voxel's ray, which is accurate while the kernel is small compared with its distance from the
    ///   eye. It is not for voxels beside the eye that are nearer in depth than the kernel's reach in the image plane: their footprints cover
    ///   the whole screen, whatever lies between. A near plane at a kernel's radius excludes such voxels.
    /// - Axis-aligned sheets contain the whole kernel, with `pix` at the voxel's depth; the near plane cuts it too.
    pub fn section(&self, splat: &Splat, sheet: i32, kernel: &Kernel) -> Option<Section> {
        let (near, far) = match self.method {
            Method::ImageAligned if !self.is_whole(splat) => {
                (f64::from(sheet) * self.slab_width, (f64::from(sheet) + 1.0) * self.slab_width)
            }
            _ => (f64::NEG_INFINITY, f64::INFINITY),
        };
        let whole = kernel.section(0.0, -kernel.radius(), kernel.radius());
        let section = |footprint: Footprint, t0: f64, t1: f64, amplitude: f64| {
            let amount = splat.amount * amplitude;
            let rim = (amount.w * whole / self.economies.resolution).ln() / kernel.falloff();
            Some(Section { center: splat.center, footprint, t0, t1, amount, rim })
        };
        let Some(eye) = &self.eye else {
            return section(self.footprint(), near - splat.depth, far - splat.depth, 1.0);
        };
        let ray = self.local(splat, eye);
        let at = |depth: f64| (depth - splat.depth) / ray.depth_per_warped;
        let (t0, t1) = (at(near.max(eye.near)), at(far));
        let (first, last) = (t0.max(-kernel.radius()), t1.min(kernel.radius()));
        if first >= last {
            return None;
        }
        let middle = match self.method {
            Method::ImageAligned if !self.is_whole(splat) => (first + last) / 2.0,
            _ => 0.0,
        };
        let footprint = ray.footprint(eye.pix(splat.depth + middle * ray.depth_per_warped));
        section(footprint, t0, t1, footprint.amplitude)
    }
}
