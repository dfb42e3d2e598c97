//! The low-pass rule of SPEC §9 on one plane, as in `reference::after::low_pass`.

use glam::{DMat3, DVec2, DVec3};

use crate::geometry::plane_geometry::PlaneGeometry;

/// How a plane's kernels differ from spheres in the grid.
#[derive(Clone, Copy, Debug)]
pub(super) struct LowPass {
    /// Maps offsets in grid units to those at which the kernel is evaluated.
    pub(super) lowered: DMat3,
    /// Half the box in grid units around the voxels whose kernels reach a point.
    pub(super) half_box: DVec3,
    /// Whether no pixel is larger than a grid unit.
    pub(super) is_identity: bool,
    /// Whether kernels reach so many voxels that pixels are worth a task each.
    pub(super) is_wide: bool,
}

/// The area of a pixel in voxels from which on kernels are wide: a task costs about as much as a few hundred voxels.
const WIDE: f64 = 4.0;

impl LowPass {
    /// The rule for the plane at a depth from the eye, which is 1 without an eye.
    pub(super) fn new(geometry: &PlaneGeometry, from_eye: f64) -> Self {
        let sizes = (geometry.per_pixel * from_eye).max(DVec2::ONE);
        let mut lowered = DMat3::IDENTITY;
        for (axis, size) in geometry.axes.into_iter().zip(sizes.to_array()) {
            lowered -= DMat3::from_cols(axis * axis.x, axis * axis.y, axis * axis.z) * (1.0 - 1.0 / size);
        }
        Self {
            lowered,
            half_box: geometry.half_box(from_eye),
            is_identity: sizes == DVec2::ONE,
            is_wide: sizes.element_product() >= WIDE,
        }
    }
}
