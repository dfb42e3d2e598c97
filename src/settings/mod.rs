//! The settings of a picture, as plain data: what a scene file states, or a host sets in code. The ranges and defaults are those of
//! the scene file: each type's `check` states them, and whatever takes settings calls it.
//!
//! These structs are not `non_exhaustive`, so that a host can make them as scenes are written: what it says, and
//! `..Default::default()` for the rest. Later versions add fields, with defaults that draw what was drawn before; code that names every
//! field has to name those too. Enums that are likely to grow are
//! `non_exhaustive`; those of two ways that exclude each other, such as [`Order`], are not.

pub(crate) mod camera;
pub(crate) mod clip;
mod clip_from_world;
pub(crate) mod economies;
pub(crate) mod framing;
pub(crate) mod shading;
pub(crate) mod splatting;
pub(crate) mod transfer_function;

pub use crate::setting_error::{Allowed, Found, Interval};
pub use camera::{Camera, Fit, Projection};
pub use clip::{Clip, HalfSpace, MAX_PLANES};
pub use economies::Economies;
pub use framing::Extent;
pub use shading::{Gradient, Light, Shading};
pub use splatting::{
    Classification, Compositing, FootprintBox, FootprintForm, Interpolation, Method, Order, Rasterizer, Splatting,
};
pub use transfer_function::{LabelTables, Ramp, RampError, Tables, TransferFunction};
