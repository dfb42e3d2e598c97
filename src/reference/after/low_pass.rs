//! The low-pass rule of SPEC §9: where a pixel is larger than a grid unit, kernels are widened within the plane until they cover it.

use glam::{DMat2, DMat3, DVec2, DVec3};

/// The map of offsets on one slab plane to those at which the kernel is evaluated.
///
/// Let A be the 3×2 map from pixels to grid units within the plane. The rule lowers its singular values to at most 1 and keeps its left
/// singular vectors aⱼ. This changes every offset `δ = A·p + e`, e ⟂ A, to `δ - Σ (1 - 1/sⱼ)·aⱼ·(aⱼ·δ)` over the singular values sⱼ > 1.
/// So the rule is one matrix for all voxels, which is the identity where no pixel is larger than a grid unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LowPass {
    /// Maps offsets in grid units to those at which the kernel is evaluated.
    pub lowered: DMat3,
    /// The inverse of `lowered`.
    widened: DMat3,
    /// The greatest factor by which kernels are widened.
    pub widest: f64,
}

impl LowPass {
    /// The rule for a plane with these steps per pixel to the right and per pixel down, in grid units.
    pub fn new(right: DVec3, down: DVec3) -> Self {
        let (rr, rd, dd) = (right.dot(right), right.dot(down), down.dot(down));
        // The eigenvalues of AᵀA are the squares of the singular values.
        let (mean, half_difference) = ((rr + dd) / 2.0, (rr - dd) / 2.0);
        let root = half_difference.hypot(rd);
        let axis = DVec2::from_angle(rd.atan2(half_difference) / 2.0);
        let axes = DMat2::from_cols(axis, axis.perp());
        let (mut lowered, mut widened, mut widest) = (DMat3::IDENTITY, DMat3::IDENTITY, 1.0);
        for (axis, squared) in [(axes.x_axis, mean + root), (axes.y_axis, mean - root)] {
            if squared > 1.0 {
                let singular = squared.sqrt();
                let left = (right * axis.x + down * axis.y) / singular;
                let projection = DMat3::from_cols(left * left.x, left * left.y, left * left.z);
                lowered -= projection * (1.0 - 1.0 / singular);
                widened += projection * (singular - 1.0);
                widest = singular.max(widest);
            }
        }
        Self { lowered, widened, widest }
    }

    /// Half the box in grid units around the voxels whose kernels, of this radius, reach a point.
    pub fn half_box(&self, radius: f64) -> DVec3 {
        // The matrix is symmetric, so its columns are its rows.
        let DMat3 { x_axis, y_axis, z_axis } = self.widened;
        radius * DVec3::new(x_axis.length(), y_axis.length(), z_axis.length())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_longer_than_a_grid_unit_become_one() {
        let (right, down) = (DVec3::new(0.3, 0.4, 0.0), DVec3::new(0.0, 0.0, -0.9));
        assert_eq!(LowPass::new(right, down).lowered, DMat3::IDENTITY);
        let (right, down) = (DVec3::new(3.0, 4.0, 0.0), DVec3::new(0.0, 0.0, -0.5));
        let rule = LowPass::new(right, down);
        let across = DVec3::new(-4.0, 3.0, 0.0);
        assert!((rule.lowered * right).abs_diff_eq(right / 5.0, 1e-12));
        assert!((rule.lowered * down).abs_diff_eq(down, 1e-12));
        assert!((rule.lowered * across).abs_diff_eq(across, 1e-12));
        assert!((rule.lowered * rule.widened).abs_diff_eq(DMat3::IDENTITY, 1e-12));
    }

    /// Both singular values of the lowered map are at most 1, for oblique steps too.
    #[test]
    fn lowered_maps_enlarge_nothing() {
        for (right, down) in [
            (DVec3::new(2.0, 1.0, 0.5), DVec3::new(1.5, 1.3, -0.2)),
            (DVec3::new(0.9, 0.0, 0.0), DVec3::new(0.8, 0.3, 0.1)),
        ] {
            let rule = LowPass::new(right, down);
            let (right, down) = (rule.lowered * right, rule.lowered * down);
            let longest = (0..360).map(|degrees| {
                let (sine, cosine) = f64::from(degrees).to_radians().sin_cos();
                (right * cosine + down * sine).length()
            });
            let longest = longest.fold(0.0, f64::max);
            assert!((0.9999..1.0 + 1e-12).contains(&longest), "{longest}");
        }
    }
}
