//! Classification after splatting (SPEC §9) as plain data that no GPU is needed for: what every rasterizer draws values, gradients and slabs from.

pub mod brick_ranges;
pub mod coefficients;
pub mod normalization;
pub mod plane_geometry;
pub mod slab_integral;
