//! Resampling onto another volume's grid (SPEC §10): fusion of volumes that lie in one space, such as PET on CT.

use std::path::Path;
use std::sync::Arc;

use glam::{DVec3, UVec3};

use super::access::Access;
use super::{Grid, Orientation, Texel, Volume, VolumeError};
use crate::parallel::prelude::*;

/// Places that differ by less, in voxels, are the same.
const SAME_PLACE: f64 = 1e-4;

/// How values are found between voxels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Resampling {
    /// Trilinearly, for amounts.
    Linear,
    /// The nearest voxel's, for values that are labels.
    Nearest,
}

/// A grid, and how it lies in the patient, if its file states it.
pub(super) type Oriented<'a> = (&'a Grid, Option<&'a Orientation>);

/// The map from voxels of one grid to those of another along each axis of the first.
struct Placement {
    origin: DVec3,
    steps: [DVec3; 3],
}

impl Placement {
    /// In the files' own space, or where either has none, with their centres and axes in one place.
    fn new((from, of_from): Oriented, (to, of_to): Oriented) -> Self {
        let steps = |axes: glam::DMat3| [0, 1, 2].map(|axis| axes.col(axis) * from.spacing[axis]);
        match (of_from, of_to) {
            (Some(first), Some(second)) => {
                // The axes are orthonormal, so the transpose is the inverse.
                let into = |vector: DVec3| (second.axes.transpose() * vector) / to.spacing;
                Self { origin: into(first.origin - second.origin), steps: steps(first.axes).map(into) }
            }
            _ => {
                let steps = steps(glam::DMat3::IDENTITY).map(|step| step / to.spacing);
                let center = from.center();
                let offset: DVec3 = (0..3).map(|axis| steps[axis] * center[axis]).sum();
                // The centres of coarser levels need not lie in one place.
                let apart = (from.place() - to.place()) / to.spacing;
                Self { origin: to.center() - offset + apart, steps }
            }
        }
    }

    fn at(&self, voxel: DVec3) -> DVec3 {
        self.origin + self.steps[0] * voxel.x + self.steps[1] * voxel.y + self.steps[2] * voxel.z
    }

    /// Whether voxels lie on the other grid's voxels of the same number.
    fn is_identity(&self, last: DVec3) -> bool {
        [DVec3::ZERO, last].iter().all(|&corner| (self.at(corner) - corner).abs().max_element() < SAME_PLACE)
            && DVec3::AXES.iter().zip(&self.steps).all(|(axis, step)| (*step - *axis).abs().max_element() < SAME_PLACE)
    }
}

/// Whether the voxels of two grids lie on one another.
pub(super) fn is_same_grid(one: Oriented, other: Oriented) -> bool {
    let last = other.0.dims.as_dvec3() - 1.0;
    one.0.dims == other.0.dims && Placement::new(one, other).is_identity(last)
}

impl Volume {
    /// The volume on another one's grid: values as stated, labels by the nearest one. A voxel beyond the centres of this volume's voxels, or beside
    /// a hole, becomes a hole. `key` and `origin` name the volume in errors and in the warning that says that it was resampled.
    #[doc(hidden)]
    pub fn onto(
        self,
        grid: &Self,
        resampling: Resampling,
        (key, origin): (&str, &Path),
        access: &Access,
    ) -> Result<Self, VolumeError> {
        // Where one states no place, both count as in the order of their files.
        let is_by_index = grid.orientation().is_none() || self.orientation().is_none();
        let own = if is_by_index { self.with_turned(grid.grid().is_turned()) } else { self };
        own.at_its_place_onto(grid, resampling, (key, origin), access)
    }

    /// As [`Self::onto`], from where the volume lies.
    fn at_its_place_onto(
        self,
        grid: &Self,
        resampling: Resampling,
        (key, origin): (&str, &Path),
        access: &Access,
    ) -> Result<Self, VolumeError> {
        let places = [grid, &self].map(|volume| (volume.grid(), volume.orientation()));
        if is_same_grid(places[0], places[1]) {
            return Ok(self);
        }
        let placement = Placement::new(places[0], places[1]);
        let (dims, own_last) = (grid.dims(), self.dims().as_dvec3() - 1.0);
        let count = dims.element_product();
        let optional = |is_there: bool, bytes| if is_there { bytes } else { 0 };
        let of_voxel = 4 + optional(self.labels().is_some(), 2) + optional(self.colors().is_some(), 8);
        let bytes = u64::from(count) * of_voxel;
        access.reserve(origin, key, format!("{count} voxels on the first channel's grid"), bytes)?;
        let place = |index: u32| placement.at(grid.grid().voxel_at(index).as_dvec3());
        let is_inside = |at: DVec3| at.cmpge(DVec3::splat(-SAME_PLACE)).all() && at.cmple(own_last + SAME_PLACE).all();
        let value = |at: DVec3| {
            if !is_inside(at) {
                return f32::NAN;
            }
            let at = at.clamp(DVec3::ZERO, own_last);
            let linear = self.between(at, |voxel| self.value(voxel).into()) as f32;
            // Beside a hole both are holes.
            if resampling == Resampling::Linear || linear.is_nan() { linear } else { self.value(at.round().as_uvec3()) }
        };
        let values: Vec<f32> = (0..count).into_par_iter().map(place).map(value).numbers();
        if values.iter().all(|value| value.is_nan()) {
            let name = origin.display().to_string();
            let [own, other] = [places[1], places[0]].map(bounds);
            return Err(VolumeError::invalid(
                &name,
                key,
                own,
                format!("a box that overlaps the first channel's, {other}"),
            ));
        }
        let (name, own) = (origin.display(), self.dims());
        let nearest = if resampling == Resampling::Nearest { ", each label the nearest one" } else { "" };
        log::warn!("{name}: {key}: resampled from {own} to {dims} voxels, the first channel's{nearest}");
        let labels: Option<Arc<[u16]>> = self.labels().map(|labels| {
            let nearest = |index: u32| voxel_around(place(index), self.grid()).map_or(0, |at| labels[at]);
            (0..count).into_par_iter().map(nearest).numbers().into()
        });
        let colors: Option<Arc<[Texel]>> = self.colors().map(|colors| {
            let component = |at: DVec3, number: usize| {
                self.between(at, |voxel| colors[self.grid().index_of(voxel) as usize][number].into()).round() as u16
            };
            let color = |at: DVec3| [0, 1, 2, 3].map(|number| component(at.clamp(DVec3::ZERO, own_last), number));
            (0..count).into_par_iter().map(|index| color(place(index))).numbers().into()
        });
        let resampled = Self::new(key, dims, grid.spacing(), values)?;
        let Self { label_names, label_colors, label_ids, .. } = self;
        let Self { unit, value_unit, encoding, palette, channel_name, display, .. } = self;
        let orientation = grid.orientation().copied();
        Ok(Self {
            colors,
            labels,
            is_label_map: resampling == Resampling::Nearest,
            label_names,
            label_colors,
            label_ids,
            unit,
            value_unit,
            encoding,
            palette,
            channel_name,
            display,
            orientation,
            ..resampled
        })
    }

    /// A number of voxels at a place between their centres, trilinear; NaN beside one that is.
    fn between(&self, at: DVec3, number: impl Fn(UVec3) -> f64) -> f64 {
        let last = self.dims() - 1;
        let low = at.floor().as_uvec3().min(last);
        let part = at - low.as_dvec3();
        let mut sum = 0.0;
        for corner in 0..8_u32 {
            let step = UVec3::new(corner & 1, corner >> 1 & 1, corner >> 2);
            let weight: f64 = (0..3).map(|axis| if step[axis] == 1 { part[axis] } else { 1.0 - part[axis] }).product();
            if weight > 0.0 {
                sum += weight * number((low + step).min(last));
            }
        }
        sum
    }
}

/// The index of the voxel that a place lies in; `None` beyond the grid.
fn voxel_around(at: DVec3, grid: &Grid) -> Option<usize> {
    let voxel = at.round().clamp(DVec3::ZERO, grid.dims.as_dvec3() - 1.0).as_uvec3();
    let is_there = (at - voxel.as_dvec3()).abs().max_element() <= 0.5 + SAME_PLACE;
    is_there.then(|| grid.index_of(voxel) as usize)
}

/// The labels of a file on the grid of the volume that they are of, each the nearest one in the files' own space, 0 beyond them; `None` if they lie there
/// already.
///
/// # Errors
/// If they lie nowhere in the volume, or memory is short.
pub(super) fn labels_onto(
    labels: &[u16],
    (own, volume): (Oriented, Oriented),
    path: &Path,
    access: &Access,
) -> Result<Option<Arc<[u16]>>, VolumeError> {
    /// The setting that names the file.
    const KEY: &str = "labels";
    if is_same_grid(volume, own) {
        return Ok(None);
    }
    let placement = Placement::new(volume, own);
    let count = volume.0.dims.element_product();
    access.reserve(path, KEY, format!("{count} voxels on the volume's grid"), 2 * u64::from(count))?;
    let index = |index: u32| voxel_around(placement.at(volume.0.voxel_at(index).as_dvec3()), own.0);
    if !(0..count).into_par_iter().any(|at| index(at).is_some()) {
        let [own, volume] = [own, volume].map(bounds);
        let name = path.display().to_string();
        return Err(VolumeError::invalid(&name, KEY, own, format!("a box that overlaps the volume's, {volume}")));
    }
    let (name, from, to) = (path.display(), own.0.dims, volume.0.dims);
    log::warn!("{name}: {KEY}: resampled from {from} to {to} voxels, the volume's, each label the nearest one");
    Ok(Some((0..count).into_par_iter().map(|at| index(at).map_or(0, |at| labels[at])).numbers().into()))
}

/// The box of a grid's voxel centres, in its file's space or, without one, around its centre.
fn bounds((grid, orientation): Oriented) -> String {
    let last = (grid.dims.as_dvec3() - 1.0) * grid.spacing;
    let (axes, first) = match orientation {
        Some(Orientation { axes, origin }) => (*axes, *origin),
        None => (glam::DMat3::IDENTITY, -last / 2.0),
    };
    let opposite = first + axes * last;
    let corner = |number: u32| {
        let take = |axis: u32| if number >> axis & 1 == 1 { last[axis as usize] } else { 0.0 };
        first + axes * DVec3::new(take(0), take(1), take(2))
    };
    let (low, high) = (0..8).map(corner).fold((opposite, opposite), |(low, high), at| (low.min(at), high.max(at)));
    format!("the box from {:.1?} to {:.1?}", low.to_array(), high.to_array())
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;
    use crate::{Grid, ReadOptions};

    /// The centre of a coarser level that does not fill the finest one's box lies beside it.
    #[test]
    fn coarser_levels_lie_where_their_centres_are() {
        let finest = Grid::new(UVec3::new(8, 2, 2), DVec3::ONE);
        let coarser =
            Grid::new(UVec3::new(5, 2, 2), DVec3::splat(2.0)).coarser_than(&finest, DVec3::new(1.5, 0.0, 0.0));
        // Values are world positions along x.
        let position = |grid: &Grid, index: u32| (grid.world_position(grid.voxel_at(index)) + grid.place()).x as f32;
        let of = |grid: Grid| {
            let values: Vec<f32> = (0..grid.dims.element_product()).map(|index| position(&grid, index)).collect();
            Volume::piece(grid, values)
        };
        let access = Access::new(&ReadOptions::default()).unwrap();
        let onto = of(coarser).onto(&of(finest), Resampling::Linear, ("channel", Path::new("file")), &access).unwrap();
        let mut inside = 0;
        for index in 0..finest.dims.element_product() {
            let (found, expected) = (onto.values().at(index as usize), position(&finest, index));
            assert_eq!(found.is_nan(), !(-2.5..=5.5).contains(&expected), "{index}");
            assert!(found.is_nan() || (found - expected).abs() < 1e-5, "{index}: {found} {expected}");
            inside += u32::from(!found.is_nan());
        }
        assert_eq!(inside, 7 * 4);
    }
}
