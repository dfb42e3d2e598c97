//! The sizes and contents of a frame's buffers.

use wgpu::BufferUsages;

use crate::gpu::bindings::{BufferSpec, buffer_spec, content_spec};
use crate::gpu::classified_volume::ClassifiedVolume;
use crate::gpu::layout::{Cut, Frame};
use crate::gpu::shown_bricks::BrickNeeds;
use crate::gpu::timer::PASS_BYTES;
use crate::gpu::uniforms;
use crate::rasterizer::request::FrameRequest;
use crate::scene::Scene;

/// What decides which bricks a frame draws whose values are classified after splatting.
pub(super) fn needs_of(request: &FrameRequest) -> Option<&BrickNeeds> {
    request.after.as_ref().map(|after| &after.needs)
}

pub(super) fn frame_uniform() -> BufferSpec {
    content_spec("sheetsplat.frame", size_of::<Frame>() as u64, BufferUsages::UNIFORM)
}

pub(super) fn cut_uniform() -> BufferSpec {
    content_spec("sheetsplat.cut", size_of::<Cut>() as u64, BufferUsages::UNIFORM)
}

pub(super) fn control_points(request: &FrameRequest) -> BufferSpec {
    let bytes = size_of_val(&request.ramps.points[..]) as u64;
    content_spec("sheetsplat.control_points", bytes, BufferUsages::STORAGE)
}

/// The frame's constants for a request.
pub(super) fn frame_values(volume: &ClassifiedVolume, request: &FrameRequest, scene: &Scene) -> Frame {
    let values = (volume.grid(), volume.gpu_volume().value_format());
    uniforms::frame(request.stage_view(), &request.kernel, values, &request.ramps, scene)
}

/// The first hits of all layers, one word per pixel, or a single one if they are not asked for.
pub(super) fn joined_hits(first: &FrameRequest) -> BufferSpec {
    let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST;
    buffer_spec("sheetsplat.joined_hits", first.hit_bytes().max(4), usage)
}

/// The byte offset of the timestamps behind counts.
pub(super) fn timestamps_at(count_bytes: u64) -> u64 {
    count_bytes.next_multiple_of(8)
}

/// The buffer for counts, followed by the timestamps of `passes` passes if they are timed.
pub(super) fn staging(timestamps: u64, timed: bool, passes: usize) -> BufferSpec {
    let bytes = timestamps + if timed { passes as u64 * PASS_BYTES } else { 0 };
    buffer_spec("sheetsplat.counts", bytes, BufferUsages::COPY_DST | BufferUsages::MAP_READ)
}
