//! The settings of a picture, as plain data: what a scene file states, or a host sets in code. The ranges and defaults are those of
//! the scene file.

pub(crate) mod camera;
pub(crate) mod clip;
mod clip_from_world;
pub(crate) mod shading;
pub(crate) mod splatting;
pub(crate) mod transfer_function;

pub use camera::{Camera, Projection};
pub use clip::{Clip, HalfSpace, MAX_PLANES};
pub use shading::{Gradient, Light, Shading};
pub use splatting::{
    Classification, Compositing, Economies, FootprintBox, FootprintForm, Interpolation, Method, Order, Rasterizer,
    Splatting,
};
pub use transfer_function::{LabelTables, Ramp, RampError, Tables, TransferFunction};
