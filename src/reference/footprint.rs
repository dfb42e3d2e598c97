//! Footprints on the screen (SPEC §5), with the low-pass rule.

use glam::{DMat2, DVec2, DVec3};

use crate::settings::camera::ViewBasis;

/// A local ray as the footprints of a kernel need it: `λ` and `ro` of SPEC §5.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// `λ = |rw|`: the warped length of one `unit` along the ray.
    pub lambda: f64,
    /// `(r·w)/λ`: the depth in `unit`s per grid unit along the warped ray.
    pub depth_per_warped: f64,
    /// `ro = rw/λ`.
    pub ro: DVec3,
    /// Maps an offset parallel to the image (`unit`s right, `unit`s down) to footprint coordinates.
    pub footprint_from_units: DMat2,
}

impl Ray {
    /// The ray along the unit vector `r` in a grid of this aspect.
    pub fn new(r: DVec3, basis: &ViewBasis, aspect: DVec3) -> Self {
        let rw = r / aspect;
        let (ro, lambda) = (rw.normalize(), rw.length());
        // The kernel is symmetric, so any orthonormal basis of the plane ⟂ ro serves.
        let a = ro.any_orthonormal_vector();
        let b = ro.cross(a);
        let column = |q: DVec3| DVec2::new((q / aspect).dot(a), (q / aspect).dot(b));
        let footprint_from_units = DMat2::from_cols(column(basis.u), column(-basis.v));
        Self { lambda, depth_per_warped: r.dot(basis.w) / lambda, ro, footprint_from_units }
    }

    /// The footprint for pixels of `pix` `unit`s.
    pub fn footprint(&self, pix: f64) -> Footprint {
        Footprint::new(self.footprint_from_units * pix)
    }
}

/// A footprint on the screen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint {
    /// Maps a pixel offset to footprint coordinates, after the low-pass rule.
    pub from_pixels: DMat2,
    /// The low-pass rule's amplitude.
    pub amplitude: f64,
}

impl Footprint {
    /// Applies the low-pass rule to a map from pixel offsets to footprint coordinates.
    pub fn new(from_pixels: DMat2) -> Self {
        let (pixels_from_footprint, amplitude) = low_pass(from_pixels.inverse());
        Self { from_pixels: pixels_from_footprint.inverse(), amplitude }
    }

    /// Half the width and height in pixels of the screen box around a footprint of the given radius (grid units).
    pub fn half_box(&self, radius: f64) -> DVec2 {
        let pixels_from_footprint = self.from_pixels.inverse();
        radius * DVec2::new(pixels_from_footprint.row(0).length(), pixels_from_footprint.row(1).length())
    }

    /// Maps a pixel offset to footprint coordinates whose first axis is the screen's (eqs. 9, 10). The square around a footprint in these
    /// coordinates is a parallelogram on the screen with two sides along the pixel rows (Fig. 13).
    pub fn sheared_from_pixels(&self) -> DMat2 {
        DMat2::from_angle(-self.from_pixels.x_axis.to_angle()) * self.from_pixels
    }
}

/// Raises singular values below 1 to 1 and returns the product of old/new. The 2×2 matrix is decomposed into a rotation,
/// `diag(q + r, q - r)` and a rotation.
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
    use crate::kernel::Kernel;
    use crate::settings::camera::Camera;

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

    /// The footprint of a whole kernel equals that of Westover's ellipsoid (§4.2), which is integrated here along world rays by sampling.
    #[test]
    fn the_warped_footprint_is_westovers_ellipsoid() {
        // The kernel is wide enough that truncation at the radius does not affect the sum.
        let kernel = Kernel::new(4.0, 2.0);
        let step = 0.02;
        for aspect in [DVec3::ONE, DVec3::new(1.0, 1.0, 5.0), DVec3::new(3.2 / 1.5, 3.2 / 1.5, 1.0)] {
            for direction in [DVec3::Y, DVec3::new(0.3, 0.9, -0.2), DVec3::new(0.5, -0.4, 0.9)] {
                let basis = Camera { direction, ..Camera::default() }.basis();
                let ray = Ray::new(basis.w, &basis, aspect);
                for offset in [DVec2::ZERO, DVec2::new(0.3, 0.0), DVec2::new(-0.5, 0.8), DVec2::new(1.1, -0.2)] {
                    let q = offset.x * basis.u - offset.y * basis.v;
                    let sum: f64 = (-1500..=1500)
                        .map(|i| kernel.value(((q + f64::from(i) * step * basis.w) / aspect).length()) * step)
                        .sum();
                    let rho_squared = (ray.footprint_from_units * offset).length_squared();
                    let warped = kernel.section(rho_squared, -kernel.radius(), kernel.radius()) / ray.lambda;
                    assert!((warped - sum).abs() < 1e-6, "{aspect} {direction} {offset}: {warped}, not {sum}");
                }
            }
        }
    }
}
