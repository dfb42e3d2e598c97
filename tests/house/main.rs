//! The repository's own files: documents, dependencies, modules and shaders. Needs no GPU.
#![expect(clippy::unwrap_used, reason = "tests")]

mod dependencies;
mod docs;
mod host_api;
mod layout;
mod modules;
mod shader_needs;
mod shaders;
