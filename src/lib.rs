//! Volume rendering by image-aligned sheet-buffer splatting on the GPU, through wgpu.

pub mod bucket;
pub mod camera;
pub mod classify;
pub mod error;
pub mod footprint;
pub mod gpu;
pub mod grid_warp;
pub mod headless;
pub mod image;
pub mod kernel;
pub mod pass;
pub mod plan;
pub mod reference;
pub mod renderer;
pub mod scene;
pub mod shading;
pub mod slab;
pub mod splatting;
pub mod stats;
pub mod transfer_function;
pub mod volume;

pub use wgpu;
