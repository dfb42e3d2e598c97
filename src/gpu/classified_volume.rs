//! A volume under a transfer function on the GPU: its values, the voxels that take part (§5.1), and their changes.

use std::ops::Range;
use std::sync::Arc;

use wgpu::{Device, Limits, Queue, TextureView};

use crate::error::RenderError;
use crate::geometry::view_geometry::ViewGeometry;
use crate::gpu::brick_lists::{BrickLists, SettledBricks};
use crate::gpu::counts::{GroupSlabs, Totals};
use crate::gpu::gpu_volume::GpuVolume;
use crate::gpu::membership::{self, Shaded};
use crate::gpu::ramps::Stored;
use crate::gpu::shown_bricks::{BrickNeeds, ShownBricks, opaque_values};
use crate::gpu::volume_texture::{OwnColors, Pages, VolumeTexture};
use crate::image::channels::Joining;
use crate::lists::brick::BrickList;
use crate::lists::classify::{TakingPart, brick_list, channels, in_rows};
use crate::lists::iso_range::ValueSet;
use crate::lists::quad_plan::{Overlaps, tile_grid};
use crate::lists::value_list::ValueList;
use crate::parallel::prelude::*;
use crate::settings::clip::ClippedVoxels;
use crate::settings::splatting::{Classification, Splatting};
use crate::settings::transfer_function::{LabelTables, Ramp, Tables, TransferFunction};
use crate::stats::Counts;
use crate::volume::{Channels, Grid, Volume};

/// The voxels of a volume that take part under a transfer function.
#[derive(Debug)]
pub struct ClassifiedVolume {
    volume: GpuVolume,
    transfer: Channels<TransferFunction>,
    clipped: ClippedVoxels,
    /// The voxels that are drawn: one list for all channels if one splat draws a voxel in all of them, otherwise one for each channel that is drawn
    /// (SPEC §10).
    pub(crate) lists: Vec<BrickLists>,
    /// A counter of changes to the lists.
    pub(crate) revision: u64,
    classification: Classification,
    /// How the images of channels become one, if they have images of their own.
    joining: Option<Joining>,
    /// The gradients of the membership of labels, where voxels are shaded by them.
    membership: Option<Arc<VolumeTexture>>,
    /// With [`Classification::After`] which bricks the lists hold, once a frame asked for them.
    shown: Option<ShownBricks>,
}

/// Channels that share sheets, and their lists.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Layer {
    /// The channels, by their numbers in the volume.
    pub(crate) channels: Range<usize>,
    /// Their lists, by their indices in [`ClassifiedVolume::lists`].
    pub(crate) lists: Range<usize>,
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
    /// Uploads the bricks of the voxels that take part (SPEC §3) to the volume's device; with [`Classification::After`] the first frame does. The labels'
    /// tables of channels that are not segmented are ignored. The classification must be known.
    pub fn new(
        device: &Device,
        volume: &GpuVolume,
        mut transfer: Channels<TransferFunction>,
        clipped: ClippedVoxels,
        splatting: &Splatting,
    ) -> Self {
        keep_what_applies(volume.volume(), &mut transfer);
        let Splatting { classification, compositing, .. } = *splatting;
        let mut classified = Self {
            volume: volume.clone(),
            transfer,
            clipped,
            lists: Vec::new(),
            revision: 0,
            classification,
            joining: Joining::of(compositing, classification),
            membership: None,
            shown: None,
        };
        let bricks = classified.taking_part();
        classified.lists = bricks.into_iter().map(|bricks| BrickLists::upload(device, bricks)).collect();
        classified
    }

    /// Changes what is listed: voxels that take part in all channels or in each, or bricks around which values meet an opacity, which the next frame
    /// finds.
    pub(crate) fn set_splatting(&mut self, splatting: &Splatting) {
        let Splatting { classification, compositing, .. } = *splatting;
        let (old, count) = (self.classification, self.list_count());
        self.classification = classification;
        self.joining = Joining::of(compositing, classification);
        if classification != old || self.list_count() != count {
            self.list_again();
        }
    }

    /// Lists all voxels again, which the next frame uploads.
    fn list_again(&mut self) {
        self.lists = self.taking_part().into_iter().map(BrickLists::new).collect();
        self.revision += 1;
        self.shown = None;
    }

    /// The bricks that each list holds; with [`Classification::After`] none yet.
    fn taking_part(&self) -> Vec<BrickList> {
        if let Some(given) = self.volume.given_lists() {
            return given.to_vec();
        }
        let bricks = |(volume, transfer): (&Volume, &[TransferFunction])| match self.classification {
            Classification::After => BrickList::new(volume.grid(), &[]),
            _ => brick_list(volume, transfer, &self.clipped),
        };
        self.listed().map(bricks).collect()
    }

    /// The number of channels that are drawn.
    fn channel_count(&self) -> usize {
        channels(self.volume(), &self.transfer).count()
    }

    /// The number of lists.
    fn list_count(&self) -> usize {
        let is_apart = self.classification == Classification::After || self.joining.is_some();
        if is_apart { self.channel_count() } else { 1 }
    }

    /// What the voxels of each list take part in.
    fn listed(&self) -> impl Iterator<Item = (&Volume, &[TransferFunction])> {
        let count = self.list_count();
        self.volume().channels().take(count).enumerate().map(move |(number, volume)| {
            (volume, if count == 1 { &*self.transfer } else { &self.transfer[number..=number] })
        })
    }

    /// The channels that share sheets: all of them, or one by one where each has an image of its own; and how these images become one.
    pub(crate) fn layers(&self) -> (Vec<Layer>, Option<Joining>) {
        let (channels, lists) = (self.channel_count(), self.list_count());
        match self.joining.filter(|_| channels > 1) {
            None => (vec![Layer { channels: 0..channels, lists: 0..lists }], None),
            joining => {
                let layer = |number| Layer { channels: number..number + 1, lists: number..number + 1 };
                ((0..channels).map(layer).collect(), joining)
            }
        }
    }

    /// Lists the bricks that a frame may draw. A changed transfer function tests bricks anew; their values are looked at only where what a
    /// frame needs is new.
    pub(crate) fn show(&mut self, needs: &BrickNeeds) {
        if self.is_shown(needs) {
            return;
        }
        let shown = ShownBricks::new(self.volume(), &self.transfer, needs);
        let volume = Arc::clone(self.volume());
        let lists = shown.lists(&volume);
        self.lists.iter_mut().zip(lists).for_each(|(old, new)| old.replace(new));
        self.revision += 1;
        self.shown = Some(shown);
    }

    /// Whether the lists are those that a frame needs.
    fn is_shown(&self, needs: &BrickNeeds) -> bool {
        self.volume.given_lists().is_some() || self.shown.as_ref().is_some_and(|shown| shown.needs == *needs)
    }

    /// What [`Self::show`] would list, for every list.
    pub(crate) fn settled_for(&self, limits: &Limits, needs: Option<&BrickNeeds>) -> Vec<SettledBricks> {
        match needs {
            Some(needs) if !self.is_shown(needs) => {
                let shown = ShownBricks::new(self.volume(), &self.transfer, needs);
                let lists = shown.lists(self.volume());
                lists.into_iter().map(|bricks| SettledBricks::of(limits, bricks)).collect()
            }
            _ => self.lists.iter().map(|list| list.settled(limits)).collect(),
        }
    }

    /// Uploads what has changed.
    ///
    /// # Errors
    /// If the volume's labels, or their gradients of membership, exceed the device's limits.
    pub(crate) fn flush(&mut self, device: &Device, queue: &Queue) -> Result<(), RenderError> {
        if self.needs_labels() {
            self.volume.upload_labels(device, queue)?;
        }
        self.membership = self.members().map(|shaded| self.volume.membership(queue, &shaded)).transpose()?;
        self.lists.iter_mut().for_each(|list| list.flush(device, queue));
        Ok(())
    }

    /// Makes the next [`Self::flush`] upload everything again, because the buffers may have been lost.
    pub(crate) fn forget(&mut self) {
        self.lists.iter_mut().for_each(BrickLists::forget);
    }

    /// The slots of pages, where voxels are in pages.
    pub(crate) fn pages(&self) -> Option<Pages<'_>> {
        self.volume.pages()
    }

    /// The values of all channels on the GPU.
    pub(crate) fn values(&self) -> &TextureView {
        self.volume.values()
    }

    /// Where the labels and colours of a layer's channels are among those of all channels.
    pub(crate) fn stored(&self, layer: &Layer) -> Vec<Stored> {
        self.volume.stored()[layer.channels.clone()].to_vec()
    }

    /// The colours of voxels' own of all channels, if a channel of a layer has any.
    pub(crate) fn colors(&self, layer: &Layer) -> Option<OwnColors<'_>> {
        self.volume.colors().filter(|_| self.stored(layer).iter().any(|stored| stored.colors > 0))
    }

    /// Whether any voxel is a hole.
    pub(crate) fn has_holes(&self) -> bool {
        self.volume().channels().any(|channel| channel.holes() > 0)
    }

    /// The labels of all channels on the GPU, if shading a layer needs them.
    pub(crate) fn labels(&self, layer: &Layer) -> Option<&TextureView> {
        self.volume.labels().filter(|_| self.shades_by_label(layer))
    }

    /// The voxels of each channel that have normals of the membership of their labels, if any voxel has.
    fn members(&self) -> Option<Vec<Shaded>> {
        let members = membership::shaded(self.volume(), &self.transfer);
        members.filter(|_| self.classification == Classification::Before)
    }

    /// The gradients of the membership of labels on the GPU, if voxels are shaded by them.
    pub(crate) fn membership(&self) -> Option<&TextureView> {
        self.membership.as_ref().map(|texture| &texture.view)
    }

    /// Whether shading a layer needs labels.
    pub(crate) fn shades_by_label(&self, layer: &Layer) -> bool {
        let is_alone = layer.channels.len() == 1 && self.classification == Classification::Before;
        let matter = if is_alone { LabelTables::matter_to_shading } else { LabelTables::matter };
        let mut channels = self.transfer[layer.channels.clone()].iter();
        channels.any(|transfer| transfer.labels.values().any(matter))
    }

    /// Whether shading any layer needs labels.
    fn needs_labels(&self) -> bool {
        self.layers().0.iter().any(|layer| self.shades_by_label(layer))
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

    /// The transfer functions of the channels that are drawn.
    pub fn transfer(&self) -> &Channels<TransferFunction> {
        &self.transfer
    }

    /// The voxels sorted by value: [`GpuVolume::value_list`].
    pub fn value_list(&self) -> &ValueList {
        self.volume.value_list()
    }

    /// Changes colours, opacities, gradient opacity, iso-ranges or the labels' tables (§5.1). Only voxels that enter or leave are touched: those
    /// whose values become visible or transparent, found by binary search. If the gradient opacity changes, all voxels in range must be
    /// examined. The labels' tables are ignored if the volume is not segmented.
    pub fn set_transfer_function(&mut self, transfer: impl Into<Channels<TransferFunction>>) -> Touched {
        let mut transfer = transfer.into();
        keep_what_applies(self.volume(), &mut transfer);
        if transfer.len() != self.transfer.len() {
            let listed = |lists: &[BrickLists]| lists.iter().map(BrickLists::len).sum::<u64>();
            let old = listed(&self.lists);
            self.transfer = transfer;
            self.list_again();
            return Touched { entered: listed(&self.lists), left: old, rebuilt: true };
        }
        if self.classification == Classification::After {
            self.transfer = transfer;
            return self.look_at_bricks();
        }
        if self.volume().channel_count() > 1 {
            self.transfer = transfer;
            return self.look_at((0..self.volume().values().len() as u32).collect());
        }
        let (old, new) = (self.transfer.first(), transfer.first());
        let labels = old.labels.keys().chain(new.labels.keys()).copied().map(Some);
        let mut labels: Vec<Option<u16>> = labels.chain([None]).collect();
        labels.sort_unstable();
        labels.dedup();
        // Voxels with other labels are examined too, without effect.
        let changed = ValueSet::union_of(
            (labels.into_iter()).map(|label| changed_values(&old.tables(label), &new.tables(label))),
        );
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
        let volume = Arc::clone(self.volume());
        let values = opaque_values(&volume, &self.transfer);
        let Some(shown) = self.shown.as_mut().filter(|shown| shown.values != values) else { return Touched::default() };
        shown.values = values;
        let lists = shown.lists(&volume);
        let changes: Vec<(Vec<u32>, Vec<u32>)> =
            self.lists.iter().zip(lists).map(|(old, new)| old.list().changes_to(&new)).collect();
        self.change_all(&changes)
    }

    /// Lets voxels enter and leave each list.
    fn change_all(&mut self, changes: &[(Vec<u32>, Vec<u32>)]) -> Touched {
        let mut touched = Touched::default();
        for (list, (entering, leaving)) in changes.iter().enumerate() {
            touched = touched.and(self.change(list, entering, leaving));
        }
        touched
    }

    fn change(&mut self, list: usize, entering: &[u32], leaving: &[u32]) -> Touched {
        if !entering.is_empty() || !leaving.is_empty() {
            self.lists[list].change(entering, leaving);
            self.revision += 1;
        }
        let (entered, left) = (entering.len() as u64, leaving.len() as u64);
        Touched { entered, left, rebuilt: !self.lists[list].has_room() }
    }

    /// Decides for some voxels, in memory order, whether they enter or leave.
    fn look_at(&mut self, candidates: Vec<u32>) -> Touched {
        let changes = |(listed, (volume, transfer)): (&BrickLists, (&Volume, &[TransferFunction]))| {
            // The closures get no types of wgpu, which in a browser belong to one thread.
            let (clipped, listed, of) = (&self.clipped, listed.list(), TakingPart::new(volume, transfer));
            let takes_part = |index: u32| clipped.contain(volume.grid().voxel_at(index)) && of.takes_part(index);
            let changed = candidates.par_iter().filter(|&&index| takes_part(index) != listed.contains(index));
            changed.copied().collect::<Vec<_>>().into_iter().partition(|&index| !listed.contains(index))
        };
        let changes: Vec<(Vec<u32>, Vec<u32>)> = self.lists.iter().zip(self.listed()).map(changes).collect();
        self.change_all(&changes)
    }

    /// Changes only the iso-ranges: closed intervals `[lo, hi]` of the values that take part, `None` for all. Touches the same voxels as
    /// [`Self::set_transfer_function`].
    pub fn set_iso_ranges(&mut self, iso_ranges: Option<Vec<[f64; 2]>>) -> Touched {
        let mut transfer = self.transfer.clone();
        transfer.first_mut().iso_ranges = iso_ranges;
        self.set_transfer_function(transfer)
    }

    /// Shows or hides the voxels of a label. Touches the same voxels as [`Self::set_transfer_function`], and none if the volume is not
    /// segmented.
    pub fn set_label_visible(&mut self, label: u16, visible: bool) -> Touched {
        let mut transfer = self.transfer.clone();
        transfer.first_mut().labels.entry(label).or_default().visible = visible;
        self.set_transfer_function(transfer)
    }

    /// Bytes of GPU memory that the volume will use once prepared.
    pub(crate) fn estimate(&self) -> Result<u64, RenderError> {
        let [values, both] = self.volume.needs()?;
        let has_labels = self.needs_labels() || self.volume.labels().is_some();
        let limits = self.volume.device().limits();
        let membership = self.members().map(|shaded| membership::estimate(&limits, self.volume(), &shaded));
        Ok(membership.transpose()?.unwrap_or(0) + if has_labels { both } else { values })
    }

    /// Bytes of GPU memory, including the volume's, which other views may share ([`GpuVolume::gpu_bytes`]).
    pub fn gpu_bytes(&self) -> u64 {
        self.volume.gpu_bytes() + self.lists.iter().map(BrickLists::gpu_bytes).sum::<u64>()
    }

    /// The counts of a frame's layer (Table 4) that are known before it is drawn.
    pub(crate) fn totals(&self, layer: &Layer, view: &ViewGeometry, groups: &GroupSlabs) -> Totals {
        let is_after = self.classification == Classification::After;
        let of_bricks = if is_after { Overlaps::count_planes } else { Overlaps::count };
        // The lists may have changed since the frame was prepared.
        let lists = self.lists.iter().skip(layer.lists.start).take(layer.lists.len());
        let overlaps = lists.flat_map(BrickLists::bricks).map(|bricks| of_bricks(bricks, view));
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

impl Touched {
    /// The effect of two changes of different lists.
    fn and(self, other: Self) -> Self {
        let (entered, left) = (self.entered + other.entered, self.left + other.left);
        Self { entered, left, rebuilt: self.rebuilt || other.rebuilt }
    }
}

/// Drops the tables of labels of channels without labels, and the transfer functions of channels that a volume does not have.
fn keep_what_applies(volume: &Volume, transfer: &mut Channels<TransferFunction>) {
    transfer.truncate(volume.channel_count());
    for (channel, transfer) in volume.channels().zip(transfer.iter_mut()) {
        if channel.labels().is_none() {
            transfer.labels.clear();
        }
    }
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
