//! The geometry of voxels, kernels and slabs (§§3 and 4): footprints, the warped grid, the slabs and slab planes of a view, and
//! the limits of a pixel's ray. All of it is plain arithmetic in f64, without a GPU.

pub mod footprint;
pub mod grid_warp;
pub mod means;
pub(crate) mod pixel_ray;
pub(crate) mod plane_bounds;
pub mod plane_geometry;
pub mod slab;
#[cfg(feature = "gpu")]
pub(crate) mod surfaces;
pub mod view_geometry;
