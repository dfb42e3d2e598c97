//! The boxes of voxels that bear on windows of a view, and what is read for them.

use std::ops::Range;

use glam::{DVec2, DVec3, UVec3};

use super::channel::{ChannelChunks, LevelChunks, VoxelBox};
use crate::error::RenderError;
use crate::error::setting::SettingError;
use crate::geometry::plane_geometry::PlaneGeometry;
#[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
use crate::geometry::view_geometry::Bounds;
use crate::geometry::view_geometry::ViewGeometry;
use crate::kernel::Kernel;
use crate::part::{self, Content};
use crate::scene::Scene;
use crate::settings::splatting::Classification;
use crate::settings::transfer_function::TransferFunction;
use crate::settings::window::Region;
use crate::stats::StoreCounts;
#[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
use crate::volume::Grid;
use crate::volume::{MEMBERSHIP_REACH, StreamedVolume, Volume};

/// The part of the memory that the values of a box may take, as backends hold them several times, and that decoded chunks may take.
const SHARE: u64 = 4;

/// The part of the voxels that fit into memory whose reading takes about as long as what a step costs whatever its box.
const STEP_SHARE: u64 = 8;

/// Slabs around those of a window, which share planes with them.
pub(super) const SLABS: f64 = 2.0;

/// Voxels around those whose kernels reach a window for rounding; those for gradients come beside them.
const RIM: f64 = 2.0;

/// Pixels around those of a window.
pub(super) const PIXELS: f64 = 1.0;

/// What is read of a volume for a view.
pub(super) struct Chunks<'a> {
    volume: &'a StreamedVolume,
    view: ViewGeometry,
    /// Voxels around a point on a pixel's ray whose kernels reach it.
    half_box: DVec3,
    /// The kernel's radius where footprints in perspective decide which pixels a voxel reaches: close to the eye they are far wider than the kernel (SPEC §5).
    footprints: Option<f64>,
    /// Voxels around these: for their gradients, and rounding.
    rim: f64,
    /// The channels that have an opacity.
    channels: Vec<ChannelChunks<'a>>,
    most_held: u64,
}

/// Some slabs, and what they need of the voxels, such as a box of them; `None` if they need none.
pub(super) type Step<Needed = VoxelBox> = (Range<i32>, Option<Needed>);

/// A box of voxels in memory, and the numbers of the volume's channels that it has.
pub(super) type Filled = (Volume, Vec<usize>);

impl<'a> Chunks<'a> {
    /// What the channels of a scene with everything stated need.
    ///
    /// # Errors
    /// If the chunks are too many.
    pub(super) fn new(volume: &'a StreamedVolume, scene: &Scene, view: &ViewGeometry) -> Result<Self, RenderError> {
        let is_after = scene.splatting.classification == Classification::After;
        let geometry = PlaneGeometry::new(view, volume.grid());
        let reach = if is_after { geometry.reach(view).along } else { UVec3::ZERO };
        let transfer = scene.resolve(&volume.sample);
        let stores = volume.channels.iter().map(|channel| 1 + u64::from(channel.labels.is_some())).sum::<u64>();
        let kept = volume.memory / SHARE / stores;
        let channels = volume.channels.iter().zip(&transfer).enumerate();
        let channels = channels.map(|(number, (channel, transfer))| {
            ChannelChunks::new((number, channel), transfer, &scene.splatting, (reach, kept))
        });
        let channels = channels.collect::<Result<Vec<_>, _>>()?;
        let channels = channels.into_iter().filter(ChannelChunks::has_opacity).collect();
        let of_gradients = if transfer.iter().any(TransferFunction::has_membership) { MEMBERSHIP_REACH } else { 1 };
        let (half_box, rim) = (geometry.widest_half_box(view), RIM + f64::from(of_gradients));
        let kernel = Kernel::new(scene.splatting.radius, scene.splatting.falloff);
        let footprints = (!is_after && view.perspective.is_some()).then(|| kernel.support());
        Ok(Self { volume, view: *view, half_box, footprints, rim, channels, most_held: 0 })
    }

    /// The first step in which slabs behind a region are drawn front to back: as many as fit into memory with the voxels that they need; `None` if those of
    /// the first slab do not fit.
    pub(super) fn deepest(&self, region: &Region, slabs: Range<i32>) -> Option<Step> {
        let mut best = None;
        let mut depth = 1;
        loop {
            let end = slabs.end.min(slabs.start.saturating_add(depth));
            let needed = self.needed(region, &(slabs.start..end));
            if needed.map_or(0, |needed| needed.voxels().saturating_mul(self.voxel_bytes())) > self.budget() {
                return best;
            }
            best = Some((slabs.start..end, needed));
            if end == slabs.end {
                return best;
            }
            depth = depth.saturating_mul(2);
        }
    }

    /// The time that a step takes for each of its slabs, as a number of voxels that are read in it; infinite if not even the voxels of one slab fit into memory.
    pub(super) fn voxels_per_slab(&self, step: Option<&Step>) -> f64 {
        let Some((slabs, needed)) = step else { return f64::INFINITY };
        let a_step = self.budget() / self.voxel_bytes().max(1) / STEP_SHARE;
        let voxels = needed.map_or(0, |needed| needed.voxels() + a_step);
        voxels as f64 / f64::from(slabs.end - slabs.start)
    }

    /// The smallest box with all voxels that can change a pixel of a region in some slabs; `None` if no voxel can.
    pub(super) fn needed(&self, region: &Region, slabs: &Range<i32>) -> Option<VoxelBox> {
        let view = &self.view;
        let first = DVec2::new(f64::from(region.x), f64::from(region.y)) - PIXELS;
        let last = first + DVec2::new(f64::from(region.width), f64::from(region.height)) + 2.0 * PIXELS;
        let near = view.perspective.map_or(f64::NEG_INFINITY, |perspective| view.slabs.origin + perspective.eye.near);
        let depth = |slab: i32, around: f64| (view.slabs.plane(slab) + around * view.slabs.width).max(near);
        let mut depths = [depth(slabs.start, -SLABS), depth(slabs.end, SLABS)];
        let mut beside = DVec2::ZERO;
        if let Some(support) = self.footprints {
            beside = view.half_box(support, depths[0]..depths[1]);
            // The voxels' own depths, which their places on the screen follow from.
            depths = [(depths[0] - view.reach).max(near), depths[1] + view.reach];
        }
        if !beside.is_finite() {
            return self.between(depths);
        }
        let (first, last) = (first - beside, last + beside);
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for depth in depths {
            for (x, y) in [(first.x, first.y), (last.x, first.y), (first.x, last.y), (last.x, last.y)] {
                let at = view.voxel_at(DVec2::new(x, y), depth);
                (low, high) = (low.min(at), high.max(at));
            }
        }
        self.around(low, high)
    }

    /// A box of points with the voxels around it, if there are any.
    fn around(&self, low: DVec3, high: DVec3) -> Option<VoxelBox> {
        let dims = self.volume.grid().dims.as_dvec3();
        let low = (low - self.half_box - self.rim).floor().max(DVec3::ZERO);
        let end = (high + self.half_box + self.rim).ceil().min(dims);
        low.cmplt(end).all().then(|| VoxelBox { low: low.as_uvec3(), end: end.as_uvec3() })
    }

    /// The smallest box with all voxels between two sheet depths.
    fn between(&self, depths: [f64; 2]) -> Option<VoxelBox> {
        let row = self.view.screen_from_voxel[2];
        let last = (self.volume.grid().dims - 1).as_dvec3();
        let ends = |axis: usize| {
            // The depths that the other axes add to an axis' own.
            let of_others = (0..3).filter(|&other| other != axis).map(|other| row[other] * last[other]);
            let [least, most] =
                of_others.fold([row.w; 2], |[low, high], end| [low + end.min(0.0), high + end.max(0.0)]);
            let places = [(depths[0] - most) / row[axis], (depths[1] - least) / row[axis]];
            if row[axis] == 0.0 { [0.0, last[axis]] } else { [places[0].min(places[1]), places[0].max(places[1])] }
        };
        let [x, y, z] = [0, 1, 2].map(ends);
        self.around(DVec3::new(x[0], y[0], z[0]), DVec3::new(x[1], y[1], z[1]))
    }

    /// The pixels that a box of voxels, given by its middle and half its size, may reach, and its sheet depths; `None` before the near plane.
    #[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
    pub(super) fn bounds(&self, middle: DVec3, half: DVec3) -> Option<Bounds> {
        let Some(support) = self.footprints else { return self.view.bounds(middle, half + self.half_box) };
        let bounds = self.view.bounds(middle, half)?;
        let beside = self.view.half_box(support, bounds.depths.clone());
        Some(Bounds { low: bounds.low - beside, high: bounds.high + beside, ..bounds })
    }

    /// Reads the voxels of a box, in every channel that may show something there; `None` if no channel may.
    ///
    /// # Errors
    /// If a store cannot be read, or holds a value that is no label.
    pub(super) fn read(&mut self, within: VoxelBox) -> Result<Option<Filled>, RenderError> {
        let filled = self.read_parts((within, &[within]), within)?;
        if filled.is_some() {
            self.most_held = self.most_held.max(within.voxels().saturating_mul(self.voxel_bytes()));
        }
        Ok(filled)
    }

    /// As [`Self::read`], in every channel that may show something in a box within; what lies in none of some parts is not read, and has holes.
    ///
    /// # Errors
    /// As for [`Self::read`].
    pub(super) fn read_parts(
        &self,
        (within, parts): (VoxelBox, &[VoxelBox]),
        seen: VoxelBox,
    ) -> Result<Option<Filled>, RenderError> {
        let grid = self.volume.grid().part(within.low, within.end - within.low);
        let (mut filled, mut numbers) = (Vec::new(), Vec::new());
        for channel in &self.channels {
            if let Some(volume) = channel.read((within, parts), seen, &grid)? {
                filled.push(volume);
                numbers.push(channel.number);
            }
        }
        if filled.is_empty() {
            return Ok(None);
        }
        let first = filled.remove(0);
        Ok(Some((first.with_channels(&self.volume.channels.first().values.origin, filled)?, numbers)))
    }

    /// Notes the labels that decide which tables classify a region's means, of a volume of one channel.
    ///
    /// # Errors
    /// If a store cannot be read, or holds a value that is no label.
    pub(super) fn note_labels(&self, scene: &Scene, region: &Region, content: &mut Content) -> Result<(), RenderError> {
        let Self { view, volume, channels, .. } = self;
        part::note_labels((view, scene, volume.grid()), region, content, |voxels| {
            channels.first().map_or_else(|| Ok(Vec::new()), |channel| channel.labels_at(voxels))
        })
    }

    /// The error for a view whose boxes do not fit.
    pub(super) fn too_large(&self) -> SettingError {
        let found =
            format!("{}, in which few pixels see a box of more than {} bytes", self.volume.level(), self.budget());
        SettingError::new("volume.level", found, "a coarser level, more pixels, or more memory")
    }

    /// What has been read.
    pub(super) fn counts(&self) -> StoreCounts {
        let levels = || self.channels.iter().flat_map(ChannelChunks::levels);
        let mut counts = StoreCounts::default();
        counts.level = self.volume.level() as u64;
        counts.chunks_total = self.volume.chunks();
        counts.chunks_read = levels().map(LevelChunks::chunks_read).sum();
        counts.bytes_read = levels().map(LevelChunks::bytes_read).sum();
        counts.chunk_bytes = self.most_held + levels().map(LevelChunks::most_kept).sum::<u64>();
        counts
    }

    /// The channels that have an opacity.
    #[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
    pub(super) fn channels(&self) -> impl Iterator<Item = &ChannelChunks<'a>> {
        self.channels.iter()
    }

    /// The view, and the volume's grid.
    #[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
    pub(super) fn geometry(&self) -> (&ViewGeometry, &Grid) {
        (&self.view, self.volume.grid())
    }

    /// Whether values without an opacity change pixels.
    #[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
    pub(super) fn counts_all(&self) -> bool {
        self.channels.iter().any(ChannelChunks::counts_all)
    }

    /// The bytes of a voxel's values and labels.
    pub(super) fn voxel_bytes(&self) -> u64 {
        self.channels.iter().map(ChannelChunks::voxel_bytes).sum()
    }

    pub(super) fn budget(&self) -> u64 {
        self.volume.memory / SHARE
    }
}
