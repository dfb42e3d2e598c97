//! The occlusion buffer (§6): the clamped opacity buffer under a separable box filter of the footprint's size.

use wgpu::{BindGroup, Buffer, ComputePass, Device, ShaderStages};

use crate::gpu::bindings::{ComputeStage, at_offset, storage, uniform};
use crate::gpu::layout::{Frame, SheetGroup, TileList};
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
            ("frames", uniform::<Frame>(stage, false)),
            ("sheet_group", uniform::<SheetGroup>(stage, true)),
            ("occluding", storage::<TileList>(stage, true)),
            ("source", storage::<u32>(stage, true)),
            ("result", storage::<u32>(stage, false)),
        ];
        let compile = |entry| ComputeStage::new(device, shaders::OCCLUDE, entry, &slots, &[]);
        Self { columns: compile("columns"), rows: compile("rows") }
    }

    /// Binds the opacity buffer and its two convolutions, with a frame and `[SheetGroup]`; `tiles` is the list of tiles to compute again.
    pub fn bind(
        &self,
        device: &Device,
        [frame, groups]: [&Buffer; 2],
        tiles: &Buffer,
        targets: &Targets,
    ) -> [BindGroup; 2] {
        let bind = |stage: &ComputeStage, source: &Buffer, result: &Buffer| {
            let whole = Buffer::as_entire_binding;
            let resources = [
                ("frames", whole(frame)),
                ("sheet_group", at_offset::<SheetGroup>(groups)),
                ("occluding", whole(tiles)),
                ("source", whole(source)),
                ("result", whole(result)),
            ];
            stage.bind(device, &resources)
        };
        [
            bind(&self.columns, &targets.opaque, &targets.opaque_columns),
            bind(&self.rows, &targets.opaque_columns, &targets.occluded),
        ]
    }

    /// Convolves in the listed tiles with the box of the group at `offset`.
    pub fn record(&self, pass: &mut ComputePass<'_>, [columns, rows]: &[BindGroup; 2], offset: u32, tiles: &Buffer) {
        self.columns.dispatch_indirect(pass, columns, &[offset], tiles);
        self.rows.dispatch_indirect(pass, rows, &[offset], tiles);
    }
}
