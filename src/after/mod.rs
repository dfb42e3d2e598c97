//! Classification after splatting (SPEC §9) as plain data, which every rasterizer draws values, gradients and slabs from; it needs no GPU.

pub mod brick_ranges;
pub mod coefficients;
pub mod normalization;
pub mod shown_voxels;
pub mod slab_integral;
mod spheres;
