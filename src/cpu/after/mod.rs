//! Classification after splatting (SPEC §9): values and gradients are reconstructed on the slab planes, and what a pixel sees between two planes
//! is classified and shaded there.
//!
//! ```text
//! coefficients ─→ the bricks in whose cells values can meet an opacity
//! bricks ─ bin ─→ every tile of 32×64 pixels, its slabs front to back:
//!                   cull       bricks whose pixels are opaque
//!                   field      the values of open pixels on the slab's two planes, gradients where something is visible
//!                   classify   the slab, eight pixels at a time
//!                   composite  its sheet, as where classification comes first
//! ```

mod bounds;
mod cells;
mod classify;
mod coefficients;
mod colors;
mod differences;
mod extent;
mod extreme;
mod field;
mod frame;
mod held;
mod light;
mod low_pass;
mod matter;
mod needs;
mod place;
mod planes;
mod search;
mod sheet;
mod slab_integral;
mod surface;
mod tile;
mod wide;

pub(super) use coefficients::Coefficients;
pub(super) use frame::Frame;
pub(super) use matter::Matter;
