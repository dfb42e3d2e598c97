//! SPEC §§2 and 5 as written: pixel coordinates, slabs, and the footprint coordinates of a pixel offset.

use glam::{DMat2, DVec2, DVec3, UVec3};

use crate::camera::{Camera, ViewBasis};
use crate::error::RenderError;
use crate::scene::Scene;
use crate::slab::SlabGrid;
use crate::splatting::Method;
use crate::volume::Grid;

/// The largest image, pixels along a side: what the largest GPUs allow.
const MAX_SIZE: u32 = 32768;

/// An orthographic view of a grid.
#[derive(Clone, Copy, Debug)]
pub struct Geometry {
    /// The viewing coordinate system.
    pub basis: ViewBasis,
    /// Image size, pixels.
    pub size: DVec2,
    /// The grid.
    pub grid: Grid,
    /// World point at the image's centre, `unit`s.
    pub center: DVec3,
    /// `unit`s per pixel.
    pub pix: f64,
    /// `ro = rw/λ`, also the slab normal `wo`.
    pub ro: DVec3,
    /// `λ = |rw|`.
    pub lambda: f64,
    /// Slab width in the warped space, `Δ·λw`.
    pub slab_width: f64,
    /// Pixel offset → footprint coordinates, after the low-pass rule.
    pub footprint_from_pixels: DMat2,
    /// The low-pass rule's amplitude.
    pub amplitude: f64,
}

impl Geometry {
    /// # Errors
    /// If the scene asks for something that is not implemented yet, or for more than can be computed.
    pub fn new(grid: &Grid, scene: &Scene) -> Result<Self, RenderError> {
        let (width, height) = (scene.image.width, scene.image.height);
        for (key, found) in [("image.width", width), ("image.height", height)] {
            if found > MAX_SIZE {
                let (found, allowed) = (found.to_string(), format!("at most {MAX_SIZE}"));
                return Err(RenderError::OutOfRange { key, found, allowed });
            }
        }
        let splatting = &scene.splatting;
        let Some(height_world) = scene.camera.orthographic_height(grid, scene.splatting.radius, width, height) else {
            return Err(RenderError::unsupported("camera.projection", "\"perspective\"", "\"orthographic\""));
        };
        if scene.splatting.method == Method::AxisAligned {
            return Err(RenderError::unsupported("splatting.method", "\"axis-aligned\"", "\"image-aligned\""));
        }
        let basis = scene.camera.basis();
        let pix = Camera::pixel_size(height_world, grid, height)?;
        let rw = basis.w / grid.aspect();
        let (ro, lambda) = (rw.normalize(), rw.length());
        SlabGrid { width: splatting.slab_width * lambda, radius: splatting.radius }
            .check(ro.abs().dot(grid.center()), splatting.slab_width)?;

        // Any orthonormal basis of the plane ⟂ ro will do: the kernel is symmetric.
        let a = ro.any_orthonormal_vector();
        let b = ro.cross(a);
        let column = |q: DVec3| {
            let warped = q * pix / grid.aspect();
            DVec2::new(warped.dot(a), warped.dot(b))
        };
        let footprint_from_pixels = DMat2::from_cols(column(basis.u), column(-basis.v));
        let (pixels_from_footprint, amplitude) = low_pass(footprint_from_pixels.inverse());
        Ok(Self {
            basis,
            size: DVec2::new(f64::from(width), f64::from(height)),
            grid: *grid,
            center: scene.camera.center / grid.unit(),
            pix,
            ro,
            lambda,
            slab_width: scene.splatting.slab_width * lambda,
            footprint_from_pixels: pixels_from_footprint.inverse(),
            amplitude,
        })
    }

    /// Half the width and height, in pixels, of the screen box around a footprint of the given radius (grid units).
    pub fn half_box(&self, radius: f64) -> DVec2 {
        let pixels_from_footprint = self.footprint_from_pixels.inverse();
        radius * DVec2::new(pixels_from_footprint.row(0).length(), pixels_from_footprint.row(1).length())
    }

    /// Pixel offset → footprint coordinates whose first axis is the screen's (eqs. 9, 10): the square around a footprint in these
    /// coordinates is a parallelogram on the screen, with two sides along the pixel rows (Fig. 13).
    pub fn sheared_footprint_from_pixels(&self) -> DMat2 {
        let along_rows = self.footprint_from_pixels.x_axis;
        DMat2::from_angle(-along_rows.to_angle()) * self.footprint_from_pixels
    }

    /// Pixel coordinates of a voxel.
    pub fn pixel(&self, voxel: UVec3) -> DVec2 {
        let p = self.grid.world_position(voxel) / self.grid.unit() - self.center;
        DVec2::new(
            self.size.x / 2.0 + self.basis.u.dot(p) / self.pix,
            self.size.y / 2.0 - self.basis.v.dot(p) / self.pix,
        )
    }

    /// Warped depth of a voxel.
    pub fn depth(&self, voxel: UVec3) -> f64 {
        (self.grid.world_position(voxel) / self.grid.unit() / self.grid.aspect()).dot(self.ro)
    }
}

/// Raises singular values below 1 to 1; also the product of old/new. By the decomposition of a 2×2 matrix into rotation,
/// `diag(q + r, q - r)` and rotation.
fn low_pass(m: DMat2) -> (DMat2, f64) {
    let [[a, c], [b, d]] = m.to_cols_array_2d();
    let (e, f, g, h) = ((a + d) / 2.0, (a - d) / 2.0, (c + b) / 2.0, (c - b) / 2.0);
    let (q, r) = (e.hypot(h), f.hypot(g));
    let (sum, difference) = (g.atan2(f), h.atan2(e));
    let (left, right) = ((difference + sum) / 2.0, (difference - sum) / 2.0);
    let raise = |singular: f64| singular.abs().max(1.0).copysign(singular);
    let (old, new) = (DVec2::new(q + r, q - r), DVec2::new(raise(q + r), raise(q - r)));
    let raised = DMat2::from_angle(left) * DMat2::from_diagonal(new) * DMat2::from_angle(right);
    (raised, (old / new).element_product())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn low_pass_leaves_large_maps_alone_and_raises_small_ones() {
        for m in [DMat2::from_cols_array(&[3.0, 0.5, -1.0, 2.0]), DMat2::from_cols_array(&[-2.0, 0.0, 0.4, 5.0])] {
            let (same, amplitude) = low_pass(m);
            assert!(same.abs_diff_eq(m, 1e-12));
            assert!((amplitude - 1.0).abs() < 1e-12);
        }
        let (raised, amplitude) = low_pass(DMat2::from_cols_array(&[0.0, 0.25, -4.0, 0.0]));
        assert!(raised.abs_diff_eq(DMat2::from_cols_array(&[0.0, 1.0, -4.0, 0.0]), 1e-12));
        assert!((amplitude - 0.25).abs() < 1e-12);
    }
}
