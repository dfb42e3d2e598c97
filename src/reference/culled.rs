//! An image with early splat elimination.

use super::visibility::Areas;
use crate::image::Image;

/// An image with early splat elimination, and counts of what was drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct Culled {
    /// The image.
    pub image: Image,
    /// Voxel–sheet pairs that passed the test.
    pub sections: u64,
    /// The areas they covered.
    pub areas: Areas,
    /// For every pixel the depth along w at which the requested opacity is reached, in `unit`s like the depths of surfaces; infinite where it
    /// is not reached. Within a sheet opacity grows linearly. Empty if none was requested.
    pub first_hits: Vec<f64>,
}
