//! The statistics of a frame, with the counts of Table 4.

use std::collections::BTreeMap;
use std::sync::mpsc::{Receiver, channel};

use serde::Serialize;
use wgpu::{Buffer, BufferAsyncError};

use crate::error::RenderError;
use crate::gpu::layout::Tally;
use crate::gpu::timer::stage_ms;

/// Milliseconds per stage.
pub type StageTimes = BTreeMap<&'static str, f64>;

/// Counts and times of one frame (SPEC §8). The field names are the keys in JSON.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Stats {
    /// The name of the GPU, or of the CPU for the reference backend.
    pub adapter: String,
    /// Its driver.
    pub driver: String,
    /// The graphics API (`vulkan`, `metal`, …), or `reference`.
    pub backend: String,
    /// Pixels per row.
    pub width: u32,
    /// The number of rows.
    pub height: u32,
    /// The frame's counts.
    #[serde(flatten)]
    pub counts: Counts,
    /// The rasterizer, `quads` or `tiles`; `reference` for the reference backend.
    pub rasterizer: String,
    /// GPU milliseconds per stage, from a renderer that profiles on a device with timestamp queries.
    #[serde(skip_serializing_if = "StageTimes::is_empty")]
    pub stages_ms: StageTimes,
    /// Bytes of GPU memory that the frame uses.
    pub gpu_bytes: u64,
    /// Milliseconds to load or make the volume.
    pub load_ms: f64,
    /// Milliseconds to classify, bucket and upload.
    pub prepare_ms: f64,
    /// Milliseconds to draw the frame and read it back.
    pub frame_ms: f64,
}

/// The counts of a frame (Table 4).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Voxels in the volume.
    pub voxels_total: u64,
    /// Voxels that take part (SPEC §3).
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

/// The slabs that a frame's sheet groups consist of.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GroupSlabs {
    /// Every group's first slab, in compositing order.
    pub firsts: Vec<i32>,
    /// The number of sheets in a group.
    pub sheets: u32,
}

/// The counts of a frame that are known before it is drawn.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Totals {
    /// The totals; 0 for counts that only the GPU knows.
    pub counts: Counts,
    /// For every sheet group, the number of its sheets that any kernel touches.
    pub group_sheets: Vec<u64>,
}

impl Totals {
    /// The counts of a drawn frame, from its tally and the number of tiles that each group composited.
    pub fn count(&self, tally: &Tally, tiles: &[u32]) -> Counts {
        Counts {
            voxels_shaded: tally.voxels_shaded.into(),
            sections_rasterized: tally.sections_rasterized.into(),
            tiles_composited: self
                .group_sheets
                .iter()
                .zip(tiles)
                .map(|(sheets, &tiles)| sheets * u64::from(tiles))
                .sum(),
            quads: tally.quads.into(),
            bricks_tested: tally.bricks_tested.into(),
            bricks_visited: tally.bricks_visited.into(),
            ..self.counts
        }
    }
}

/// A frame's counts in GPU memory: a [`Tally`](crate::gpu::layout::Tally), the number of composited tiles per group (`[u32]`), and
/// timestamps from `timestamps` on.
#[derive(Debug)]
pub(crate) struct Staging {
    pub(crate) buffer: Buffer,
    pub(crate) timestamps: u64,
    /// The stages of the timed passes.
    pub(crate) stages: Vec<&'static str>,
    /// Nanoseconds per timestamp tick.
    pub(crate) period: f32,
}

/// A frame's counts that are being read back from the GPU.
#[derive(Debug)]
pub struct PendingCounts {
    totals: Totals,
    staging: Staging,
    arrival: Receiver<Result<(), BufferAsyncError>>,
}

impl PendingCounts {
    /// Requests the contents of `staging` once the submitted work is done.
    pub(crate) fn new(totals: Totals, staging: Staging) -> Self {
        let (sender, arrival) = channel();
        staging.buffer.map_async(wgpu::MapMode::Read, .., move |result| {
            // The receiver may have been dropped.
            let _ = sender.send(result);
        });
        Self { totals, staging, arrival }
    }

    /// The counts, and from a renderer that profiles the GPU's milliseconds per stage, if the device was polled after the frame was done.
    /// Never waits, and returns them once.
    ///
    /// # Errors
    /// If the device was lost in the meantime.
    pub fn try_get(&self) -> Option<Result<(Counts, StageTimes), RenderError>> {
        let failed = |reason: String| RenderError::Readback(reason);
        let result = self.arrival.try_recv().ok()?;
        Some(result.map_err(|error| failed(error.to_string())).and_then(|()| {
            let Staging { buffer, timestamps, stages, period } = &self.staging;
            let bytes = buffer.get_mapped_range(..).map_err(|error| failed(error.to_string()))?;
            let (counts, times) = bytes.split_at(*timestamps as usize);
            let (tally, tiles) = counts.split_at(size_of::<Tally>());
            let tally = bytemuck::pod_read_unaligned(tally);
            let counts = self.totals.count(&tally, &bytemuck::pod_collect_to_vec(tiles));
            Ok((counts, stage_ms(stages, &bytemuck::pod_collect_to_vec(times), *period)))
        }))
    }
}
