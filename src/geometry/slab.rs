//! The slab grid, which tells the slabs that a kernel touches (§3.2, SPEC §5).

use std::ops::Range;

use crate::error::RenderError;
use crate::error::setting::SettingError;

/// The maximum number of slabs in a volume. 1800³ voxels need fewer with slabs 0.05 `unit`s wide.
pub const MAX_SLABS: u32 = 1 << 16;

/// The minimum overlap of a kernel with a slab, in slab widths; anything less is a rounding error.
pub const ROUNDING: f64 = 1e-9;

/// Parallel planes at distances of `width` in a view's sheet depth. Slab k lies between planes k and k + 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlabGrid {
    /// The sheet depth of plane 0.
    pub origin: f64,
    /// The width of a slab.
    pub width: f64,
}

impl SlabGrid {
    /// The sheet depth of plane k.
    pub fn plane(&self, k: i32) -> f64 {
        self.origin + f64::from(k) * self.width
    }

    /// The grid of groups of `sheets` slabs, in which group 0 begins at slab 0.
    pub fn groups(&self, sheets: u32) -> Self {
        Self { width: self.width * f64::from(sheets), ..*self }
    }

    /// The groups of `sheets` slabs that some slabs lie in.
    pub fn groups_of(slabs: &Range<i32>, sheets: u32) -> Range<i32> {
        let sheets = sheets as i32;
        slabs.start.div_euclid(sheets)..slabs.end.saturating_add(sheets - 1).div_euclid(sheets)
    }

    /// The slabs that the depths from `first` to `end` overlap by more than rounding errors, so that a kernel that ends at a plane does not
    /// reach the slab behind it.
    #[inline(always)]
    pub fn touched(&self, first: f64, end: f64) -> Range<i32> {
        let first = ((first - self.origin) / self.width + ROUNDING).floor();
        let end = ((end - self.origin) / self.width - ROUNDING).ceil();
        first as i32..end as i32
    }

    /// The slabs that these depths overlap; `None` if the range is empty.
    pub fn covered(&self, depths: Range<f64>) -> Option<Range<i32>> {
        (depths.start < depths.end).then(|| self.touched(depths.start, depths.end))
    }

    /// Checks that a volume that reaches `depth` from its centre, kernels included, has at most [`MAX_SLABS`] slabs.
    ///
    /// # Errors
    /// If it has more.
    pub fn check(&self, depth: f64, slab_width: f64) -> Result<(), RenderError> {
        let slabs = (2.0 * depth / self.width).ceil();
        // Not `>`, because the number may be NaN.
        if slabs <= f64::from(MAX_SLABS) {
            return Ok(());
        }
        let found = format!("{slab_width} times the smallest spacing, so {slabs:e} slabs");
        let allowed = format!("widths and spacings with at most {MAX_SLABS} slabs");
        Err(SettingError::new("splatting.slab_width", found, allowed).into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn touching_a_plane_is_not_overlapping() {
        let grid = SlabGrid { origin: 0.0, width: 1.0 };
        let touched = |z: f64| grid.touched(z - 2.0, z + 2.0);
        assert_eq!(touched(0.0), -2..2);
        assert_eq!(touched(0.25), -2..3);
        assert_eq!(touched(-7.0), -9..-5);
        assert_eq!(SlabGrid { origin: 0.0, width: 8.0 }.touched(2.0, 6.0), 0..1);
        assert_eq!(SlabGrid { origin: -0.5, width: 1.0 }.touched(2.75, 3.25), 3..4);
        // In f64 the sum is a little off 3.
        assert_eq!(touched(3.0 * 0.8 + 0.6), 1..5);
        assert_eq!(touched(0.1 + 0.2 + 2.7), 1..5);
    }
}
