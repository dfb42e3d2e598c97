//! Voxels and kernel sections on the screen.

use glam::{DVec2, DVec4};

use super::footprint::Footprint;

/// A projected and shaded voxel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Splat {
    /// The pixel coordinates.
    pub center: DVec2,
    /// [`Geometry::depth`](super::Geometry::depth).
    pub depth: f64,
    /// `(C·m, m)` divided by λ, times the low-pass amplitude where that is the same for all sections ([`Geometry::scale`](super::Geometry::scale)).
    pub amount: DVec4,
    /// α, summed over all channels.
    pub alpha: f64,
}

/// A kernel section, or a whole kernel, on the screen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Section {
    /// The voxel's pixel coordinates.
    pub center: DVec2,
    /// The map from pixels to its footprint.
    pub footprint: Footprint,
    /// The section's start along the warped ray, relative to the voxel.
    pub t0: f64,
    /// The section's end.
    pub t1: f64,
    /// `(C·m, m)` times the low-pass amplitude, divided by λ.
    pub amount: DVec4,
    /// The ρ² from which on the section adds too little to be drawn (§8).
    pub rim: f64,
}

impl Section {
    /// The first and last pixel whose centres lie in the box around a footprint of the given radius. Pixel centres are at half-integers.
    pub fn pixels(&self, radius: f64) -> (DVec2, DVec2) {
        let half_box = self.footprint.half_box(radius);
        ((self.center - half_box - 0.5).ceil(), (self.center + half_box - 0.5).floor())
    }
}
