//! Scenes that name files: which voxels they load, where the files may be, and how much memory they may take. The files are the readers' fixtures.

#![expect(clippy::unwrap_used, reason = "tests")]

mod files;
#[cfg(feature = "http")]
mod http;
mod raw;
#[cfg(feature = "http")]
#[path = "../common/http.rs"]
mod server;

use std::path::{Path, PathBuf};

use glam::UVec3;

/// The dimensions of every fixture.
const DIMS: UVec3 = UVec3::new(5, 4, 3);

/// The values of every fixture.
fn values() -> Vec<f32> {
    (0..60).map(|i| (i % 5 + 10 * (i / 5 % 4) + 100 * (i / 20)) as f32).collect()
}

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(name)
}
