//! A prepared frame: the buffers that recording needs, some of which the next frame can reuse.

use wgpu::{BindGroup, Buffer, CommandEncoder, Texture, TextureFormat, TextureView};

use crate::error::RenderError;
use crate::geometry::view_geometry::ViewGeometry;
use crate::gpu::counts::{GroupSlabs, Staging, Totals};
use crate::gpu::targets::CompositingBuffer;
use crate::gpu::timer::Timer;
use crate::rasterizer::fields::FieldFrame;
use crate::rasterizer::quads::QuadFrame;
use crate::rasterizer::samples::SampleFrame;
use crate::rasterizer::tiles::TileFrame;

/// A frame whose buffers are all allocated and filled, so that recording it cannot fail.
#[derive(Debug)]
pub(crate) struct PreparedFrame {
    /// The format and number of the sheets of the renderer that prepared it.
    pub(crate) sheets: (TextureFormat, u32),
    pub(crate) view: ViewGeometry,
    pub(crate) drawing: Drawing,
    /// Why it is drawn by quads although tiles were preferred.
    pub(crate) fallback: Option<RenderError>,
    pub(crate) compositing: CompositingBuffer,
    pub(crate) uniform: Buffer,
    pub(crate) control_points: Buffer,
    pub(crate) resolve_groups: Vec<BindGroup>,
    /// The planes and surfaces that cut rays.
    pub(crate) cut: Buffer,
    /// The depths of first hits, if requested.
    pub(crate) first_hits: Option<FirstHits>,
    pub(crate) timer: Option<Timer>,
    /// The totals, counted when first requested.
    pub(crate) totals: Option<Totals>,
    /// The staging buffer for a recorded frame's counts; `None` once they have been requested.
    pub(crate) staging: Option<Staging>,
    pub(crate) gpu_bytes: u64,
}

/// The depths of first hits.
#[derive(Debug)]
pub(crate) struct FirstHits {
    pub(crate) texture: Texture,
    pub(crate) view: TextureView,
    pub(crate) group: BindGroup,
}

/// A rasterizer's part of a frame.
#[derive(Debug)]
pub(crate) enum Drawing {
    Quads(Box<QuadFrame>),
    Fields(Box<FieldFrame>),
    Tiles(Box<TileFrame>),
    Samples(Box<SampleFrame>),
}

/// The parts of a view's last frame that the next one may reuse.
#[derive(Debug, Default)]
pub(crate) struct PreviousFrame {
    pub(crate) drawing: Option<Drawing>,
    pub(crate) compositing: Option<CompositingBuffer>,
    pub(crate) uniform: Option<Buffer>,
    pub(crate) control_points: Option<Buffer>,
    pub(crate) cut: Option<Buffer>,
    /// The texture is kept so that a host that bound it need not bind it again.
    pub(crate) first_hits: Option<Texture>,
    pub(crate) totals: Option<Totals>,
    /// The staging buffer, if nobody is waiting for its counts.
    pub(crate) staging: Option<Buffer>,
}

impl PreviousFrame {
    /// The reusable parts for a frame of `view`, drawn into sheets of this format and number.
    pub(crate) fn of(frame: Option<PreparedFrame>, sheets: (TextureFormat, u32), view: &ViewGeometry) -> Self {
        let Some(old) = frame else { return Self::default() };
        let same_size = old.compositing.size == view.size;
        Self {
            // Another renderer may have used other sheets.
            drawing: (old.sheets == sheets).then_some(old.drawing),
            compositing: same_size.then_some(old.compositing),
            uniform: Some(old.uniform),
            control_points: Some(old.control_points),
            cut: Some(old.cut),
            first_hits: old.first_hits.filter(|_| same_size).map(|hits| hits.texture),
            totals: old.totals.filter(|_| old.view == *view),
            staging: old.staging.map(|staging| staging.buffer),
        }
    }
}

impl PreparedFrame {
    /// Bytes of GPU memory that the frame and its volume use.
    pub(crate) fn gpu_bytes(&self) -> u64 {
        self.gpu_bytes
    }
}

impl Drawing {
    /// The number of timed passes.
    pub(crate) fn passes(&self) -> usize {
        match self {
            Self::Quads(frame) => frame.passes(),
            Self::Fields(frame) => frame.passes(),
            Self::Tiles(_) => TileFrame::PASSES,
            Self::Samples(_) => SampleFrame::PASSES,
        }
    }

    /// The slabs of the sheet groups, in compositing order.
    pub(crate) fn group_slabs(&self) -> GroupSlabs {
        match self {
            Self::Quads(frame) => frame.group_slabs(),
            Self::Fields(frame) => frame.group_slabs(),
            Self::Tiles(frame) => frame.group_slabs(),
            Self::Samples(frame) => frame.group_slabs(),
        }
    }

    /// Copies the frame's counts to the start of `staging`.
    pub(crate) fn copy_counts(&self, encoder: &mut CommandEncoder, staging: &Buffer) {
        match self {
            Self::Quads(frame) => frame.copy_counts(encoder, staging),
            Self::Fields(frame) => frame.copy_counts(encoder, staging),
            Self::Tiles(frame) => frame.copy_counts(encoder, staging),
            Self::Samples(frame) => frame.copy_counts(encoder, staging),
        }
    }

    /// The buffer with the words of first hits, and their byte offset in it; samples have none.
    pub(crate) fn first_hits(&self) -> Option<(&Buffer, u64)> {
        match self {
            Self::Quads(frame) => Some(frame.first_hits()),
            Self::Fields(frame) => Some(frame.first_hits()),
            Self::Tiles(frame) => Some(frame.first_hits()),
            Self::Samples(_) => None,
        }
    }

    /// Bytes of GPU memory.
    pub(crate) fn gpu_bytes(&self) -> u64 {
        match self {
            Self::Quads(frame) => frame.gpu_bytes(),
            Self::Fields(frame) => frame.gpu_bytes(),
            Self::Tiles(frame) => frame.gpu_bytes(),
            Self::Samples(frame) => frame.gpu_bytes(),
        }
    }

    /// `"quads"` or `"tiles"`.
    pub(crate) fn rasterizer(&self) -> &'static str {
        match self {
            Self::Quads(_) | Self::Fields(_) | Self::Samples(_) => "quads",
            Self::Tiles(_) => "tiles",
        }
    }
}
