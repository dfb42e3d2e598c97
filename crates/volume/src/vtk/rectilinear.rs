//! Rectilinear grids: the samples along each axis lie at coordinates of their own, at whose finest distance the volume is resampled.

use std::path::Path;

use glam::{DVec3, UVec3};

use super::super::VolumeError;
use super::super::access::Access;
use super::super::error::volume::invalid;
use super::super::grid::{SIZES, dims_of};
use super::super::loaded::Loaded;
use super::super::uneven::{Even, MAX_GROWTH, SAME_PLACE};

/// The coordinates of the points along an axis, and their name in errors.
pub(super) struct Coordinates {
    pub(super) name: String,
    pub(super) places: Vec<f64>,
}

impl Coordinates {
    /// The centres of the cells between points; a single layer of points has one layer of cells.
    pub(super) fn of_cells(self) -> Self {
        if self.places.len() == 1 {
            return self;
        }
        Self { places: self.places.windows(2).map(|pair| f64::midpoint(pair[0], pair[1])).collect(), ..self }
    }

    /// The greatest distance between places and even ones, if there are several: they must ascend.
    fn step_and_error(&self, path: &Path) -> Result<Option<[f64; 2]>, VolumeError> {
        let Self { name, places } = self;
        let ascends = |pair: &[f64]| pair[0] < pair[1] && (pair[1] - pair[0]).is_finite();
        if let Some(pair) = places.windows(2).find(|pair| !ascends(pair)) {
            return Err(invalid(path, name, format!("{} before {}", pair[0], pair[1]), "ascending finite numbers"));
        }
        let [first, .., last] = places.as_slice() else { return Ok(None) };
        let step = (last - first) / (places.len() - 1) as f64;
        let error = |(at, place): (usize, &f64)| (place - (first + at as f64 * step)).abs();
        Ok(Some([step, places.iter().enumerate().map(error).fold(0.0, f64::max)]))
    }
}

/// A volume whose samples lie at coordinates, resampled along axes on which these are not even: linearly, labels by the nearest sample.
pub(super) fn resampled(
    path: &Path,
    coordinates: [Coordinates; 3],
    mut loaded: Loaded,
    access: &Access,
) -> Result<Loaded, VolumeError> {
    let mut steps = [None; 3];
    for (axis, of_axis) in coordinates.iter().enumerate() {
        let Coordinates { name, places } = of_axis;
        let Some([step, error]) = of_axis.step_and_error(path)? else { continue };
        steps[axis] = Some(step);
        if error <= SAME_PLACE * step {
            continue;
        }
        let allowed = format!("distances for which {MAX_GROWTH} times as many samples are enough");
        let even = Even::of(places).map_err(|distances| invalid(path, name, distances, allowed))?;
        steps[axis] = Some(even.step);
        let (from, to) = (places.len(), even.places.len());
        let mut sizes = loaded.dims.to_array();
        let inner: u32 = sizes[..axis].iter().product();
        sizes[axis] = to as u32;
        let dims = dims_of(sizes).ok_or_else(|| invalid(path, name, format!("{sizes:?} samples"), SIZES))?;
        let channels = loaded.values.count() as u64 / u64::from(loaded.dims.element_product());
        let bytes = channels * u64::from(dims.element_product()) * access.wanted().bytes(loaded.kind, true);
        access.reserve(path, name, format!("{dims} voxels"), bytes)?;
        let values = even.resampled(&loaded.values, inner as usize, from);
        loaded.values = values.map_err(|error| invalid(path, name, format!("{dims} voxels: {error}"), "fewer"))?;
        loaded.dims = UVec3::from_array(sizes);
        let step = |pair: &[f64]| pair[1] - pair[0];
        let (least, most) = places
            .windows(2)
            .map(step)
            .fold((f64::INFINITY, 0.0_f64), |(least, most), step| (least.min(step), most.max(step)));
        log::warn!(
            "{}: {name}: distances from {least:.4} to {most:.4}: resampled from {from} to {to} samples, {:.4} apart",
            path.display(),
            even.step
        );
    }
    // An axis with one sample is as thick as the finest of the others.
    let finest = steps.into_iter().flatten().fold(f64::INFINITY, f64::min);
    let one = if finest.is_finite() { finest } else { 1.0 };
    loaded.spacing = Some(DVec3::from_array(steps.map(|step| step.unwrap_or(one))));
    Ok(loaded)
}
