//! The GPU's stages, one per file, in the order of the data flow. For every group of sheets: cull bricks → cull voxels → compact → shade →
//! tiles → splat → composite → occlude; at the end resolve (Fig. 12), and first hits if requested. Where classification comes
//! after splatting (SPEC §9), values, field (with field_colors) and classify replace shade, splat and composite. Images of channels that share no sheets
//! (SPEC §10) are added up by join.
//!
//! Each stage holds its pipeline, makes its bind group, and records itself; none allocates, submits or waits while recording.

pub mod classify;
mod clear;
pub mod composite;
pub mod cull;
pub mod field;
pub mod field_colors;
pub mod first_hit;
pub mod gather;
pub mod join;
pub(crate) mod lanes;
pub mod occlude;
pub mod resolve;
pub mod sample;
pub mod shade;
mod sheets;
pub mod splat;
pub mod tiles;
pub mod values;
