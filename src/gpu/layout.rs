//! Every type that Rust and WGSL share. Field names, offsets and sizes are compared with the shaders by
//! `tests/layout.rs`.

use bytemuck::{Pod, Zeroable};

/// A relevant voxel: what a view does not change (Table 1).
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Voxel {
    /// Index into the volume's values.
    pub index: u32,
    /// The volume's value there.
    pub value: f32,
    /// Unit normal, octahedral, two 16-bit signed normalised numbers.
    pub normal: u32,
    /// |g|, value per world unit; 0 where there is no normal.
    pub gradient_magnitude: f32,
}

/// A projected and shaded voxel.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Splat {
    /// Pixel coordinate, right.
    pub x_px: f32,
    /// Pixel coordinate, down.
    pub y_px: f32,
    /// Depth in the warped grid.
    pub depth: f32,
    /// `C.rg·m`, two f16.
    pub rg: u32,
    /// `C.b·m` and `m`, two f16.
    pub ba: u32,
}

/// What is constant over a frame.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Frame {
    /// Rows that map (i, j, k, 1) to x in pixels, y in pixels, warped depth.
    pub screen_from_voxel: [[f32; 4]; 3],
    /// Columns of the 2×2 map footprint → pixels.
    pub pixels_from_footprint: [f32; 4],
    /// Columns of its inverse.
    pub footprint_from_pixels: [f32; 4],
    /// Unit vector to the light; w is 1 with shading, 0 without.
    pub light: [f32; 4],
    /// `normalize(light + to eye)`, 0 where they cancel.
    pub half_vector: [f32; 4],
    /// Ambient, diffuse, specular, shininess.
    pub shading: [f32; 4],
    /// Premultiplied background.
    pub background: [f32; 4],
    /// Volume dimensions; w unused.
    pub dims: [u32; 4],
    /// Ends of the colour, opacity and gradient opacity ramps in the control points; w unused.
    pub ramps: [u32; 4],
    /// Image width and height, pixels.
    pub size: [u32; 2],
    /// The low-pass amplitude over λ: what a splat's amounts are multiplied by.
    pub amplitude: f32,
    /// Kernel radius, grid units.
    pub radius: f32,
    /// Radius beyond which the kernel is negligible.
    pub support: f32,
    /// Exponent of the kernel.
    pub falloff: f32,
    /// Slab width in the warped grid.
    pub slab_width: f32,
    /// 0 linear, 1 exponential, 2 xray.
    pub compositing: u32,
    /// 0 front to back, 1 back to front.
    pub order: u32,
    /// Unused.
    pub padding_0: u32,
    /// Unused.
    pub padding_1: u32,
    /// Unused.
    pub padding_2: u32,
}

/// One slab.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Slab {
    /// Warped depth of the slab's near plane, `k·Δ·λw`.
    pub near: f32,
}

/// Rows of the image whose compositing buffer is one binding.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Band {
    /// First row, pixels from the top.
    pub first_row: u32,
    /// Number of rows.
    pub rows: u32,
}
