//! The rasterizers, which draw bricks into the compositing buffer. Each holds its stages' pipelines, prepares its part of a frame, and
//! records it.

pub(crate) mod carried;
pub(crate) mod fields;
pub(crate) mod kind;
mod patch_ranges;
pub(crate) mod quads;
pub(crate) mod request;
pub(crate) mod samples;
mod search_passes;
mod sheet_groups;
pub(crate) mod tiles;

use wgpu::{Buffer, BufferUsages, ComputePassDescriptor, Device, Queue, TextureView};

use crate::error::RenderError;
use crate::geometry::footprint::FootprintTable;
use crate::gpu::bindings::filled;
use crate::gpu::brick_lists::BrickLists;
use crate::gpu::classified_volume::ClassifiedVolume;
use crate::gpu::footprint_texture::FootprintTexture;
use crate::gpu::layout::Brick;
use crate::gpu::targets::CompositingBuffer;
use crate::gpu::timer::Timer;
use crate::gpu::volume_texture::OwnColors;
use crate::kernel::Kernel;
use crate::pass::composite::CutBuffers;
use crate::rasterizer::request::FrameRequest;
use crate::settings::splatting::FootprintForm;

/// The work that [`Renderer::prepare`](crate::renderer::Renderer::prepare) did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Prepared {
    /// Whether bricks were sorted into buckets.
    pub bucketed: bool,
    /// Whether a footprint table was made: for another kernel, or for another slab width in the sections form (§3.3.1).
    pub tabled: bool,
}

/// The inputs from which a rasterizer prepares a frame.
#[derive(Clone, Copy)]
pub(crate) struct FrameInputs<'a> {
    pub(crate) device: &'a Device,
    pub(crate) queue: &'a Queue,
    pub(crate) volume: &'a ClassifiedVolume,
    pub(crate) request: &'a FrameRequest,
    /// One [`Frame`](crate::gpu::layout::Frame).
    pub(crate) frame: &'a Buffer,
    /// The control points of the ramps.
    pub(crate) control_points: &'a Buffer,
    pub(crate) compositing: &'a CompositingBuffer,
    pub(crate) cut: CutBuffers<'a>,
    /// The light sheets, if there are any (SPEC §14).
    pub(crate) light: Option<&'a TextureView>,
}

/// The resources that a rasterizer's part of a frame needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FrameEstimate {
    /// Bytes of GPU memory.
    pub(crate) bytes: u64,
    /// The number of sheet groups.
    pub(crate) groups: usize,
    /// The number of timed passes.
    pub(crate) passes: usize,
}

impl<'a> FrameInputs<'a> {
    /// The lists of the channels that are drawn.
    fn lists(&self) -> &'a [BrickLists] {
        &self.volume.lists[self.request.layer.lists.clone()]
    }

    /// The only one of these lists, where one splat draws a voxel in all channels.
    fn list(&self) -> &'a BrickLists {
        &self.volume.lists[self.request.layer.lists.start]
    }

    /// The bricks of every buffer of these lists.
    fn bricks(&self) -> impl Iterator<Item = &'a [Brick]> {
        self.lists().iter().flat_map(BrickLists::bricks)
    }

    /// The colours of voxels' own, if a channel that is drawn has any.
    fn colors(&self) -> Option<OwnColors<'a>> {
        self.volume.colors(&self.request.layer)
    }

    /// The coefficients of all channels, where they are not the values.
    ///
    /// # Errors
    /// Those of [`Coefficients::texture`](crate::gpu::coefficients::Coefficients::texture).
    fn coefficients(&self) -> Result<Option<&'a TextureView>, RenderError> {
        let Some(after) = &self.request.after else { return Ok(None) };
        let exact = after.needs.coefficients.as_ref();
        exact.map(|exact| exact.texture(self.device, self.queue)).transpose()
    }

    /// What is splatted for these colours: themselves or their coefficients.
    ///
    /// # Errors
    /// As for [`Self::coefficients`].
    fn splatted_colors(&self) -> Result<Option<OwnColors<'a>>, RenderError> {
        let smooth = self.colors();
        match self.request.after.as_ref().and_then(|after| after.needs.coefficients.as_ref()) {
            Some(exact) if smooth.is_some() => {
                let view = exact.color_texture(self.device, self.queue)?;
                Ok(view.map(|view| OwnColors { view, full: 1 }))
            }
            _ => Ok(smooth),
        }
    }

    /// The labels, if shading needs them.
    fn labels(&self) -> Option<&'a TextureView> {
        self.volume.labels(&self.request.layer)
    }

    /// The gradients of the membership of labels, if shading needs them.
    fn membership(&self) -> Option<&'a TextureView> {
        self.volume.membership()
    }

    /// As [`filled`](bindings::filled).
    fn filled(
        &self,
        old: Option<Buffer>,
        label: &'static str,
        bytes: &[u8],
        usage: BufferUsages,
    ) -> Result<Buffer, RenderError> {
        filled(self.device, self.queue, old, label, bytes, usage)
    }
}

/// A footprint table, with the kernel and, for the sections form, the slab width that it was made for.
#[derive(Debug)]
pub(crate) struct Footprints {
    pub(crate) texture: FootprintTexture,
    kernel: Kernel,
    width: Option<f64>,
}

impl Footprints {
    /// The old table if it is still valid, or else a new one; also whether it is new.
    pub(crate) fn renewed(old: Option<Self>, inputs: FrameInputs<'_>) -> (Self, bool) {
        let FrameRequest { splatting, kernel, view, .. } = inputs.request;
        let (form, kernel) = (splatting.footprint, *kernel);
        // The summed-area form serves every width (§3.3.1).
        let width = view.section_width();
        let of = (form == FootprintForm::Sections).then_some(width);
        let fits = |old: &Self| (old.texture.form, old.kernel, old.width) == (form, kernel, of);
        if let Some(old) = old.filter(fits) {
            return (old, false);
        }
        let table = FootprintTable::new(form, &kernel, width);
        (Self { texture: FootprintTexture::upload(inputs.device, inputs.queue, &table), kernel, width: of }, true)
    }
}

/// A compute pass, which is timed if there is a timer.
pub(crate) fn compute<'a>(
    label: &'a str,
    timer: &'a mut Option<Timer>,
    stage: &'static str,
) -> ComputePassDescriptor<'a> {
    let timestamp_writes = timer.as_mut().map(|timer| timer.compute(stage));
    ComputePassDescriptor { label: Some(label), timestamp_writes }
}
