//! A prepared frame: the buffers that recording needs, some of which the next frame can reuse.

use wgpu::{BindGroup, Buffer, CommandEncoder, Texture, TextureFormat, TextureView};

use crate::error::RenderError;
use crate::geometry::view_geometry::ViewGeometry;
use crate::gpu::classified_volume::Layer;
use crate::gpu::counts::{GroupSlabs, Staging, Totals};
use crate::gpu::layout::Band;
use crate::gpu::targets::CompositingBuffer;
use crate::gpu::timer::Timer;
use crate::pass::join::JoinMode;
use crate::rasterizer::carried::Carried;
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
    /// The channels that share sheets: all, or one by one (SPEC §10).
    pub(crate) layers: Vec<PreparedLayer>,
    /// Why it is drawn by quads although tiles were preferred.
    pub(crate) fallback: Option<RenderError>,
    /// That of the layer that is drawn.
    pub(crate) compositing: CompositingBuffer,
    /// The image of all layers, if there are several.
    pub(crate) joined: Option<Joined>,
    pub(crate) resolve_groups: Vec<BindGroup>,
    /// The planes and surfaces that cut rays.
    pub(crate) cut: Buffer,
    /// The depths of first hits, if requested.
    pub(crate) first_hits: Option<FirstHits>,
    pub(crate) timer: Option<Timer>,
    /// The totals of every layer, counted when first requested.
    pub(crate) totals: Option<Vec<Totals>>,
    /// The staging buffer for a recorded frame's counts; `None` once they have been requested.
    pub(crate) staging: Option<Staging>,
    pub(crate) gpu_bytes: u64,
}

/// Channels that share sheets.
#[derive(Debug)]
pub(crate) struct PreparedLayer {
    pub(crate) layer: Layer,
    pub(crate) drawing: Drawing,
    pub(crate) uniform: Buffer,
    pub(crate) control_points: Buffer,
}

/// The sum, or the nearest, of the images of several layers.
#[derive(Debug)]
pub(crate) struct Joined {
    pub(crate) mode: JoinMode,
    pub(crate) compositing: CompositingBuffer,
    /// One word per pixel, or a single one if first hits are not asked for.
    pub(crate) hits: Buffer,
    /// The frame's constants for its resolving.
    pub(crate) uniform: Buffer,
    /// For every layer a bind group for each band.
    pub(crate) groups: Vec<Vec<BindGroup>>,
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
    /// None if there were other layers.
    pub(crate) layers: Vec<PreviousLayer>,
    pub(crate) compositing: Option<CompositingBuffer>,
    pub(crate) joined: Option<Joined>,
    pub(crate) cut: Option<Buffer>,
    /// The texture is kept so that a host that bound it need not bind it again.
    pub(crate) first_hits: Option<Texture>,
    pub(crate) totals: Option<Vec<Totals>>,
    /// The staging buffer, if nobody is waiting for its counts.
    pub(crate) staging: Option<Buffer>,
}

/// The parts of a layer that the next frame may reuse.
#[derive(Debug, Default)]
pub(crate) struct PreviousLayer {
    pub(crate) drawing: Option<Drawing>,
    pub(crate) uniform: Option<Buffer>,
    pub(crate) control_points: Option<Buffer>,
}

impl PreviousFrame {
    /// The reusable parts for a frame of `view` in these layers and bands, drawn into sheets of this format and number.
    pub(crate) fn of(
        frame: Option<PreparedFrame>,
        sheets: (TextureFormat, u32),
        view: &ViewGeometry,
        (layers, bands): (&[Layer], &[Band]),
    ) -> Self {
        let Some(old) = frame else { return Self::default() };
        let same_size = old.compositing.size == view.size;
        let has_bands = |buffer: &CompositingBuffer| same_size && buffer.bands.iter().map(|band| &band.band).eq(bands);
        let same_layers = old.layers.iter().map(|layer| &layer.layer).eq(layers);
        // Another renderer may have used other sheets.
        let same_sheets = old.sheets == sheets;
        let of_layer = |PreparedLayer { drawing, uniform, control_points, .. }| PreviousLayer {
            drawing: same_sheets.then_some(drawing),
            uniform: Some(uniform),
            control_points: Some(control_points),
        };
        Self {
            layers: if same_layers { old.layers.into_iter().map(of_layer).collect() } else { Vec::new() },
            compositing: Some(old.compositing).filter(has_bands),
            joined: old.joined.filter(|joined| has_bands(&joined.compositing)),
            cut: Some(old.cut),
            first_hits: old.first_hits.filter(|_| same_size).map(|hits| hits.texture),
            totals: old.totals.filter(|_| old.view == *view && same_layers),
            staging: old.staging.map(|staging| staging.buffer),
        }
    }
}

impl PreparedFrame {
    /// Bytes of GPU memory that the frame and its volume use.
    pub(crate) fn gpu_bytes(&self) -> u64 {
        self.gpu_bytes
    }

    /// The only layer's drawing, or the first one's.
    pub(crate) fn first_drawing(&self) -> Option<&Drawing> {
        self.layers.first().map(|layer| &layer.drawing)
    }
}

impl PreparedLayer {
    /// Bytes of GPU memory.
    pub(crate) fn gpu_bytes(&self) -> u64 {
        self.drawing.gpu_bytes() + self.uniform.size() + self.control_points.size()
    }
}

impl Joined {
    /// Bytes of GPU memory.
    pub(crate) fn gpu_bytes(&self) -> u64 {
        self.compositing.gpu_bytes() + self.hits.size() + self.uniform.size()
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

    /// Copies the frame's counts to a place in `staging`.
    pub(crate) fn copy_counts(&self, encoder: &mut CommandEncoder, staging: &Buffer, at: u64) {
        match self {
            Self::Quads(frame) => frame.copy_counts(encoder, staging, at),
            Self::Fields(frame) => frame.copy_counts(encoder, staging, at),
            Self::Tiles(frame) => frame.copy_counts(encoder, staging, at),
            Self::Samples(frame) => frame.copy_counts(encoder, staging, at),
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

    /// What pixels carry from plane to plane where values are classified after splatting.
    pub(crate) fn carried(&self) -> Option<&Carried> {
        match self {
            Self::Fields(frame) => Some(frame.carried()),
            Self::Tiles(frame) => frame.carried(),
            Self::Quads(_) | Self::Samples(_) => None,
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
