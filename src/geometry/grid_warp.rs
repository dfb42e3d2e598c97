//! Grid warping (§4): the rectilinear grid becomes cubic, the viewing system is warped with it, and rotation, shear and scaling map the
//! warped volume onto an orthonormal image grid. There is one function per equation.
//!
//! Rows of a matrix are the paper's rows: `m.row(0)` is the first. Lengths are `unit`s (SPEC §2).

use glam::{DMat2, DMat3, DVec2, DVec3};

use crate::settings::camera::ViewBasis;

/// Eq. 4: world to view, rows u, v, w.
pub fn m_view(basis: &ViewBasis) -> DMat3 {
    basis.rows()
}

/// Eq. 5: the rows of eq. 4 warped by the grid aspect `ar`: u^w, v^w, w^w.
pub fn m_view_warped(basis: &ViewBasis, ar: DVec3) -> DMat3 {
    m_view(basis) * DMat3::from_diagonal(ar.recip())
}

/// The unit normal of the slabs, `w^wo = w^w / |w^w|` (text above eq. 6), and `λw = |w^w|`, the factor by which a step along the viewing
/// direction is shorter in the warped grid (end of §4.2).
pub fn w_wo(warped: &DMat3) -> (DVec3, f64) {
    let w_w = warped.row(2);
    (w_w.normalize(), w_w.length())
}

/// Eq. 6: v^w projected onto the plane normal to w^wo, normalised.
pub fn v_wo(warped: &DMat3) -> DVec3 {
    let (_, v_wp) = wp(warped);
    v_wp.normalize()
}

/// Eq. 7: the rotation with rows u^wo = v^wo × w^wo, v^wo, w^wo.
///
/// With a left-handed u, v, w (u right, v up, w into the screen) u^wo points left, which eq. 10 undoes.
pub fn m_view_wo(warped: &DMat3) -> DMat3 {
    let (w_wo, _) = w_wo(warped);
    let v_wo = v_wo(warped);
    DMat3::from_cols(v_wo.cross(w_wo), v_wo, w_wo).transpose()
}

/// Eq. 8: u^wp and v^wp, the warped image vectors projected onto the plane normal to w^wo.
pub fn wp(warped: &DMat3) -> (DVec3, DVec3) {
    let (w_wo, _) = w_wo(warped);
    let project = |vector: DVec3| vector - vector.dot(w_wo) * w_wo;
    (project(warped.row(0)), project(warped.row(1)))
}

/// Eq. 9, with the minus sign that is missing in print: the shear that makes u^wp and v^wp orthogonal.
pub fn m_shear(warped: &DMat3) -> DMat3 {
    let (u_wp, _) = wp(warped);
    let rotation = m_view_wo(warped);
    let (u_x, u_y) = (u_wp.dot(rotation.row(0)), u_wp.dot(rotation.row(1)));
    DMat3::from_cols(DVec3::new(1.0, -u_y / u_x, 0.0), DVec3::Y, DVec3::Z)
}

/// Eq. 10 without its stray 1: `diag(1/u_x, 1/|v|, 1)`, which restores unit image vectors.
pub fn m_scale(warped: &DMat3) -> DMat3 {
    let (u_wp, v_wp) = wp(warped);
    let u_x = u_wp.dot(m_view_wo(warped).row(0));
    DMat3::from_diagonal(DVec3::new(1.0 / u_x, 1.0 / v_wp.length(), 1.0))
}

/// Eq. 11: warped grid coordinates to (units right, units up, warped depth).
pub fn m_vol(warped: &DMat3) -> DMat3 {
    m_scale(warped) * m_shear(warped) * m_view_wo(warped)
}

/// The map between footprints and the screen: the shear and scale of eqs. 9 and 10 in pixels, with the low-pass rule of \[17\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FootprintMap {
    /// Maps footprint coordinates (grid units along u^wo, v^wo) to a pixel offset (x right, y down).
    pub pixels_from_footprint: DMat2,
    /// Its inverse.
    pub footprint_from_pixels: DMat2,
    /// The factor of the low-pass rule for amplitudes, at most 1.
    pub amplitude: f64,
}

impl FootprintMap {
    /// The map for a view whose rows are warped by eq. 5, with pixels of `pix` units.
    pub fn new(warped: &DMat3, pix: f64) -> Self {
        let units_from_footprint = DMat2::from_mat3(m_scale(warped) * m_shear(warped));
        let pixels_from_units = DMat2::from_diagonal(DVec2::new(1.0 / pix, -1.0 / pix));
        Self::low_pass(pixels_from_units * units_from_footprint)
    }

    /// The low-pass rule: singular values below 1 pixel per grid unit are raised to 1, and the amplitude falls in proportion.
    pub fn low_pass(pixels_from_footprint: DMat2) -> Self {
        // The eigensystem of MᵀM gives the right singular vectors and the squared singular values.
        let gram = pixels_from_footprint.transpose() * pixels_from_footprint;
        let (a, b, c) = (gram.x_axis.x, gram.x_axis.y, gram.y_axis.y);
        let right = DMat2::from_angle(0.5 * libm::atan2(2.0 * b, a - c));
        let singular = DVec2::new(
            (pixels_from_footprint * right.x_axis).length(),
            (pixels_from_footprint * right.y_axis).length(),
        );
        let raised = singular.max(DVec2::ONE);
        let map = pixels_from_footprint * right * DMat2::from_diagonal(raised / singular) * right.transpose();
        let amplitude = (singular / raised).element_product();
        Self { pixels_from_footprint: map, footprint_from_pixels: map.inverse(), amplitude }
    }

    /// The parallelogram around a footprint of the given radius (grid units) whose upper and lower sides are pixel rows (Fig. 13), as high as
    /// the box: the shift of its other sides per row downwards, and half its width, both in pixels.
    pub fn parallelogram(&self, radius: f64) -> (f64, f64) {
        // The footprint coordinates are rotated so that pixel rows follow the first axis; the second is then constant along a row.
        let DMat2 { x_axis: along_rows, y_axis } = self.footprint_from_pixels;
        (-along_rows.dot(y_axis) / along_rows.length_squared(), radius / along_rows.length())
    }

    /// Half the width and height in pixels of the screen box around a footprint of the given radius (grid units).
    pub fn half_box(&self, radius: f64) -> DVec2 {
        radius * DVec2::new(self.pixels_from_footprint.row(0).length(), self.pixels_from_footprint.row(1).length())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::camera::Camera;

    fn views() -> Vec<(ViewBasis, DVec3)> {
        let directions = [DVec3::Y, DVec3::X, DVec3::new(0.3, 0.9, -0.2), DVec3::new(-0.7, 0.1, 0.69), DVec3::ONE];
        let aspects = [DVec3::ONE, DVec3::new(1.0, 1.0, 5.0), DVec3::new(2.13, 2.13, 1.0), DVec3::new(3.0, 1.0, 2.0)];
        directions
            .iter()
            .flat_map(|&direction| aspects.map(|ar| (Camera { direction, ..Camera::default() }.basis(), ar)))
            .collect()
    }

    /// SPEC §5's direct form: |footprint coordinates|² as a quadratic form of a pixel offset.
    fn direct_form(basis: &ViewBasis, ar: DVec3, pix: f64, offset: DVec2) -> f64 {
        let ro = (basis.w / ar).normalize();
        let q = (offset.x * basis.u - offset.y * basis.v) * pix / ar;
        (q - q.dot(ro) * ro).length_squared()
    }

    #[test]
    fn eq_7_is_a_rotation() {
        for (basis, ar) in views() {
            let rotation = m_view_wo(&m_view_warped(&basis, ar));
            assert!((rotation * rotation.transpose()).abs_diff_eq(DMat3::IDENTITY, 1e-12));
            assert!((rotation.determinant() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn eq_9_and_10_make_the_image_grid_orthonormal() {
        for (basis, ar) in views() {
            let warped = m_view_warped(&basis, ar);
            let (u_wp, v_wp) = wp(&warped);
            let image = m_vol(&warped);
            assert!((image * u_wp).abs_diff_eq(DVec3::X, 1e-12), "u {}", image * u_wp);
            assert!((image * v_wp).abs_diff_eq(DVec3::Y, 1e-12), "v {}", image * v_wp);
        }
    }

    #[test]
    fn eq_11_projects_like_eq_4() {
        for (basis, ar) in views() {
            let image = m_vol(&m_view_warped(&basis, ar));
            for p in [DVec3::new(3.0, -2.0, 7.5), DVec3::X, DVec3::new(-40.0, 11.0, 90.0)] {
                let projected = image * (p / ar);
                let wo = (basis.w / ar).normalize();
                assert!(projected.abs_diff_eq(DVec3::new(basis.u.dot(p), basis.v.dot(p), wo.dot(p / ar)), 1e-9));
            }
        }
    }

    #[test]
    fn footprint_map_is_the_direct_form() {
        for (basis, ar) in views() {
            let (pix, warped) = (0.05, m_view_warped(&basis, ar));
            let map = FootprintMap::new(&warped, pix);
            assert_eq!(map.amplitude, 1.0, "nothing is minified here");
            for offset in [DVec2::X, DVec2::Y, DVec2::new(3.0, -2.0), DVec2::new(-1.5, -4.0)] {
                let (ours, direct) =
                    ((map.footprint_from_pixels * offset).length_squared(), direct_form(&basis, ar, pix, offset));
                assert!((ours - direct).abs() < 1e-12 * (1.0 + direct), "{ours} {direct}");
            }
        }
    }

    #[test]
    fn a_parallelogram_holds_its_footprint_and_touches_it() {
        for (basis, ar) in views() {
            let map = FootprintMap::new(&m_view_warped(&basis, ar), 0.05);
            let (shear, half_width) = map.parallelogram(1.5);
            let reach = |angle: f64| {
                let rim = map.pixels_from_footprint * DVec2::from_angle(angle) * 1.5;
                ((rim.x - shear * rim.y).abs() / half_width, rim.y.abs() / map.half_box(1.5).y)
            };
            let reached = (0..3600).map(|step| reach(f64::from(step) * std::f64::consts::TAU / 3600.0));
            let (x, y) = reached.fold((0.0_f64, 0.0_f64), |most, reach| (most.0.max(reach.0), most.1.max(reach.1)));
            assert!((x - 1.0).abs() < 1e-5 && (y - 1.0).abs() < 1e-5, "{x} {y}");
        }
    }

    #[test]
    fn low_pass_raises_singular_values_and_keeps_the_integral() {
        let rotation = DMat2::from_angle(0.4);
        for (x, y) in [(0.25, 0.5), (0.3, 4.0), (3.0, 2.0), (1.0, 1.0), (0.5, 0.5)] {
            let original = rotation * DMat2::from_diagonal(DVec2::new(x, y)) * DMat2::from_angle(-1.1);
            let map = FootprintMap::low_pass(original);
            assert!((map.pixels_from_footprint.determinant() - x.max(1.0) * y.max(1.0)).abs() < 1e-12);
            assert!((map.amplitude - x.min(1.0) * y.min(1.0)).abs() < 1e-12);
            let product = map.pixels_from_footprint * map.footprint_from_pixels;
            assert!(product.abs_diff_eq(DMat2::IDENTITY, 1e-12));
        }
    }
}
