//! The statistics of a frame, with the counts of Table 4.

use std::collections::BTreeMap;

use serde::Serialize;

pub use sheetsplat_volume::StoreCounts;

/// Milliseconds per stage.
pub type StageTimes = BTreeMap<&'static str, f64>;

/// Counts and times of one frame (SPEC §8). The field names are the keys in JSON.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
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
    /// The number of rows.
    pub height: u32,
    /// The frame's counts.
    #[serde(flatten)]
    pub counts: Counts,
    /// What was read of a store (SPEC §13), if the volume is one that was streamed, or comes from a Zarr store and was drawn by a
    /// [`Headless`](crate::headless::Headless).
    #[serde(flatten)]
    pub store: Option<StoreCounts>,
    /// `quads` or `tiles`; for other backends their name.
    pub rasterizer: String,
    /// GPU milliseconds per stage, from a renderer that profiles on a device with timestamp queries.
    #[serde(skip_serializing_if = "StageTimes::is_empty")]
    pub stages_ms: StageTimes,
    /// Bytes of GPU memory that the frame uses.
    pub gpu_bytes: u64,
    /// The largest resident set of the process until then, in MiB, if the program measured it: where a volume is streamed, on systems that tell.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub peak_rss_mib: Option<f64>,
    /// Milliseconds of the frame in which light sheets were made (SPEC §14), little where they were kept; only where there are any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub light_ms: Option<f64>,
    /// Bytes of memory that they take.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub light_bytes: Option<u64>,
    /// The level that light is made of where the volume is streamed, and of which voxel of it along each axis every how manieth; only where there is any light.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub light_level: Option<u64>,
    /// See [`Self::light_level`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub light_stride: Option<u64>,
    /// Milliseconds to load or make the volume.
    pub load_ms: f64,
    /// Milliseconds to classify, bucket and upload.
    pub prepare_ms: f64,
    /// Milliseconds to draw the frame and read it back.
    pub frame_ms: f64,
}

/// The counts of a frame (Table 4).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct Counts {
    /// Voxels in the volume.
    pub voxels_total: u64,
    /// Voxels that take part (SPEC §3); of a volume that is streamed and classified after splatting 0, like their sections, as nobody counts them.
    pub voxels_in_range: u64,
    /// Voxels whose colour was computed for this frame. Each counts once, although the tile rasterizer computes it again for every tile,
    /// and for every group where more lies behind a tile than it remembers.
    pub voxels_shaded: u64,
    /// Voxel–slab overlaps of positive length, anywhere on or off the screen.
    pub sections_total: u64,
    /// The sections that were drawn.
    pub sections_rasterized: u64,
    /// Slabs from the first to the last that any kernel touches.
    pub sheets: u64,
    /// The number of 32×32 tiles in the image times the number of sheets.
    pub tiles_total: u64,
    /// The tiles that were composited.
    pub tiles_composited: u64,
    /// Quads drawn, each for one voxel and a group of sheets; 0 for the tile rasterizer.
    pub quads: u64,
    /// Tests of a brick against a sheet group; 0 for the tile rasterizer, which tests voxels.
    pub bricks_tested: u64,
    /// Bricks whose voxels were visited; by the tile rasterizer again for every tile and group.
    pub bricks_visited: u64,
}

impl Counts {
    /// Adds those of another channel that was drawn by itself (SPEC §10).
    pub(crate) fn add_channel(&mut self, other: &Self) {
        let Self { voxels_total: _, voxels_in_range, voxels_shaded, sections_total, sections_rasterized, .. } = self;
        let Self { sheets, tiles_total, tiles_composited, quads, bricks_tested, bricks_visited, .. } = *other;
        *voxels_in_range += other.voxels_in_range;
        *voxels_shaded += other.voxels_shaded;
        *sections_total += other.sections_total;
        *sections_rasterized += other.sections_rasterized;
        self.sheets += sheets;
        self.tiles_total += tiles_total;
        self.tiles_composited += tiles_composited;
        self.quads += quads;
        self.bricks_tested += bricks_tested;
        self.bricks_visited += bricks_visited;
    }
}
