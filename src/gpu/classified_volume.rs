//! A volume under a transfer function on the GPU: its values, the voxels that take part (§5.1), and their changes.

use std::sync::Arc;

use glam::UVec3;
use wgpu::{Device, Limits, Queue, TextureView};

use crate::after::brick_ranges::{Bearing, BrickRanges};
use crate::error::RenderError;
use crate::geometry::view_geometry::ViewGeometry;
use crate::gpu::brick_lists::{BrickLists, SettledBricks};
use crate::gpu::counts::{GroupSlabs, Totals};
use crate::gpu::gpu_volume::{Coefficients, GpuVolume};
use crate::gpu::volume_texture::OwnColors;
use crate::lists::brick::BrickList;
use crate::lists::classify::{classify, in_rows, takes_part};
use crate::lists::iso_range::ValueSet;
use crate::lists::quad_plan::{Overlaps, tile_grid};
use crate::lists::value_list::ValueList;
use crate::parallel::prelude::*;
use crate::settings::clip::ClippedVoxels;
use crate::settings::splatting::Classification;
use crate::settings::transfer_function::{LabelTables, Ramp, Tables, TransferFunction};
use crate::stats::Counts;
use crate::volume::{Grid, Volume};

/// The voxels of a volume that take part under a transfer function.
#[derive(Debug)]
pub struct ClassifiedVolume {
    volume: GpuVolume,
    transfer: TransferFunction,
    clipped: ClippedVoxels,
    pub(crate) lists: BrickLists,
    /// A counter of changes to the lists.
    pub(crate) revision: u64,
    classification: Classification,
    /// With [`Classification::After`] which bricks the lists hold, once a frame asked for them.
    shown: Option<ShownBricks>,
}

/// The bricks that may be drawn where values are classified after splatting (SPEC §9).
#[derive(Debug)]
struct ShownBricks {
    /// What they were found for.
    needs: BrickNeeds,
    ranges: BrickRanges,
    /// Whether each brick of the grid is drawn.
    are_shown: Vec<bool>,
}

/// What decides, beside the transfer function, which bricks may be drawn.
#[derive(Clone, Debug)]
pub(crate) struct BrickNeeds {
    /// How far from a brick voxels bear on what it shows.
    pub(crate) reach: UVec3,
    /// Where they are not the values.
    pub(crate) coefficients: Option<Arc<Coefficients>>,
    /// Which values bear on the image.
    pub(crate) bearing: Bearing,
}

impl PartialEq for BrickNeeds {
    fn eq(&self, other: &Self) -> bool {
        let same = match (&self.coefficients, &other.coefficients) {
            (Some(own), Some(others)) => Arc::ptr_eq(own, others),
            (own, others) => own.is_none() && others.is_none(),
        };
        (self.reach, self.bearing) == (other.reach, other.bearing) && same
    }
}

/// The effect of a change of transfer function or iso-ranges.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Touched {
    /// The number of voxels that newly take part.
    pub entered: u64,
    /// The number of voxels that no longer take part.
    pub left: u64,
    /// Whether all bricks must be uploaded again, because there is no room for the added ones.
    pub rebuilt: bool,
}

impl ClassifiedVolume {
    /// Uploads the bricks of the voxels that take part (SPEC §3) to the volume's device; with [`Classification::After`] the first frame does. The labels' tables are ignored
    /// if the volume is not segmented.
    pub fn new(
        device: &Device,
        volume: &GpuVolume,
        mut transfer: TransferFunction,
        clipped: ClippedVoxels,
        classification: Classification,
    ) -> Self {
        let voxels = volume.volume();
        keep_what_applies(voxels, &mut transfer);
        let is_after = classification == Classification::After;
        let taking_part = if is_after { Vec::new() } else { classify(voxels, &transfer, &clipped) };
        let lists = BrickLists::upload(device, voxels.grid(), &taking_part);
        Self { volume: volume.clone(), transfer, clipped, lists, revision: 0, classification, shown: None }
    }

    /// Changes what is listed: voxels that take part, or bricks around which values meet an opacity, which the next frame finds.
    pub(crate) fn set_classification(&mut self, classification: Classification) {
        if classification == self.classification {
            return;
        }
        let is_after = classification == Classification::After;
        let voxels = if is_after { Vec::new() } else { classify(self.volume(), &self.transfer, &self.clipped) };
        let grid = *self.grid();
        self.lists.replace(&grid, &voxels);
        self.revision += 1;
        (self.classification, self.shown) = (classification, None);
    }

    /// Lists the bricks that a frame may draw. A changed transfer function tests bricks anew; their values are looked at only where what a
    /// frame needs is new.
    pub(crate) fn show(&mut self, needs: &BrickNeeds) {
        if self.shown.as_ref().is_some_and(|shown| shown.needs == *needs) {
            return;
        }
        let shown = ShownBricks::new(self.volume(), &self.transfer, needs);
        let voxels = shown.voxels(self.volume());
        let grid = *self.grid();
        self.lists.replace(&grid, &voxels);
        self.revision += 1;
        self.shown = Some(shown);
    }

    /// What [`Self::show`] would list, in lists.
    pub(crate) fn settled_for(&self, limits: &Limits, needs: Option<&BrickNeeds>) -> SettledBricks {
        match needs {
            Some(needs) if self.shown.as_ref().is_none_or(|shown| shown.needs != *needs) => {
                let shown = ShownBricks::new(self.volume(), &self.transfer, needs);
                SettledBricks::of(limits, BrickList::new(self.grid(), &shown.voxels(self.volume())))
            }
            _ => self.lists.settled(limits),
        }
    }

    /// Uploads what has changed.
    ///
    /// # Errors
    /// If the volume's labels exceed the device's limits.
    pub(crate) fn flush(&mut self, device: &Device, queue: &Queue) -> Result<(), RenderError> {
        if self.shades_by_label() {
            self.volume.upload_labels(device, queue)?;
        }
        self.lists.flush(device, queue);
        Ok(())
    }

    /// The values on the GPU.
    pub(crate) fn values(&self) -> &TextureView {
        self.volume.values()
    }

    /// The first channel's colours of voxels' own.
    pub(crate) fn colors(&self) -> Option<OwnColors<'_>> {
        self.volume.colors()
    }

    /// Whether any voxel is a hole.
    pub(crate) fn has_holes(&self) -> bool {
        self.volume().channels().any(|channel| channel.holes() > 0)
    }

    /// The labels on the GPU, if shading needs them.
    pub(crate) fn labels(&self) -> Option<&TextureView> {
        self.volume.labels().filter(|_| self.shades_by_label())
    }

    /// Whether shading needs labels.
    pub(crate) fn shades_by_label(&self) -> bool {
        let is_alone = self.transfer.further.is_empty() && self.classification == Classification::Before;
        let matter = if is_alone { LabelTables::matter_to_shading } else { LabelTables::matter };
        self.transfer.labels.values().any(matter)
    }

    /// The volume.
    pub fn volume(&self) -> &Arc<Volume> {
        self.volume.volume()
    }

    /// The volume on the GPU, which other views may share.
    pub fn gpu_volume(&self) -> &GpuVolume {
        &self.volume
    }

    /// The volume's grid.
    pub fn grid(&self) -> &Grid {
        self.volume().grid()
    }

    /// The transfer function.
    pub fn transfer(&self) -> &TransferFunction {
        &self.transfer
    }

    /// The voxels sorted by value: [`GpuVolume::value_list`].
    pub fn value_list(&self) -> &ValueList {
        self.volume.value_list()
    }

    /// Changes colours, opacities, gradient opacity, iso-ranges or the labels' tables (§5.1). Only voxels that enter or leave are touched: those
    /// whose values become visible or transparent, found by binary search. If the gradient opacity changes, all voxels in range must be
    /// examined. The labels' tables are ignored if the volume is not segmented.
    pub fn set_transfer_function(&mut self, mut transfer: TransferFunction) -> Touched {
        keep_what_applies(self.volume(), &mut transfer);
        if self.classification == Classification::After {
            self.transfer = transfer;
            return self.look_at_bricks();
        }
        if !self.volume().further().is_empty() {
            self.transfer = transfer;
            return self.look_at((0..self.volume().values().len() as u32).collect());
        }
        let labels = self.transfer.labels.keys().chain(transfer.labels.keys()).copied().map(Some);
        let mut labels: Vec<Option<u16>> = labels.chain([None]).collect();
        labels.sort_unstable();
        labels.dedup();
        // Voxels with other labels are examined too, without effect.
        let changed = (labels.into_iter())
            .map(|label| changed_values(&self.transfer.tables(label), &transfer.tables(label)))
            .fold(ValueSet::default(), |all, values| all.union(&values));
        let candidates = if changed.ranges().is_empty() {
            Vec::new()
        } else {
            let mut candidates = self.value_list().within(self.volume().values(), &changed);
            // In memory order neighbours share cache lines.
            candidates.par_sort_unstable();
            candidates
        };
        self.transfer = transfer;

        self.look_at(candidates)
    }

    /// Changes which voxels are clipped; touches only those that enter or leave.
    pub fn set_clip(&mut self, clipped: ClippedVoxels) -> Touched {
        if self.classification == Classification::After {
            // Planes outside of a cut bear on slabs inside.
            self.clipped = clipped;
            return Touched::default();
        }
        let volume = self.volume();
        let candidates = in_rows(volume, |y, z, row| {
            let [old, new] = [&self.clipped, &clipped].map(|clipped| clipped.in_row(y, z, volume.dims().x));
            // Either range may be empty, anywhere.
            let changed =
                (old.start.min(new.start)..old.end.max(new.end)).filter(|x| old.contains(x) != new.contains(x));
            changed.map(|x| row + x).collect()
        });
        self.clipped = clipped;
        self.look_at(candidates)
    }

    /// Lets bricks enter and leave that must.
    fn look_at_bricks(&mut self) -> Touched {
        let Some(mut shown) = self.shown.take() else { return Touched::default() };
        let volume = Arc::clone(self.volume());
        let new = shown.ranges.shown(&volume, &self.transfer, shown.needs.bearing);
        let old = std::mem::replace(&mut shown.are_shown, new);
        let new = &shown.are_shown;
        let entering = shown.ranges.voxels(&volume, |brick| new[brick] && !old[brick]);
        let leaving = shown.ranges.voxels(&volume, |brick| old[brick] && !new[brick]);
        self.shown = Some(shown);
        self.change(&entering, &leaving)
    }

    fn change(&mut self, entering: &[u32], leaving: &[u32]) -> Touched {
        if !entering.is_empty() || !leaving.is_empty() {
            self.lists.change(entering, leaving);
            self.revision += 1;
        }
        Touched { entered: entering.len() as u64, left: leaving.len() as u64, rebuilt: !self.lists.has_room() }
    }

    /// Decides for some voxels, in memory order, whether they enter or leave.
    fn look_at(&mut self, candidates: Vec<u32>) -> Touched {
        // The closures get no types of wgpu, which in a browser belong to one thread.
        let (volume, transfer, clipped) = (&**self.volume(), &self.transfer, &self.clipped);
        let lists = self.lists.list();
        let takes_part =
            |index: u32| clipped.contain(volume.grid().voxel_at(index)) && takes_part(volume, transfer, index);
        let (entering, leaving): (Vec<u32>, Vec<u32>) = (candidates.into_par_iter())
            .filter(|&index| takes_part(index) != lists.contains(index))
            .partition(|&index| !lists.contains(index));
        self.change(&entering, &leaving)
    }

    /// Changes only the iso-ranges: closed intervals `[lo, hi]` of the values that take part, `None` for all. Touches the same voxels as
    /// [`Self::set_transfer_function`].
    pub fn set_iso_ranges(&mut self, iso_ranges: Option<Vec<[f64; 2]>>) -> Touched {
        self.set_transfer_function(TransferFunction { iso_ranges, ..self.transfer.clone() })
    }

    /// Shows or hides the voxels of a label. Touches the same voxels as [`Self::set_transfer_function`], and none if the volume is not
    /// segmented.
    pub fn set_label_visible(&mut self, label: u16, visible: bool) -> Touched {
        let mut transfer = self.transfer.clone();
        transfer.labels.entry(label).or_default().visible = visible;
        self.set_transfer_function(transfer)
    }

    /// Bytes of GPU memory that the volume will use once prepared.
    pub(crate) fn estimate(&self) -> Result<u64, RenderError> {
        let [values, both] = self.volume.needs()?;
        let has_labels = self.shades_by_label() || self.volume.labels().is_some();
        Ok(if has_labels { both } else { values })
    }

    /// Bytes of GPU memory, including the volume's, which other views may share ([`GpuVolume::gpu_bytes`]).
    pub fn gpu_bytes(&self) -> u64 {
        self.volume.gpu_bytes() + self.lists.gpu_bytes()
    }

    /// The counts of a frame (Table 4) that are known before it is drawn.
    pub fn totals(&self, view: &ViewGeometry, groups: &GroupSlabs) -> Totals {
        let is_after = self.classification == Classification::After;
        let of_bricks = if is_after { Overlaps::count_planes } else { Overlaps::count };
        let overlaps = self.lists.bricks().map(|bricks| of_bricks(bricks, view));
        let Overlaps { voxels, sections, slabs } = overlaps.fold(Overlaps::default(), Overlaps::and);
        // Some sheets of the first or last group may lie outside every kernel.
        let sheets_of = |first: i32| {
            (first + groups.sheets as i32).min(slabs.end).saturating_sub(first.max(slabs.start)).max(0) as u64
        };
        let [columns, rows] = tile_grid(view.size).map(u64::from);
        // Composite-every-sample has no groups, and no sheets.
        let sheets = if groups.firsts.is_empty() { 0 } else { slabs.len() as u64 };
        let counts = Counts {
            voxels_total: self.grid().dims.as_u64vec3().element_product(),
            voxels_in_range: voxels,
            sections_total: sections,
            sheets,
            tiles_total: columns * rows * sheets,
            ..Counts::default()
        };
        Totals { counts, group_sheets: groups.firsts.iter().map(|&first| sheets_of(first)).collect() }
    }
}

impl ShownBricks {
    fn new(volume: &Volume, transfer: &TransferFunction, needs: &BrickNeeds) -> Self {
        let coefficients = needs.coefficients.as_ref().map_or(volume.values(), |exact| &exact.values);
        let ranges = BrickRanges::new(volume.grid(), coefficients, needs.reach);
        Self { needs: needs.clone(), are_shown: ranges.shown(volume, transfer, needs.bearing), ranges }
    }

    fn voxels(&self, volume: &Volume) -> Vec<u32> {
        let are_shown = &self.are_shown;
        self.ranges.voxels(volume, |brick| are_shown[brick])
    }
}

/// Drops the tables of labels of a volume without labels, and the transfer functions of channels that it does not have.
fn keep_what_applies(volume: &Volume, transfer: &mut TransferFunction) {
    if volume.labels().is_none() {
        transfer.labels.clear();
    }
    transfer.further.truncate(volume.further().len());
}

/// The values of voxels that may enter or leave when their tables change.
fn changed_values(old: &Tables, new: &Tables) -> ValueSet {
    let is_everywhere =
        |ramp: Option<&Ramp<f64>>| ramp.is_none_or(|ramp| ramp.points().iter().all(|&(_, opacity)| opacity > 0.0));
    let gradients = [old.gradient_opacity, new.gradient_opacity];
    let same_gradients = gradients[0] == gradients[1] || gradients.into_iter().all(is_everywhere);
    let values = [old, new].map(ValueSet::of_tables);
    match same_gradients {
        true => values[0].symmetric_difference(&values[1]),
        false => values[0].union(&values[1]),
    }
}
