//! The slab grid: which slabs a kernel touches (§3.2, SPEC §5).

use std::ops::Range;

use crate::error::RenderError;

/// The most slabs that a volume may be cut into. 0.05 `unit`s wide, 1800³ voxels need fewer.
pub const MAX_SLABS: u32 = 1 << 16;

/// Slabs of an orthographic view: planes perpendicular to w^wo at `k·width` in the warped grid, k = 0 through the volume's
/// centre. Slab k lies between the planes k and k + 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlabGrid {
    /// `Δ·λw`: the slab width in the warped grid, corrected so that steps along a ray are Δ `unit`s of world length for
    /// every orientation and aspect ratio (end of §4.2).
    pub width: f64,
    /// The kernel's radius, grid units.
    pub radius: f64,
}

impl SlabGrid {
    /// The slabs that a kernel at warped depth `z` overlaps with positive length: with more than rounding errors, so that
    /// a kernel that ends at a plane does not reach the slab behind it.
    pub fn touched(&self, z: f64) -> Range<i32> {
        const ROUNDING: f64 = 1e-9;
        let first = ((z - self.radius) / self.width + ROUNDING).floor();
        let end = ((z + self.radius) / self.width - ROUNDING).ceil();
        first as i32..end as i32
    }

    /// Checks that a volume which reaches `depth` from its centre, kernels not counted, is cut into at most [`MAX_SLABS`].
    ///
    /// # Errors
    /// If it is not.
    pub fn check(&self, depth: f64, slab_width: f64) -> Result<(), RenderError> {
        let slabs = (2.0 * (depth + self.radius) / self.width).ceil();
        // Not `>`: the number may be none.
        if slabs <= f64::from(MAX_SLABS) {
            return Ok(());
        }
        Err(RenderError::OutOfRange {
            key: "splatting.slab_width",
            found: format!("{slab_width} times the smallest spacing, so {slabs:e} slabs"),
            allowed: format!("widths and spacings with at most {MAX_SLABS} slabs"),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn touching_a_plane_is_not_overlapping() {
        let grid = SlabGrid { width: 1.0, radius: 2.0 };
        assert_eq!(grid.touched(0.0), -2..2);
        assert_eq!(grid.touched(0.25), -2..3);
        assert_eq!(grid.touched(-7.0), -9..-5);
        assert_eq!(SlabGrid { width: 8.0, radius: 2.0 }.touched(4.0), 0..1);
        // Not quite 3 in f64.
        assert_eq!(grid.touched(3.0 * 0.8 + 0.6), 1..5);
        assert_eq!(grid.touched(0.1 + 0.2 + 2.7), 1..5);
    }
}
