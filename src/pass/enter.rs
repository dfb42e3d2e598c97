//! Voxels that enter the iso-ranges take their places in the list (§5.1).

use wgpu::{BindGroup, Buffer, ComputePass, Device, ShaderStages};

use crate::gpu::bindings::{ComputeStage, storage};
use crate::gpu::layout::{Entry, Voxel};
use crate::gpu::shaders;

/// The stage's pipeline.
#[derive(Debug)]
pub struct Enter {
    stage: ComputeStage,
}

/// Voxels that are to enter a list.
#[derive(Debug)]
pub struct Entering {
    group: BindGroup,
    workgroups: u32,
}

impl Enter {
    /// Compiles the stage.
    pub fn new(device: &Device) -> Self {
        let stage = ShaderStages::COMPUTE;
        let slots = [storage::<Entry>(stage, true), storage::<Voxel>(stage, false)];
        Self { stage: ComputeStage::new(device, shaders::ENTER, "main", &slots, &[]) }
    }

    /// Binds `[Entry]` and a list's `[Voxel]`.
    pub fn bind(&self, device: &Device, entries: &Buffer, voxels: &Buffer) -> Entering {
        let group = self.stage.bind(device, &[entries, voxels].map(Buffer::as_entire_binding));
        Entering { group, workgroups: (entries.size() / size_of::<Entry>() as u64).div_ceil(64) as u32 }
    }

    /// Writes the voxels.
    pub fn record(&self, pass: &mut ComputePass<'_>, entering: &Entering) {
        self.stage.dispatch(pass, &entering.group, &[], entering.workgroups);
    }
}
