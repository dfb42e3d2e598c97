//! Whatever draws on a GPU, its stages and whole frames, compared with the f64 evaluation. Needs a GPU or lavapipe.
//!
//! It is one program, so that its tests share a device: compiling the pipelines takes longer than most of them do.
#![expect(clippy::unwrap_used, reason = "tests")]

mod accuracy;
mod after;
mod appearance;
mod channels;
#[expect(dead_code, reason = "not every program needs all of it")]
#[path = "../common/mod.rs"]
mod common;
mod cube;
mod culling;
mod cuts;
mod economies;
mod faults;
mod holes;
mod labels;
mod light;
mod limits;
mod lists;
mod membership;
mod memory;
mod minified;
mod modes;
mod properties;
mod random;
mod rasterizers;
mod ray_march;
mod scenes;
mod settings;
mod stages;
mod turn;
mod values;
mod views;
