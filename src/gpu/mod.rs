//! The passes' common parts: the device's capabilities and faults, memory layouts, shader sources, targets, counts.

mod all_channels;
pub mod bindings;
pub mod brick_lists;
pub mod classified_volume;
pub(crate) mod coefficients;
pub(crate) mod counts;
pub mod device;
pub(crate) mod fault;
pub mod footprint_texture;
pub mod gathered_layout;
pub(crate) mod gpu_volume;
pub(crate) mod hiding;
pub mod layout;
pub mod light_texture;
pub(crate) mod membership;
pub(crate) mod options;
pub(crate) mod placement;
pub mod ramps;
pub mod render_pipeline;
pub mod shaders;
pub(crate) mod shown_bricks;
pub mod targets;
pub mod timer;
pub mod uniforms;
pub mod volume_texture;
