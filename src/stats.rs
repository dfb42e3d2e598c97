//! What a frame cost, counted as in Table 4.

use std::collections::BTreeMap;
use std::sync::mpsc::{Receiver, channel};

use serde::Serialize;
use wgpu::{Buffer, BufferAsyncError};

use crate::error::RenderError;
use crate::gpu::layout::Tally;
use crate::gpu::timer::stage_ms;

/// Milliseconds by stage.
pub type StageTimes = BTreeMap<&'static str, f64>;

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
    /// `quads` or `tiles`; `reference` for the reference backend.
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

/// The slabs that a frame's sheet groups consist of.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GroupSlabs {
    /// Every group's first slab, in the order groups are composited in.
    pub firsts: Vec<i32>,
    /// Sheets of a group.
    pub sheets: u32,
}

/// What of a frame's counts is known before it is drawn.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Totals {
    /// The totals; 0 for what only the GPU knows.
    pub counts: Counts,
    /// Of every sheet group how many of its sheets any kernel touches.
    pub group_sheets: Vec<u64>,
}

impl Totals {
    /// A drawn frame's counts, from what it left on the GPU: its tally, and the tiles composited by every group.
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

/// A frame's counts: a [`Tally`](crate::gpu::layout::Tally), for every group the tiles it composited, `[u32]`, and timestamps from `timestamps` on.
#[derive(Debug)]
pub(crate) struct Staging {
    pub(crate) buffer: Buffer,
    pub(crate) timestamps: u64,
    /// The stage of every pass that was timed.
    pub(crate) stages: Vec<&'static str>,
    /// Nanoseconds of a timestamp's tick.
    pub(crate) period: f32,
}

/// A frame's counts on their way from the GPU.
#[derive(Debug)]
pub struct PendingCounts {
    totals: Totals,
    staging: Staging,
    arrival: Receiver<Result<(), BufferAsyncError>>,
}

impl PendingCounts {
    /// Asks for the contents of `staging`, once what was submitted is done.
    pub(crate) fn new(totals: Totals, staging: Staging) -> Self {
        let (sender, arrival) = channel();
        staging.buffer.map_async(wgpu::MapMode::Read, .., move |result| {
            // Whoever gave up asking does not care.
            let _ = sender.send(result);
        });
        Self { totals, staging, arrival }
    }

    /// The counts, if the device was polled after the frame was done, and of a renderer that profiles also the GPU's milliseconds
    /// by stage. Never waits, and gives them once.
    ///
    /// # Errors
    /// If the device was lost meanwhile.
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
