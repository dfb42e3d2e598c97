//! What a frame cost, counted as in Table 4.

use std::collections::BTreeMap;

use serde::Serialize;

#[cfg(feature = "gpu")]
pub use crate::renderer::counts::{GroupSlabs, PendingCounts, Totals};

/// Milliseconds by stage.
pub type StageTimes = BTreeMap<&'static str, f64>;

/// Counts and times of one frame (SPEC §8). As JSON: the field names as keys.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Stats {
    /// The GPU, or `CPU` for the other backends.
    pub adapter: String,
    /// Its driver; for the native backend the instruction set.
    pub driver: String,
    /// `gpu`, `cpu` or `reference`.
    pub backend: String,
    /// The graphics API: `vulkan`, `metal`, …, or `none`.
    pub api: String,
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// The frame's counts.
    #[serde(flatten)]
    pub counts: Counts,
    /// `quads` or `tiles`; for other backends their name.
    pub rasterizer: String,
    /// Of a renderer that profiles, on a device with timestamp queries: the GPU's milliseconds by stage.
    #[serde(skip_serializing_if = "StageTimes::is_empty")]
    pub stages_ms: StageTimes,
    /// Bytes of GPU memory that the frame holds.
    pub gpu_bytes: u64,
    /// Milliseconds to load or make the volume.
    pub load_ms: f64,
    /// Milliseconds to classify, bucket and upload.
    pub prepare_ms: f64,
    /// Milliseconds to draw the frame and read it back.
    pub frame_ms: f64,
}

/// What a frame is made of (Table 4).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Voxels of the volume.
    pub voxels_total: u64,
    /// Voxels that take part (SPEC §3).
    pub voxels_in_range: u64,
    /// Voxels whose colour was computed for this frame. Tiles compute it again for every tile that a voxel is drawn in, and where more
    /// is behind a tile than it remembers for every group; it counts once.
    pub voxels_shaded: u64,
    /// Voxel–slab overlaps of positive length, wherever they fall on the screen.
    pub sections_total: u64,
    /// Those of them that were drawn.
    pub sections_rasterized: u64,
    /// Slabs from the first to the last that any kernel touches.
    pub sheets: u64,
    /// 32×32 tiles of the image times sheets.
    pub tiles_total: u64,
    /// Those of them that were composited.
    pub tiles_composited: u64,
    /// Quads drawn, each for one voxel and a group of sheets; 0 by tiles.
    pub quads: u64,
    /// Tests of a brick against a sheet group; 0 by tiles, which test voxels.
    pub bricks_tested: u64,
    /// Those of them whose voxels were looked at; by tiles for every tile and group anew.
    pub bricks_visited: u64,
}
