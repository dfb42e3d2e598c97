//! Classification after splatting (SPEC §9): values and gradients are splatted onto the slab planes, and what a pixel sees between two planes is
//! classified and shaded there.
//!
//! ```text
//! coefficients ─→ the bricks whose values can meet an opacity
//! bricks ─ bin ─→ every tile of 32×32 pixels, its planes front to back in a ring of eight:
//!                   cull       what opaque pixels hide, brick by brick, then voxel by voxel
//!                   splat      all planes of a voxel, eight pixels at a time
//!                   classify   the slab before a plane, once every voxel that reaches the plane is splatted
//!                   composite  that slab's sheet, as where classification comes first
//! ```

mod classify;
mod coefficients;
mod extreme;
mod frame;
mod place;
mod planes;
mod slab_integral;
mod splat;
mod surface;
mod tile;

pub(super) use coefficients::Coefficients;
pub(super) use frame::Frame;
