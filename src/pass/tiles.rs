//! Tiles (§6): where a sheet group composites, and where the occlusion buffer changes.

use wgpu::{BindGroup, Buffer, BufferUsages, ComputePass, Device, ShaderStages};

use crate::error::RenderError;
use crate::gpu::bindings::{BufferSpec, ComputeStage, at_offset, buffer_spec, grown, storage, uniform};
use crate::gpu::layout::{Culled, Frame, SheetGroup, TileList};
use crate::gpu::shaders;
use crate::gpu::targets::Targets;

/// The stage's pipeline.
#[derive(Debug)]
pub struct Tiles {
    stage: ComputeStage,
}

/// The lists of the current sheet group, and its bind group. A list is a [`TileList`].
#[derive(Debug)]
pub struct TileLists {
    /// Tiles to composite.
    pub composited: Buffer,
    /// Tiles of the occlusion buffer to compute again.
    pub occluding: Buffer,
    /// `[u32]`: the number of tiles that every group composited.
    pub counts: Buffer,
    group: BindGroup,
}

impl Tiles {
    /// Compiles the stage.
    pub fn new(device: &Device) -> Self {
        Self::compiled(device, false)
    }

    /// Compiles the stage for groups that are single planes (SPEC §9).
    pub fn of_planes(device: &Device) -> Self {
        Self::compiled(device, true)
    }

    fn compiled(device: &Device, planes: bool) -> Self {
        let stage = ShaderStages::COMPUTE;
        let slots = [
            ("frames", uniform::<Frame>(stage, false)),
            ("sheet_group", uniform::<SheetGroup>(stage, true)),
            ("culled", storage::<Culled>(stage, false)),
            ("opaque_tiles", storage::<u32>(stage, true)),
            ("composited", storage::<TileList>(stage, false)),
            ("occluding", storage::<TileList>(stage, false)),
            ("counts", storage::<u32>(stage, false)),
            ("last_groups", storage::<u32>(stage, true)),
        ];
        let constants = [("PLANE", f64::from(u8::from(planes)))];
        Self { stage: ComputeStage::new(device, shaders::TILES, "main", &slots, &constants) }
    }

    /// The specs for `tiles` tiles and `group_count` groups, in [`TileLists`]' order.
    pub fn buffer_specs(tiles: u32, group_count: usize) -> [BufferSpec; 3] {
        let list_bytes = size_of::<TileList>() as u64 + u64::from(tiles) * 4;
        let (storage, indirect) = (BufferUsages::STORAGE, BufferUsages::STORAGE | BufferUsages::INDIRECT);
        let count_bytes = group_count.max(1) as u64 * 4;
        [
            buffer_spec("sheetsplat.composited_tiles", list_bytes, indirect),
            buffer_spec("sheetsplat.occluding_tiles", list_bytes, indirect),
            buffer_spec("sheetsplat.tile_counts", count_bytes, storage | BufferUsages::COPY_SRC),
        ]
    }

    /// Allocates the lists for a frame of `group_count` groups, or reuses those of the `previous` frame.
    ///
    /// # Errors
    /// If they exceed the device's maximum size of buffers.
    pub fn prepare(
        &self,
        device: &Device,
        [frame, groups, culled]: [&Buffer; 3],
        targets: &Targets,
        group_count: usize,
        previous: Option<TileLists>,
    ) -> Result<TileLists, RenderError> {
        let [old_composited, old_occluding, old_counts] =
            previous.map_or([None, None, None], |old| [old.composited, old.occluding, old.counts].map(Some));
        let [composited, occluding, counts] = Self::buffer_specs(targets.tiles(), group_count);
        let composited = grown(device, old_composited, &composited)?;
        let occluding = grown(device, old_occluding, &occluding)?;
        let counts = grown(device, old_counts, &counts)?;
        let resources = [
            ("frames", frame.as_entire_binding()),
            ("sheet_group", at_offset::<SheetGroup>(groups)),
            ("culled", culled.as_entire_binding()),
            ("opaque_tiles", targets.opaque_tiles.as_entire_binding()),
            ("composited", composited.as_entire_binding()),
            ("occluding", occluding.as_entire_binding()),
            ("counts", counts.as_entire_binding()),
            ("last_groups", targets.last_groups.as_entire_binding()),
        ];
        let group = self.stage.bind(device, &resources);
        Ok(TileLists { composited, occluding, counts, group })
    }

    /// Lists the tiles of the group at `offset`.
    pub fn record(&self, pass: &mut ComputePass<'_>, lists: &TileLists, offset: u32) {
        self.stage.dispatch(pass, &lists.group, &[offset], 1);
    }
}
