//! What the passes share: the device's capabilities, memory layouts, shader sources, targets.

pub mod bindings;
pub mod brick_lists;
pub mod device;
pub mod footprint_texture;
pub mod layout;
pub mod render_pipeline;
pub mod shaders;
pub mod targets;
pub mod timer;
pub mod uniforms;
pub mod volume_texture;
