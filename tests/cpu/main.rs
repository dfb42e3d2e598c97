//! Whatever draws without a GPU: the native backend and the f64 evaluation, with the scenes that they are given. Compiles without wgpu, which is quickest:
//! `cargo test --no-default-features --features cpu --test cpu`.
#![expect(clippy::unwrap_used, reason = "tests")]

mod clip_from_world;
#[expect(dead_code, reason = "not every program needs all of it")]
#[path = "../common/mod.rs"]
mod common;
mod comparisons;
mod light;
mod membership;
mod native;
mod scene;
mod transfer_function;
mod twins;
