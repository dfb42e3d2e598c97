//! Kernel sections in a light sheet.

/// A voxel's section in a slab.
pub(super) struct Section {
    /// The pixel coordinates, from the band's first pixel.
    pub(super) center: [f32; 2],
    /// The slab's planes, grid units along the ray from the voxel.
    pub(super) planes: [f32; 2],
    /// The amount per `unit`, scaled.
    pub(super) amount: f32,
}
