//! A volume under a transfer function, on the GPU: its values, the voxels that take part (§5.1), and how those change.

use std::sync::{Arc, OnceLock};

use rayon::prelude::*;
use wgpu::{Device, Queue};

use crate::classify::{classify, takes_part};
use crate::error::RenderError;
use crate::gpu::brick_lists::BrickLists;
use crate::gpu::volume_texture::VolumeTexture;
use crate::iso_range::ValueSet;
use crate::plan::{Overlaps, tile_grid};
use crate::stats::{Counts, GroupSlabs, Totals};
use crate::transfer_function::{Ramp, TransferFunction};
use crate::value_list::ValueList;
use crate::view::View;
use crate::volume::{Grid, Volume};

/// The voxels of a volume that take part under a transfer function.
#[derive(Debug)]
pub struct ClassifiedVolume {
    volume: Arc<Volume>,
    transfer: TransferFunction,
    values: ValueSet,
    list: OnceLock<ValueList>,
    pub(crate) texture: VolumeTexture,
    pub(crate) lists: BrickLists,
    /// Counts changes of the lists.
    pub(crate) revision: u64,
}

/// What a change of transfer function or iso-ranges touched.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Touched {
    /// Voxels that take part now and did not before.
    pub entered: u64,
    /// Voxels that took part before and do not now.
    pub left: u64,
    /// Whether all bricks must be uploaded again, as there is no room for those that came.
    pub rebuilt: bool,
}

impl ClassifiedVolume {
    /// Uploads a volume's values, and the bricks of the voxels that take part (SPEC §3).
    ///
    /// # Errors
    /// If the volume is larger than the device's textures.
    pub fn new(
        device: &Device,
        queue: &Queue,
        volume: Arc<Volume>,
        transfer: TransferFunction,
    ) -> Result<Self, RenderError> {
        let texture = VolumeTexture::upload(device, queue, volume.values())?;
        let lists = BrickLists::upload(device, volume.grid(), &classify(&volume, &transfer));
        let values = ValueSet::of(&transfer);
        Ok(Self { volume, transfer, values, list: OnceLock::new(), texture, lists, revision: 0 })
    }

    /// The volume.
    pub fn volume(&self) -> &Arc<Volume> {
        &self.volume
    }

    /// Where the voxels are.
    pub fn grid(&self) -> &Grid {
        self.volume.grid()
    }

    /// The transfer function.
    pub fn transfer(&self) -> &TransferFunction {
        &self.transfer
    }

    /// The voxels sorted by value (Table 1), for every later change. Sorted when first asked for, so that a single frame need not
    /// wait for it; a program with iso-ranges to move asks when it has loaded the volume.
    pub fn value_list(&self) -> &ValueList {
        self.list.get_or_init(|| ValueList::new(self.volume.values()))
    }

    /// Changes colours, opacities, gradient opacity or iso-ranges (§5.1). Only voxels that enter or leave are touched: those
    /// whose values gain or lose their opacity, found by binary search. Where the gradient opacity changes, all that are in range
    /// must be looked at.
    pub fn set_transfer_function(&mut self, transfer: TransferFunction) -> Touched {
        let values = ValueSet::of(&transfer);
        let is_everywhere = |ramp: &Option<Ramp<f64>>| {
            ramp.as_ref().is_none_or(|ramp| ramp.points().iter().all(|&(_, opacity)| opacity > 0.0))
        };
        let gradients = [&transfer.gradient_opacity, &self.transfer.gradient_opacity];
        let same_gradients = gradients[0] == gradients[1] || gradients.into_iter().all(is_everywhere);
        let candidates = if same_gradients && values == self.values {
            Vec::new()
        } else {
            let set = match same_gradients {
                true => values.symmetric_difference(&self.values),
                false => values.union(&self.values),
            };
            let mut candidates = self.value_list().within(self.volume.values(), &set);
            // In memory order, where neighbours share cache lines.
            candidates.par_sort_unstable();
            candidates
        };
        (self.transfer, self.values) = (transfer, values);

        let (volume, transfer, lists) = (&*self.volume, &self.transfer, &self.lists);
        let (entering, leaving): (Vec<u32>, Vec<u32>) = (candidates.into_par_iter())
            .filter(|&index| takes_part(volume, transfer, index) != lists.contains(index))
            .partition(|&index| !lists.contains(index));
        if !entering.is_empty() || !leaving.is_empty() {
            self.lists.change(&entering, &leaving);
            self.revision += 1;
        }
        Touched { entered: entering.len() as u64, left: leaving.len() as u64, rebuilt: !self.lists.has_room() }
    }

    /// Changes the iso-ranges alone: closed intervals `[lo, hi]` of the values that take part, `None` for all. Touches what
    /// [`Self::set_transfer_function`] does.
    pub fn set_iso_ranges(&mut self, iso_ranges: Option<Vec<[f64; 2]>>) -> Touched {
        self.set_transfer_function(TransferFunction { iso_ranges, ..self.transfer.clone() })
    }

    /// Bytes of GPU memory.
    pub fn gpu_bytes(&self) -> u64 {
        self.texture.gpu_bytes + self.lists.gpu_bytes()
    }

    /// What of a frame's counts (Table 4) is known before it is drawn.
    pub fn totals(&self, view: &View, groups: &GroupSlabs) -> Totals {
        let overlaps = self.lists.bricks().map(|bricks| Overlaps::count(bricks, view));
        let Overlaps { voxels, sections, slabs } = overlaps.fold(Overlaps::default(), Overlaps::and);
        // A group's first or last sheets can lie outside of what any kernel touches.
        let sheets_of = |first: i32| {
            (first + groups.sheets as i32).min(slabs.end).saturating_sub(first.max(slabs.start)).max(0) as u64
        };
        let [columns, rows] = tile_grid(view.size).map(u64::from);
        let counts = Counts {
            voxels_total: self.grid().dims.as_u64vec3().element_product(),
            voxels_in_range: voxels,
            sections_total: sections,
            sheets: slabs.len() as u64,
            tiles_total: columns * rows * slabs.len() as u64,
            ..Counts::default()
        };
        Totals { counts, group_sheets: groups.firsts.iter().map(|&first| sheets_of(first)).collect() }
    }
}
