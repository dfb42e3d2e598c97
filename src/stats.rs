//! What a frame cost, counted as in Table 4.

use serde::Serialize;

/// Counts and times of one frame (SPEC §8). As JSON: the field names as keys.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Stats {
    /// The GPU, or the CPU for the reference backend.
    pub adapter: String,
    /// Its driver.
    pub driver: String,
    /// `vulkan`, `metal`, …, or `reference`.
    pub backend: String,
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// The frame's counts.
    #[serde(flatten)]
    pub counts: Counts,
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
    /// Voxels whose colour was computed for this frame.
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
    /// Quads drawn, each for one voxel and a group of sheets.
    pub quads: u64,
    /// Tests of a brick against a sheet group.
    pub bricks_tested: u64,
    /// Those of them whose voxels were looked at.
    pub bricks_visited: u64,
}
