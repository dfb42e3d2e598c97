//! The GPU's stages, one per file, in the order of the data flow: shade → per sheet (splat → composite) → resolve.
//!
//! Each holds its pipeline, makes its bind group, and records itself; none allocates, submits or waits while recording.

pub mod composite;
pub mod resolve;
pub mod shade;
pub mod splat;
