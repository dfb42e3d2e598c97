//! The coefficients of the field where classification comes after splatting (SPEC §9), and the choice of bricks.

use std::sync::Arc;

use glam::{DVec3, UVec3};

use super::bounds::Bounds;
use super::cells::{Cells, Work};
use super::colors::{Colors, ColorsOf};
use super::differences::{Differences, MAX_VOXELS};
use super::field::Field;
use super::slab_integral::Integrals;
use crate::after::brick_ranges::{Bearing, BrickRanges, values_of};
use crate::after::coefficients;
use crate::after::normalization::Normalization;
use crate::after::shown_voxels::shown_voxels;
use crate::error::RenderError;
use crate::geometry::plane_geometry::{PlaneGeometry, Reach};
use crate::geometry::view_geometry::ViewGeometry;

use crate::lists::brick::{self, Brick, BrickList};
use crate::lists::iso_range::ValueSet;
use crate::scene::Scene;
use crate::settings::shading::Gradient;
use crate::settings::splatting::Splatting;
use crate::settings::transfer_function::TransferFunction;
use crate::volume::{ValueSlice, Volume};

/// The coefficients of a volume, and the bricks that its last frame drew.
#[derive(Clone, Debug)]
pub(in crate::cpu) struct Coefficients {
    /// The map from coefficients to the numbers that are splatted.
    pub(super) numbers: Normalization,
    /// Of `interpolation = "exact"`; else they are the values.
    exact: Option<Arc<[f32]>>,
    /// The values as `f32`, which are read faster, once a second frame has been drawn.
    wide: Option<Arc<[f32]>>,
    has_drawn: bool,
    /// The kernels' radius and falloff.
    kernel: (f64, f64),
    /// Of volumes of colours.
    colors: Option<Colors>,
    /// Of the values, which only gradients need.
    differences: Kept,
    ranges: Option<Ranges>,
    /// Of the last frame, if the ranges are still its ranges.
    shown: Option<Shown>,
    /// Whether the transfer function or the compositing have changed since.
    is_stale: bool,
}

/// The differences of a volume's values.
#[derive(Clone, Debug)]
enum Kept {
    /// No frame has needed them.
    Unused,
    /// One frame has. It computes those that it needs, which is faster than all.
    Once,
    /// Further frames have; nothing if there are too many.
    Often(Option<Arc<Differences>>),
}

/// The minimum and maximum coefficients around bricks, which change with the view, but with no transfer function.
#[derive(Clone, Debug)]
struct Ranges {
    /// How far the values around voxels and bricks were examined.
    reaches: (Reach, UVec3),
    /// Around the kernels of the bricks' voxels.
    of_kernels: BrickRanges,
    /// Around slabs whose near planes rays meet in the cells of the bricks' voxels.
    of_cells: BrickRanges,
}

/// The choice of bricks.
#[derive(Clone, Debug)]
struct Shown {
    /// The values with an opacity, and those that bear on the image beside them.
    values: ValueSet,
    bearing: Bearing,
    /// How far the widest kernels reach, in whole voxels, and what their means are bounded by.
    kernels: (DVec3, Option<Bounds>),
    /// The voxels that may affect a slab with an opacity.
    bricks: BrickList,
    /// The bricks of the grid in whose cells a ray may meet the near plane of a slab with an opacity.
    wanted: Vec<u32>,
    /// The least and the greatest number with an opacity, and the cells that can meet one; `None` where values without an opacity count too.
    cells: Option<([f32; 2], Cells)>,
    /// Around the kernels of points of bricks' cells, where the greatest or the least value is chosen.
    extremes: Option<BrickRanges>,
}

impl Coefficients {
    /// # Errors
    /// If no coefficients are found that interpolate the volume's values.
    pub(in crate::cpu) fn new(volume: &Volume, scene: &Scene) -> Result<Self, RenderError> {
        let splatting = &scene.splatting;
        let kernel = (splatting.radius, splatting.falloff);
        let is_exact = splatting.is_exact();
        let exact = if is_exact { Some(coefficients::of_volume(volume, kernel)?) } else { None };
        let all = exact.as_deref().map_or(volume.values(), ValueSlice::from);
        let numbers = Normalization::of(all.iter()).unwrap_or(Normalization::new([0.0; 2]));
        let colors = Colors::new(volume, is_exact, kernel)?;
        Ok(Self {
            numbers,
            exact,
            wide: None,
            has_drawn: false,
            kernel,
            colors,
            differences: Kept::Unused,
            ranges: None,
            shown: None,
            is_stale: false,
        })
    }

    /// All of them, in memory order; NaN at holes.
    pub(in crate::cpu) fn all<'a>(&'a self, volume: &'a Volume) -> ValueSlice<'a> {
        self.exact.as_deref().or(self.wide.as_deref()).map_or(volume.values(), ValueSlice::from)
    }

    /// The coefficients of the voxels' own colours, if they have any.
    pub(super) fn colors<'a>(&'a self, volume: &'a Volume) -> Option<ColorsOf<'a>> {
        self.colors.as_ref().and_then(|colors| colors.of(volume))
    }

    /// Prepares for a frame of a scene what it reads.
    pub(in crate::cpu) fn prepare(&mut self, volume: &Volume, scene: &Scene) {
        let (is_first, values) = (!std::mem::replace(&mut self.has_drawn, true), volume.values());
        let is_narrow = !matches!(values, ValueSlice::F32(_));
        if !is_first && is_narrow && self.exact.is_none() && self.wide.is_none() && values.len() as u64 <= MAX_VOXELS {
            self.wide = Some(values.iter().collect());
        }
        let is_kept = scene.shading.gradient != Gradient::Kernel && Field::is_narrow(scene.splatting.radius);
        if !(scene.shading.enabled && is_kept) {
            return;
        }
        match self.differences {
            Kept::Unused => self.differences = Kept::Once,
            Kept::Once => self.differences = Kept::Often(Differences::new(volume).map(Arc::new)),
            Kept::Often(_) => {}
        }
    }

    /// The differences of the volume's values, if they are kept.
    pub(super) fn differences(&self) -> Option<&Differences> {
        match &self.differences {
            Kept::Often(differences) => differences.as_deref(),
            Kept::Unused | Kept::Once => None,
        }
    }

    /// Lets the next frame test bricks anew, because the transfer function or the compositing changed.
    pub(in crate::cpu) fn retest(&mut self) {
        self.is_stale = true;
    }

    /// Finds the bricks that may be drawn in a view, if that may have changed them. The values around bricks are examined only in a view with new
    /// reaches; a changed transfer function makes a new list only if other values have an opacity. `sharing` is the number of channels that share sheets.
    pub(in crate::cpu) fn look(
        &mut self,
        (volume, transfer): (&Volume, &TransferFunction),
        splatting: &Splatting,
        view: &ViewGeometry,
        sharing: usize,
    ) {
        let compositing = splatting.compositing;
        let (geometry, grid) = (PlaneGeometry::new(view, volume.grid()), volume.grid());
        let reaches = (geometry.reach(view).sharing(sharing), geometry.reach_from_cells(view));
        let half_box = geometry.widest_half_box(view);
        let bounds = Bounds::of(half_box, self.kernel).filter(|_| volume.holes() == 0);
        let kernels = (half_box.ceil(), bounds);
        let is_stale = std::mem::take(&mut self.is_stale);
        let kept = self.ranges.take().filter(|ranges| ranges.reaches == reaches);
        let old = self.shown.take().filter(|_| kept.is_some());
        if !is_stale && old.as_ref().is_some_and(|old| old.kernels == kernels) {
            (self.ranges, self.shown) = (kept, old);
            return;
        }
        let ranges = kept.unwrap_or_else(|| {
            let [of_kernels, of_cells] =
                [reaches.0.along, reaches.1].map(|reach| BrickRanges::new(grid, self.all(volume), reach));
            Ranges { reaches, of_kernels, of_cells }
        });
        let (values, bearing) = (values_of(volume, transfer), Bearing::of(compositing));
        let (listed, old_cells, old_extremes) = match old {
            Some(old) => {
                let is_same = (&old.values, old.bearing) == (&values, bearing);
                let (is_same_kernel, listed) = (old.kernels == kernels, is_same.then_some((old.bricks, old.wanted)));
                (listed, old.cells.filter(|_| is_same_kernel), old.extremes.filter(|_| is_same_kernel))
            }
            None => (None, None, None),
        };
        let (bricks, wanted) = listed.unwrap_or_else(|| {
            let of_kernels = (&ranges.of_kernels, &ranges.reaches.0);
            let is_wanted = match compositing.is_choice() {
                // A value without an opacity may be chosen.
                true => vec![true; brick::bricks_per_axis(grid).element_product() as usize],
                false => ranges.of_cells.shown(&values, bearing),
            };
            let wanted = (0..is_wanted.len() as u32).filter(|&brick| is_wanted[brick as usize]).collect();
            (shown_voxels(of_kernels, (volume, self.all(volume)), &values, bearing), wanted)
        });
        let cells = (!compositing.is_choice()).then(|| {
            let shown = Integrals::new(volume.labels().is_some(), transfer, splatting, &self.numbers).shown;
            let all = self.all(volume);
            old_cells.filter(|(of, _)| *of == shown).unwrap_or_else(|| {
                let cells = Cells::new(grid, all, &self.numbers, half_box, shown, Work::Shared);
                let cells = match &bounds {
                    Some(bounds) => cells.within(bounds, (grid, all, &self.numbers), shown),
                    None => cells,
                };
                (shown, cells)
            })
        });
        let extremes = compositing.is_extreme().then(|| {
            old_extremes.unwrap_or_else(|| {
                let reach = kernels.0.min(grid.dims.as_dvec3()).max(DVec3::ONE).as_uvec3();
                BrickRanges::new(grid, self.all(volume), reach)
            })
        });
        self.ranges = Some(ranges);
        self.shown = Some(Shown { values, bearing, kernels, bricks, wanted, cells, extremes });
    }

    /// For the last view that was looked at, the bricks whose voxels may affect a slab with an opacity.
    pub(super) fn bricks(&self) -> &[Brick] {
        self.shown.as_ref().map_or(&[], |shown| shown.bricks.bricks())
    }

    /// Where the lists of bricks and their ranges lie in memory, and the number of bricks.
    #[cfg(test)]
    pub(in crate::cpu) fn places(&self) -> ([Option<*const ()>; 2], usize) {
        let bricks = self.shown.as_ref().map(|shown| shown.bricks.bricks());
        let places =
            [bricks.map(|bricks| bricks.as_ptr().cast()), self.ranges.as_ref().map(|ranges| ranges.of_kernels.place())];
        (places, bricks.map_or(0, <[_]>::len))
    }

    /// For the last view that was looked at, the bricks, as indices into the grid's, in whose cells rays may enter a slab with an opacity.
    pub(super) fn wanted(&self) -> &[u32] {
        self.shown.as_ref().map_or(&[], |shown| &shown.wanted)
    }

    /// The extremes around points of bricks; `None` unless the greatest or the least value is chosen.
    pub(super) fn extremes(&self) -> Option<&BrickRanges> {
        self.shown.as_ref().and_then(|shown| shown.extremes.as_ref())
    }

    /// Where values can meet an opacity; `None` where all values count.
    pub(super) fn cells(&self) -> Option<&Cells> {
        self.shown.as_ref().and_then(|shown| shown.cells.as_ref()).map(|(_, cells)| cells)
    }
}
