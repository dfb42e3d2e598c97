//! Rectilinear grids: dimensions and spacing, without values.

use std::ops::Bound::Included;

use glam::{DVec3, UVec3};

use crate::error::setting::{Interval, SettingError};

/// The range of spacings in world units. Squares and products of such lengths stay finite in `f64`.
pub const SPACING: Interval = Interval::new(Included(1e-100), Included(1e100));

/// The maximum ratio of two spacings, so that warped positions stay accurate in `f32`.
const MAX_ASPECT: f64 = 1e4;

/// The maximum distance, in units, of a coarser level's centre from the finest level's, so that positions stay accurate in `f32`.
const MAX_PLACE: f64 = 1e6;

/// Checks the spacing under a key.
pub fn check_spacing(key: &str, spacing: DVec3) -> Result<(), SettingError> {
    SPACING.check_each(key, &spacing.to_array())?;
    if spacing.max_element() / spacing.min_element() > MAX_ASPECT {
        let allowed = format!("three numbers, none above {MAX_ASPECT} times another");
        return Err(SettingError::new(key, spacing, allowed));
    }
    Ok(())
}

/// The dimensions of a grid, if each is at least 1 and the number of voxels fits in 32 bits.
pub fn dims_of<N: TryInto<u32>>(sizes: [N; 3]) -> Option<UVec3> {
    let [Ok(x), Ok(y), Ok(z)] = sizes.map(TryInto::try_into) else { return None };
    let voxels = x.checked_mul(y)?.checked_mul(z)?;
    (voxels > 0).then_some(UVec3::new(x, y, z))
}

/// The sizes that [`dims_of`] accepts, for errors.
pub const SIZES: &str = "three positive integers, at most 4294967295 voxels";

/// A rectilinear grid (SPEC §2) whose centre is the world's origin, or, of a coarser level (SPEC §13), where its level lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// The number of voxels along x, y and z, each at least 1.
    pub dims: UVec3,
    /// The distance between neighbouring voxels along x, y and z, in world units.
    pub spacing: DVec3,
    /// The spacing of the volume's finest level, if this is another one.
    pub(crate) finest: Option<DVec3>,
    /// The place of the grid's centre in the world.
    pub(crate) place: DVec3,
    /// Of a box of a volume its first voxel there, and the volume's voxels along each axis; `None` if it is all of it.
    pub(crate) whole: Option<(UVec3, UVec3)>,
    /// Whether the first axis runs against the file's, whose axes are left-handed.
    pub(crate) turned: bool,
}

impl Grid {
    /// The same grid with other dimensions: its own part of the whole stays what it was.
    #[doc(hidden)]
    pub fn resized(self, dims: UVec3) -> Self {
        Self { dims, ..self }
    }

    /// A grid whose centre is the world's origin.
    pub const fn new(dims: UVec3, spacing: DVec3) -> Self {
        Self { dims, spacing, finest: None, place: DVec3::ZERO, whole: None, turned: false }
    }

    /// The grid of a coarser level of a volume (SPEC §13), whose centre lies at `place` from the centre of the finest level. Its unit of length is that of
    /// the finest level.
    pub fn coarser_than(self, finest: &Self, place: DVec3) -> Self {
        Self { finest: Some(finest.spacing), place, ..self }
    }

    /// The same grid in a volume whose finest level has another spacing.
    pub fn with_finest_spacing(self, spacing: DVec3) -> Self {
        let Some(finest) = self.finest else { return Self { spacing, ..self } };
        let by = spacing / finest;
        Self { spacing: self.spacing * by, finest: Some(spacing), place: self.place * by, ..self }
    }

    /// The grid of a box of its voxels, where they lie.
    #[doc(hidden)]
    pub fn part(&self, from: UVec3, dims: UVec3) -> Self {
        let (first, all) = self.whole.unwrap_or((UVec3::ZERO, self.dims));
        let own = Self { dims, whole: Some((first + from, all)), ..*self };
        Self { place: self.place + (from.as_dvec3() + own.center() - self.center()) * self.spacing, ..own }
    }

    /// The place of the grid's centre in the world: the origin, but for coarser levels whose voxels do not fill the finest level's box.
    pub fn place(&self) -> DVec3 {
        self.place
    }

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
        check_spacing("spacing", self.spacing)?;
        let unit = self.unit();
        if self.aspect().max_element() > MAX_ASPECT || self.place.abs().max_element() / unit > MAX_PLACE {
            let allowed =
                format!("spacings at most {MAX_ASPECT} times the finest level's smallest, {unit}, about its centre");
            return Err(SettingError::new("spacing", self.spacing, allowed));
        }
        Ok(())
    }

    /// The number of voxels, or `u64::MAX` if a file states more than that.
    #[doc(hidden)]
    pub fn voxels(&self) -> u64 {
        self.dims.to_array().iter().fold(1, |product: u64, &n| product.saturating_mul(n.into()))
    }

    /// The voxel at an index in memory (x fastest).
    pub fn voxel_at(&self, index: u32) -> UVec3 {
        let (x, rest) = (index % self.dims.x, index / self.dims.x);
        UVec3::new(x, rest % self.dims.y, rest / self.dims.y)
    }

    /// The voxel whose cell has a point in voxel coordinates; beyond all cells, the nearest voxel.
    #[doc(hidden)]
    pub fn nearest(&self, at: DVec3) -> UVec3 {
        // Cast, which rounds towards 0.
        (at + 0.5).clamp(DVec3::ZERO, self.dims.as_dvec3() - 1.0).as_uvec3()
    }

    /// A voxel's index in memory.
    pub fn index_of(&self, voxel: UVec3) -> u32 {
        voxel.x + self.dims.x * (voxel.y + self.dims.y * voxel.z)
    }

    /// `min(sx, sy, sz)` in world units, of the volume's finest level: the unit of length for opacities and slab widths (SPEC §2).
    pub fn unit(&self) -> f64 {
        self.finest_spacing().min_element()
    }

    /// The spacing of the volume's finest level: the grid's own, if this is not a coarser one.
    pub fn finest_spacing(&self) -> DVec3 {
        self.finest.unwrap_or(self.spacing)
    }

    /// The grid aspect `ar = s / unit` (§4.2), each component at least 1 if the finest level's spacings are the smallest.
    pub fn aspect(&self) -> DVec3 {
        self.spacing / self.unit()
    }

    /// The grid's centre in voxel coordinates.
    pub fn center(&self) -> DVec3 {
        (self.dims.as_dvec3() - 1.0) / 2.0
    }

    /// The box around the voxels' centres of the volume, of which the grid may be a part: its centre in grid steps from the grid's own, and half its size.
    #[doc(hidden)]
    pub fn whole(&self) -> (DVec3, DVec3) {
        let Some((first, dims)) = self.whole else { return (DVec3::ZERO, self.center()) };
        let centers = Self { dims, ..*self }.center();
        (centers - first.as_dvec3() - self.center(), centers)
    }

    /// A voxel's position from the grid's centre, in world units.
    pub fn world_position(&self, voxel: UVec3) -> DVec3 {
        (voxel.as_dvec3() - self.center()) * self.spacing
    }

    /// The radius, in world units, of the sphere that the default camera shows whole: half the diagonal over voxel centres plus a kernel
    /// of `kernel_radius` grid units.
    pub fn bounding_radius(&self, kernel_radius: f64) -> f64 {
        (self.center() * self.spacing).length() + kernel_radius * self.spacing.max_element()
    }
}
