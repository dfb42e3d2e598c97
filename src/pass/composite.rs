//! Composites a group of sheet buffers into the compositing buffer (eq. 2) and notes opaque pixels.

use wgpu::{BindGroup, Buffer, ComputePass, Device, ShaderStages, TextureView, TextureViewDimension};

use crate::gpu::bindings::{ComputeStage, storage, texture, uniform};
use crate::gpu::layout::{Band, Frame, TileList};
use crate::gpu::shaders;
use crate::gpu::targets::{BandBuffer, Targets};

/// The stage's pipeline.
#[derive(Debug)]
pub struct Composite {
    stage: ComputeStage,
}

impl Composite {
    /// Compiles the stage.
    pub fn new(device: &Device) -> Self {
        let stage = ShaderStages::COMPUTE;
        let slots = [
            uniform::<Frame>(stage, false),
            uniform::<Band>(stage, false),
            texture(stage, TextureViewDimension::D2Array),
            storage::<[f32; 4]>(stage, false),
            storage::<TileList>(stage, true),
            storage::<u32>(stage, false),
            storage::<u32>(stage, false),
        ];
        Self { stage: ComputeStage::new(device, shaders::COMPOSITE, "main", &slots, &[]) }
    }

    /// Binds a band of the compositing buffer; `tiles` is the list of tiles to composite.
    pub fn bind(
        &self,
        device: &Device,
        frame: &Buffer,
        band: &BandBuffer,
        sheets: &TextureView,
        tiles: &Buffer,
        targets: &Targets,
    ) -> BindGroup {
        let resources = [
            frame.as_entire_binding(),
            band.uniform.as_entire_binding(),
            wgpu::BindingResource::TextureView(sheets),
            band.acc.as_entire_binding(),
            tiles.as_entire_binding(),
            targets.opaque.as_entire_binding(),
            targets.opaque_tiles.as_entire_binding(),
        ];
        self.stage.bind(device, &resources)
    }

    /// Composites the listed tiles of every band.
    pub fn record(&self, pass: &mut ComputePass<'_>, bands: &[BindGroup], tiles: &Buffer) {
        for band in bands {
            self.stage.dispatch_indirect(pass, band, &[], tiles);
        }
    }
}
