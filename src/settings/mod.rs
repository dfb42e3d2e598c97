//! The settings of a picture as plain data, as a scene file states them or a host sets them in code. Their ranges and defaults are those
//! of scene files: each type's `check` states them, and everything that accepts settings calls it.
//!
//! These structs are not `non_exhaustive`, so that a host can construct them like a scene file: some fields, and `..Default::default()`
//! for the rest. Later versions add fields whose defaults do not change the image; code that names every field must then name those
//! too. Enums that are likely to grow are `non_exhaustive`; those with two complementary variants, such as [`Order`], are not.

pub(crate) mod camera;
pub(crate) mod camera_table;
pub(crate) mod clip;
mod clip_from_world;
pub(crate) mod closing;
pub(crate) mod economies;
pub(crate) mod framing;
pub(crate) mod key;
pub(crate) mod keys;
pub(crate) mod light;
pub mod navigation;
pub(crate) mod shading;
pub(crate) mod splatting;
pub(crate) mod transfer_function;
pub(crate) mod window;

pub use crate::error::setting::{Allowed, Found, Interval};
pub use camera::{Camera, Fit, Projection};
pub use clip::{Clip, HalfSpace, MAX_PLANES};
pub use economies::Economies;
pub use framing::{Extent, Sphere};
pub use light::Light;
pub use shading::{Gradient, Shading};
pub use splatting::{
    Classification, Compositing, FootprintBox, FootprintForm, Interpolation, Method, Order, Rasterizer, SlabProfile,
    Splatting,
};
pub use transfer_function::{LabelTables, Ramp, RampError, Tables, TransferFunction};
pub use window::{Region, Window};
