//! A frame's counts on their way from the GPU.

use std::sync::mpsc::{Receiver, channel};

use wgpu::{Buffer, BufferAsyncError};

use crate::error::RenderError;
use crate::gpu::layout::Tally;
use crate::gpu::timer::stage_ms;
use crate::stats::{Counts, StageTimes};

/// The slabs that a frame's sheet groups consist of.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct GroupSlabs {
    /// Every group's first slab, in compositing order.
    pub(crate) firsts: Vec<i32>,
    /// The number of sheets in a group.
    pub(crate) sheets: u32,
}

/// The counts of a frame that are known before it is drawn.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Totals {
    /// The totals; 0 for counts that only the GPU knows.
    pub(crate) counts: Counts,
    /// For every sheet group, the number of its sheets that any kernel touches.
    pub(crate) group_sheets: Vec<u64>,
}

impl Totals {
    /// The counts of a drawn frame, from its tally and the number of tiles that each group composited.
    pub(crate) fn count(&self, tally: &Tally, tiles: &[u32]) -> Counts {
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

/// A frame's counts in GPU memory: for every layer a [`Tally`](crate::gpu::layout::Tally) and the number of composited tiles per group
/// (`[u32]`), and timestamps from `timestamps` on.
#[derive(Debug)]
pub(crate) struct Staging {
    pub(crate) buffer: Buffer,
    pub(crate) timestamps: u64,
    /// The stages of the timed passes.
    pub(crate) stages: Vec<&'static str>,
    /// Nanoseconds per timestamp tick.
    pub(crate) period: f32,
}

/// The bytes of a layer's counts with a number of groups.
pub(crate) fn count_bytes(groups: usize) -> u64 {
    size_of::<Tally>() as u64 + groups as u64 * 4
}

/// A frame's counts that are being read back from the GPU.
#[derive(Debug)]
pub struct PendingCounts {
    /// Those of every layer.
    totals: Vec<Totals>,
    staging: Staging,
    arrival: Receiver<Result<(), BufferAsyncError>>,
}

impl PendingCounts {
    /// Requests the contents of `staging` once the submitted work is done.
    pub(crate) fn new(totals: Vec<Totals>, staging: Staging) -> Self {
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
        self.arrival.try_recv().ok().map(|news| self.arrived(news))
    }

    /// Where the device tells, once it was polled after the frame was done, that [`Self::arrived`] has them. Another thread that polled it, too, may be the
    /// one that brings this news.
    pub(crate) fn arrival(&self) -> &Receiver<Result<(), BufferAsyncError>> {
        &self.arrival
    }

    /// The counts, after this news.
    pub(crate) fn arrived(&self, news: Result<(), BufferAsyncError>) -> Result<(Counts, StageTimes), RenderError> {
        let failed = |reason: String| RenderError::Readback(reason);
        news.map_err(|error| failed(error.to_string()))?;
        let Staging { buffer, timestamps, stages, period } = &self.staging;
        let bytes = buffer.get_mapped_range(..).map_err(|error| failed(error.to_string()))?;
        let (counts, times) = bytes.split_at(*timestamps as usize);
        let mut rest = counts;
        let mut of_layer = |totals: &Totals| {
            let (own, others) = rest.split_at(count_bytes(totals.group_sheets.len()) as usize);
            let (tally, tiles) = own.split_at(size_of::<Tally>());
            rest = others;
            totals.count(&bytemuck::pod_read_unaligned(tally), &bytemuck::pod_collect_to_vec(tiles))
        };
        let mut layers = self.totals.iter();
        let mut counts = layers.next().map(&mut of_layer).unwrap_or_default();
        layers.for_each(|totals| counts.add_channel(&of_layer(totals)));
        Ok((counts, stage_ms(stages, &bytemuck::pod_collect_to_vec(times), *period)))
    }
}
