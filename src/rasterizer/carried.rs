//! What pixels carry from plane to plane where values are classified after splatting (SPEC §9); `shaders/shared/slab.wgsl` describes the records.

use wgpu::{Buffer, BufferUsages, CommandEncoder};

use super::FrameInputs;
use crate::after::normalization::Normalization;
use crate::error::RenderError;
use crate::gpu::bindings::{BufferSpec, buffer_spec, grown};
use crate::gpu::layout::Band;
use crate::pass::classify::CARRIED_BYTES;
use crate::rasterizer::request::FrameRequest;

/// The records of a frame's pixels.
#[derive(Debug)]
pub(crate) struct Carried {
    /// One buffer for every band of the compositing buffer.
    pub(crate) bands: Vec<Buffer>,
    /// The records of a pixel.
    pub(crate) records: u32,
    /// The bytes of each that a frame starts without.
    cleared: Vec<u64>,
    /// The map from values to numbers in the first channel, with the range of its coefficients.
    pub(crate) numbers: Normalization,
}

impl Carried {
    /// Allocates buffers that no longer fit, with room for `more` records of a pixel that need not be cleared.
    ///
    /// # Errors
    /// If they exceed the device's maximum size of buffers.
    pub(crate) fn prepare(
        FrameInputs { device, request, .. }: FrameInputs<'_>,
        numbers: Normalization,
        more: u32,
        old: Option<Self>,
    ) -> Result<Self, RenderError> {
        let mut old = old.map(|old| old.bands).unwrap_or_default().into_iter();
        let bands =
            Self::specs(request, more).map(|spec| grown(device, old.next(), &spec)).collect::<Result<_, _>>()?;
        Ok(Self {
            bands,
            records: request.records(),
            cleared: Self::specs(request, 0).map(|spec| spec.size).collect(),
            numbers,
        })
    }

    /// The specs of the buffers.
    pub(crate) fn specs(request: &FrameRequest, more: u32) -> impl Iterator<Item = BufferSpec> {
        let (width, records) = (u64::from(request.view.size[0]), u64::from(request.records() + more));
        request.bands.iter().map(move |&Band { rows, .. }| {
            let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
            buffer_spec("sheetsplat.carried", width * u64::from(rows) * records * CARRIED_BYTES, usage)
        })
    }

    /// Clears the records for a frame.
    pub(crate) fn clear(&self, encoder: &mut CommandEncoder) {
        self.bands.iter().zip(&self.cleared).for_each(|(band, &bytes)| encoder.clear_buffer(band, 0, Some(bytes)));
    }

    /// Bytes of GPU memory.
    pub(crate) fn gpu_bytes(&self) -> u64 {
        self.bands.iter().map(Buffer::size).sum()
    }
}
