//! Errors of volumes, and of the numbers that describe their grids.

pub mod setting;
pub(crate) mod volume;
