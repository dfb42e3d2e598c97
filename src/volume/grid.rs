//! Rectilinear grids: dimensions and spacing, without values.

use std::ops::Bound::Included;

use glam::{DVec3, UVec3};

use crate::error::setting::{Interval, SettingError};

/// The range of spacings in world units. Squares and products of such lengths stay finite in `f64`.
pub(crate) const SPACING: Interval = Interval::new(Included(1e-100), Included(1e100));

/// The maximum ratio of two spacings, so that warped positions stay accurate in `f32`.
const MAX_ASPECT: f64 = 1e4;

/// Checks the spacing under a key.
pub(crate) fn check_spacing(key: &str, spacing: DVec3) -> Result<(), SettingError> {
    SPACING.check_each(key, &spacing.to_array())?;
    if spacing.max_element() / spacing.min_element() > MAX_ASPECT {
        let allowed = format!("three numbers, none above {MAX_ASPECT} times another");
        return Err(SettingError::new(key, spacing, allowed));
    }
    Ok(())
}

/// A rectilinear grid (SPEC §2) whose centre is the world's origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// The number of voxels along x, y and z, each at least 1.
    pub dims: UVec3,
    /// The distance between neighbouring voxels along x, y and z, in world units.
    pub spacing: DVec3,
}

impl Grid {
    /// Checks the dimensions and spacings, as [`Volume::new`](crate::Volume::new) does.
    ///
    /// # Errors
    /// If a dimension is 0, there are more than `u32::MAX` voxels, or a spacing is not within [1e-100, 1e100] or is more than 10⁴ times
    /// another.
    pub fn check(&self) -> Result<(), SettingError> {
        let count = self.dims.to_array().iter().try_fold(1_u32, |product, &n| product.checked_mul(n));
        if count.is_none_or(|count| count == 0) {
            let allowed = "three sizes of at least 1, at most 4294967295 voxels";
            return Err(SettingError::new("sizes", self.dims.as_dvec3(), allowed));
        }
        check_spacing("spacing", self.spacing)
    }

    /// The voxel at an index in memory (x fastest).
    pub fn voxel_at(&self, index: u32) -> UVec3 {
        let (x, rest) = (index % self.dims.x, index / self.dims.x);
        UVec3::new(x, rest % self.dims.y, rest / self.dims.y)
    }

    /// A voxel's index in memory.
    pub fn index_of(&self, voxel: UVec3) -> u32 {
        voxel.x + self.dims.x * (voxel.y + self.dims.y * voxel.z)
    }

    /// `min(sx, sy, sz)` in world units: the unit of length for opacities and slab widths (SPEC §2).
    pub fn unit(&self) -> f64 {
        self.spacing.min_element()
    }

    /// The grid aspect `ar = s / unit` (§4.2), each component at least 1.
    pub fn aspect(&self) -> DVec3 {
        self.spacing / self.unit()
    }

    /// The grid's centre in voxel coordinates.
    pub fn center(&self) -> DVec3 {
        (self.dims.as_dvec3() - 1.0) / 2.0
    }

    /// A voxel's world position.
    pub fn world_position(&self, voxel: UVec3) -> DVec3 {
        (voxel.as_dvec3() - self.center()) * self.spacing
    }

    /// The radius, in world units, of the sphere that the default camera shows whole: half the diagonal over voxel centres plus a kernel
    /// of `kernel_radius` grid units.
    pub fn bounding_radius(&self, kernel_radius: f64) -> f64 {
        (self.center() * self.spacing).length() + kernel_radius * self.spacing.max_element()
    }
}
