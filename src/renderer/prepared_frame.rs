//! A prepared frame: the buffers that recording needs, and what of them the next frame can take over.

use wgpu::{BindGroup, Buffer, CommandEncoder, Texture, TextureFormat, TextureView};

use crate::error::RenderError;
use crate::geometry::view_geometry::ViewGeometry;
use crate::gpu::targets::CompositingBuffer;
use crate::gpu::timer::Timer;
use crate::rasterizer::fields::FieldFrame;
use crate::rasterizer::quads::QuadFrame;
use crate::rasterizer::samples::SampleFrame;
use crate::rasterizer::tiles::TileFrame;
use crate::stats::{GroupSlabs, Staging, Totals};

/// A frame whose buffers are all allocated and filled: recording it cannot fail.
#[derive(Debug)]
pub(crate) struct PreparedFrame {
    /// Format and number of the sheets of the renderer that prepared it.
    pub(crate) sheets: (TextureFormat, u32),
    pub(crate) view: ViewGeometry,
    pub(crate) drawing: Drawing,
    /// Why it is drawn by quads, where tiles were to draw it if they could.
    pub(crate) fallback: Option<RenderError>,
    pub(crate) compositing: CompositingBuffer,
    pub(crate) uniform: Buffer,
    pub(crate) control_points: Buffer,
    pub(crate) resolve_groups: Vec<BindGroup>,
    /// What cuts rays.
    pub(crate) cut: Buffer,
    /// If they were asked for.
    pub(crate) first_hits: Option<FirstHits>,
    pub(crate) timer: Option<Timer>,
    /// Counted when first asked for.
    pub(crate) totals: Option<Totals>,
    /// Where a recorded frame leaves its counts; gone when somebody waits for them.
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

/// What of a view's last frame the next one may take over.
#[derive(Debug, Default)]
pub(crate) struct PreviousFrame {
    pub(crate) drawing: Option<Drawing>,
    pub(crate) compositing: Option<CompositingBuffer>,
    pub(crate) uniform: Option<Buffer>,
    pub(crate) control_points: Option<Buffer>,
    pub(crate) cut: Option<Buffer>,
    /// So that a host that bound it need not bind it again.
    pub(crate) first_hits: Option<Texture>,
    pub(crate) totals: Option<Totals>,
    /// If nobody waits for the counts in it.
    pub(crate) staging: Option<Buffer>,
}

impl PreviousFrame {
    /// For a frame of `view`, drawn into sheets of such a format and number.
    pub(crate) fn of(frame: Option<PreparedFrame>, sheets: (TextureFormat, u32), view: &ViewGeometry) -> Self {
        let Some(old) = frame else { return Self::default() };
        let same_size = old.compositing.size == view.size;
        Self {
            // That of another renderer may have other sheets.
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
    /// Bytes of GPU memory that the frame and its volume hold.
    pub(crate) fn gpu_bytes(&self) -> u64 {
        self.gpu_bytes
    }
}

impl Drawing {
    /// Passes that are timed.
    pub(crate) fn passes(&self) -> usize {
        match self {
            Self::Quads(frame) => frame.passes(),
            Self::Fields(frame) => frame.passes(),
            Self::Tiles(_) => TileFrame::PASSES,
            Self::Samples(_) => SampleFrame::PASSES,
        }
    }

    /// The slabs of the sheet groups, in the order they are composited in.
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

    /// The words of first hits, and where in their buffer they start, bytes; samples have none.
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
