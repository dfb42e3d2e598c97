//! Composites a group of sheet buffers into the compositing buffer (eq. 2) and marks opaque pixels.

use std::sync::OnceLock;

use wgpu::{BindGroup, BindingResource, Buffer, ComputePass, Device, ShaderStages, TextureView, TextureViewDimension};

use crate::gpu::bindings::{ComputeStage, Slot, at_offset, depth_texture, storage, texture, uniform};
use crate::gpu::layout::{Band, Cut, Frame, SheetGroup, TileList};
use crate::gpu::shaders;
use crate::gpu::targets::{BandBuffer, Targets};
use crate::settings::splatting::Compositing;

/// The stage's pipelines, each compiled when it is first needed.
#[derive(Debug, Default)]
pub struct Composite {
    /// Indexed by compositing, and by one bit for each other property of the mode.
    stages: [OnceLock<ComputeStage>; Compositing::COUNT << 2],
}

/// The mode that a pipeline is compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct CompositeMode {
    /// How sheets are composited.
    pub compositing: Compositing,
    /// Which properties of rays count.
    pub rays: RayMode,
}

/// Which properties of pixels' rays a compositing stage needs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct RayMode {
    /// Whether clip planes or a host's surfaces cut them.
    pub cut: bool,
    /// Whether first hits are noted.
    pub first_hit: bool,
}

/// The buffers for cutting rays.
#[derive(Clone, Copy, Debug)]
pub struct CutBuffers<'a> {
    /// One [`Cut`].
    pub uniform: &'a Buffer,
    /// A host's depth texture; any depth texture if the host gives no surfaces.
    pub surfaces: &'a TextureView,
}

/// The stage's buffers.
#[derive(Clone, Copy, Debug)]
pub struct CompositeBuffers<'a> {
    /// One [`Frame`].
    pub frame: &'a Buffer,
    /// One [`SheetGroup`] at every dynamic offset.
    pub groups: &'a Buffer,
    /// The sheet buffers.
    pub sheets: &'a TextureView,
    /// The list of tiles to composite.
    pub tiles: &'a Buffer,
    /// Opacity buffers.
    pub targets: &'a Targets,
    /// The buffers for cutting rays.
    pub cut: CutBuffers<'a>,
    /// First hits, `[u32]`.
    pub hits: &'a Buffer,
}

impl<'a> CompositeBuffers<'a> {
    /// The resources of [`slots`] for a band of the compositing buffer.
    pub(super) fn resources(&self, band: &'a BandBuffer) -> [(&'static str, BindingResource<'a>); 12] {
        let Self { frame, groups, sheets, tiles, targets, cut, hits } = *self;
        [
            ("frames", frame.as_entire_binding()),
            ("band", band.uniform.as_entire_binding()),
            ("sheets", BindingResource::TextureView(sheets)),
            ("acc", band.acc.as_entire_binding()),
            ("composited", tiles.as_entire_binding()),
            ("opaque", targets.opaque.as_entire_binding()),
            ("opaque_tiles", targets.opaque_tiles.as_entire_binding()),
            ("sheet_group", at_offset::<SheetGroup>(groups)),
            ("cuts", cut.uniform.as_entire_binding()),
            ("surfaces", BindingResource::TextureView(cut.surfaces)),
            ("hits", hits.as_entire_binding()),
            ("last_groups", targets.last_groups.as_entire_binding()),
        ]
    }
}

/// The bindings of every shader that composites.
pub(super) fn slots() -> [(&'static str, Slot); 12] {
    let stage = ShaderStages::COMPUTE;
    [
        ("frames", uniform::<Frame>(stage, false)),
        ("band", uniform::<Band>(stage, false)),
        ("sheets", texture(stage, TextureViewDimension::D2Array)),
        ("acc", storage::<[f32; 4]>(stage, false)),
        ("composited", storage::<TileList>(stage, true)),
        ("opaque", storage::<u32>(stage, false)),
        ("opaque_tiles", storage::<u32>(stage, false)),
        ("sheet_group", uniform::<SheetGroup>(stage, true)),
        ("cuts", uniform::<Cut>(stage, false)),
        ("surfaces", depth_texture(stage)),
        ("hits", storage::<u32>(stage, false)),
        ("last_groups", storage::<u32>(stage, false)),
    ]
}

impl CompositeMode {
    /// The pipeline constants of every shader that composites.
    pub(super) fn constants(self) -> [(&'static str, f64); 3] {
        [
            ("COMPOSITING", f64::from(self.compositing as u32)),
            ("CUT", f64::from(u8::from(self.rays.cut))),
            ("FIRST_HIT", f64::from(u8::from(self.rays.first_hit))),
        ]
    }
}

impl Composite {
    fn stage(&self, CompositeMode { compositing, rays }: CompositeMode) -> &OnceLock<ComputeStage> {
        let bits = [rays.cut, rays.first_hit].map(usize::from);
        &self.stages[bits.into_iter().fold(compositing as usize, |number, bit| 2 * number + bit)]
    }

    fn compiled(&self, device: &Device, mode: CompositeMode) -> &ComputeStage {
        self.stage(mode)
            .get_or_init(|| ComputeStage::new(device, shaders::COMPOSITE, "main", &slots(), &mode.constants()))
    }

    /// Binds a band of the compositing buffer.
    pub fn bind(
        &self,
        device: &Device,
        mode: CompositeMode,
        buffers: CompositeBuffers<'_>,
        band: &BandBuffer,
    ) -> BindGroup {
        self.compiled(device, mode).bind(device, &buffers.resources(band))
    }

    /// Composites the listed tiles of every band for the group at `offset`.
    pub fn record(
        &self,
        pass: &mut ComputePass<'_>,
        mode: CompositeMode,
        bands: &[BindGroup],
        offset: u32,
        tiles: &Buffer,
    ) {
        let Some(stage) = self.stage(mode).get() else { return };
        for band in bands {
            stage.dispatch_indirect(pass, band, &[offset], tiles);
        }
    }
}
