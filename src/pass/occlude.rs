//! The occlusion buffer (§6): the cut-off opacity buffer under a separable box filter of the footprint's size.

use wgpu::{BindGroup, Buffer, ComputePass, Device, ShaderStages};

use crate::gpu::bindings::{ComputeStage, storage, uniform};
use crate::gpu::layout::{Frame, TileList};
use crate::gpu::shaders;
use crate::gpu::targets::Targets;

/// The two directions' pipelines.
#[derive(Debug)]
pub struct Occlude {
    columns: ComputeStage,
    rows: ComputeStage,
}

impl Occlude {
    /// Compiles the stage.
    pub fn new(device: &Device) -> Self {
        let stage = ShaderStages::COMPUTE;
        let slots = [
            uniform::<Frame>(stage, false),
            storage::<TileList>(stage, true),
            storage::<u32>(stage, true),
            storage::<u32>(stage, false),
        ];
        let compile = |entry| ComputeStage::new(device, shaders::OCCLUDE, entry, &slots, &[]);
        Self { columns: compile("columns"), rows: compile("rows") }
    }

    /// Binds the opacity buffer and its two convolutions; `tiles` is the list of tiles to compute anew.
    pub fn bind(&self, device: &Device, frame: &Buffer, tiles: &Buffer, targets: &Targets) -> [BindGroup; 2] {
        let bind = |stage: &ComputeStage, source: &Buffer, result: &Buffer| {
            stage.bind(device, &[frame, tiles, source, result].map(Buffer::as_entire_binding))
        };
        [
            bind(&self.columns, &targets.opaque, &targets.opaque_columns),
            bind(&self.rows, &targets.opaque_columns, &targets.occluded),
        ]
    }

    /// Convolves in the listed tiles.
    pub fn record(&self, pass: &mut ComputePass<'_>, [columns, rows]: &[BindGroup; 2], tiles: &Buffer) {
        self.columns.dispatch_indirect(pass, columns, &[], tiles);
        self.rows.dispatch_indirect(pass, rows, &[], tiles);
    }
}
