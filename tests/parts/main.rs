//! Parts of an image (SPEC §11): slab ranges and regions merge into the whole image, whatever draws them.

#![expect(clippy::unwrap_used, reason = "tests")]

mod channels;
#[expect(dead_code, reason = "not every program needs all of it")]
#[path = "../common/mod.rs"]
mod common;
mod files;
mod light;
mod means;
mod merging;
mod random;
mod scans;
mod splitting;
mod stored_light;
mod streamed;
