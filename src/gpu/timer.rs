//! GPU time per stage, from timestamp queries at the beginning and end of every pass.

use std::collections::BTreeMap;

use wgpu::{
    Buffer, BufferUsages, CommandEncoder, ComputePassTimestampWrites, Device, Features, QuerySet,
    RenderPassTimestampWrites,
};

/// The number of passes timed by one query set.
const PASSES_PER_SET: usize = wgpu::QUERY_SET_MAX_QUERIES as usize / 2;

/// The size of a pass's two timestamps in bytes.
pub const PASS_BYTES: u64 = 2 * wgpu::QUERY_SIZE as u64;

/// The timestamps of a frame.
#[derive(Debug)]
pub struct Timer {
    sets: Vec<QuerySet>,
    results: Buffer,
    /// The stage of every pass so far.
    stages: Vec<&'static str>,
    passes: usize,
}

impl Timer {
    /// A timer for frames of at most `passes` passes; `None` if the device has no timestamp queries.
    pub fn new(device: &Device, passes: usize) -> Option<Self> {
        let set = |_| {
            device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("sheetsplat.timer"),
                ty: wgpu::QueryType::Timestamp,
                count: 2 * PASSES_PER_SET as u32,
            })
        };
        Self::estimate(device, passes).map(|size| Self {
            sets: (0..passes.div_ceil(PASSES_PER_SET)).map(set).collect(),
            results: device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("sheetsplat.timestamps"),
                size,
                usage: BufferUsages::QUERY_RESOLVE | BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            }),
            stages: Vec::new(),
            passes,
        })
    }

    /// What [`Self::gpu_bytes`] of such a timer will be.
    pub fn estimate(device: &Device, passes: usize) -> Option<u64> {
        let has_queries = device.features().contains(Features::TIMESTAMP_QUERY);
        has_queries.then(|| passes.next_multiple_of(PASSES_PER_SET) as u64 * PASS_BYTES)
    }

    /// Bytes of GPU memory, without that of the queries, which drivers do not report.
    pub fn gpu_bytes(&self) -> u64 {
        self.results.size()
    }

    /// Starts a new frame.
    pub fn restart(&mut self) {
        self.stages.clear();
    }

    /// Whether there is room for another pass.
    pub fn has_room(&self) -> bool {
        self.stages.len() < self.passes
    }

    fn next(&mut self, stage: &'static str) -> (&QuerySet, u32) {
        let at = self.stages.len();
        self.stages.push(stage);
        (&self.sets[at / PASSES_PER_SET], 2 * (at % PASSES_PER_SET) as u32)
    }

    /// Times the next compute pass.
    pub fn compute(&mut self, stage: &'static str) -> ComputePassTimestampWrites<'_> {
        let (query_set, at) = self.next(stage);
        ComputePassTimestampWrites {
            query_set,
            beginning_of_pass_write_index: Some(at),
            end_of_pass_write_index: Some(at + 1),
        }
    }

    /// Times the next render pass.
    pub fn render(&mut self, stage: &'static str) -> RenderPassTimestampWrites<'_> {
        let (query_set, at) = self.next(stage);
        RenderPassTimestampWrites {
            query_set,
            beginning_of_pass_write_index: Some(at),
            end_of_pass_write_index: Some(at + 1),
        }
    }

    /// Copies the frame's timestamps so far to `staging` from `offset` on, and returns the stage of each pass.
    pub fn copy(&self, encoder: &mut CommandEncoder, staging: &Buffer, offset: u64) -> Vec<&'static str> {
        let stages = self.stages.clone();
        for (at, (set, passes)) in self.sets.iter().zip(stages.chunks(PASSES_PER_SET)).enumerate() {
            let bytes = (at * PASSES_PER_SET) as u64 * PASS_BYTES;
            encoder.resolve_query_set(set, 0..2 * passes.len() as u32, &self.results, bytes);
        }
        encoder.copy_buffer_to_buffer(&self.results, 0, staging, offset, stages.len() as u64 * PASS_BYTES);
        stages
    }
}

/// Milliseconds per stage, from the timestamps of its passes; `period` is the nanoseconds per tick.
pub fn stage_ms(stages: &[&'static str], timestamps: &[[u64; 2]], period: f32) -> BTreeMap<&'static str, f64> {
    let mut sums = BTreeMap::new();
    for (&stage, &[begin, end]) in stages.iter().zip(timestamps) {
        *sums.entry(stage).or_insert(0.0) += end.saturating_sub(begin) as f64 * f64::from(period) * 1e-6;
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passes_of_a_stage_add_up() {
        let sums = stage_ms(&["cull", "splat", "cull"], &[[0, 1_000_000], [5, 5], [7, 500_007]], 2.0);
        assert_eq!(sums, BTreeMap::from([("cull", 3.0), ("splat", 0.0)]));
    }
}
