//! Sheared volumes: axes that are not at right angles, as after a tilted gantry or an affine registration, are resampled to an
//! orthogonal grid on reading.
//!
//! Gram–Schmidt orthogonalisation makes the axes, starting with the two that are nearest to a right angle. The third axis then keeps
//! its planes, and each sample moves only within its plane: in a CT scan with a tilted gantry, within its slice. So one bilinear
//! interpolation per voxel undoes any shear.

use std::collections::TryReserveError;
use std::path::Path;

use glam::{DMat3, DVec3, UVec3};

use super::VolumeError;
use super::access::Access;
use super::error::volume::invalid;
use super::grid::dims_of;
use super::loaded::{Legend, Loaded};
use super::orientation::{MAX_COSINE, lengths_and_directions};
use super::voxel::{Many, Voxel};
use super::voxels::Voxels;
use crate::parallel::prelude::*;

/// The maximum angle in degrees between an axis and its orthogonal direction. Flatter volumes have damaged headers.
const MAX_DEGREES: f64 = 80.0;

/// The maximum ratio of the orthogonal grid's voxels to the file's. Beyond it nearly all voxels are holes.
const MAX_GROWTH: u64 = 16;

/// Positions closer to a sample than this, in voxels, are the sample's own: the difference is rounding.
const SAME_PLACE: f64 = 1e-5;

/// The axes that [`Lattice::of`] accepts, for errors.
pub(super) fn allowed() -> String {
    format!("three axes of positive finite length, each less than {MAX_DEGREES}° from a right angle with the others")
}

/// The lattice of a file's voxels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lattice {
    /// The distances between voxels along the orthogonal axes.
    pub(super) spacing: DVec3,
    /// The directions of the orthogonal axes, one per column.
    pub(super) axes: DMat3,
    /// The shear that resampling must undo.
    shear: Option<Shear>,
}

/// The offsets of sheared samples on the orthogonal axes.
#[derive(Clone, Copy, Debug)]
struct Shear {
    /// The axes in the order of orthogonalisation: the first keeps its direction, the first two keep their plane.
    order: [usize; 3],
    /// The offset along the first axis for a step along the second, in voxels.
    second: f64,
    /// The offsets along the first and second axis for a step along the third, in voxels.
    third: [f64; 2],
    /// The maximum angle between an axis and its orthogonal direction, in degrees.
    degrees: f64,
}

impl Lattice {
    /// A lattice whose axes are orthogonal already.
    pub(super) fn straight(spacing: DVec3, axes: DMat3) -> Self {
        Self { spacing, axes, shear: None }
    }

    /// The lattice with these vectors between neighbouring voxels along the three axes.
    ///
    /// # Errors
    /// A description of the vectors if they are not [`allowed`].
    pub(super) fn of(steps: [DVec3; 3]) -> Result<Self, String> {
        if let Ok((spacing, axes)) = lengths_and_directions(steps) {
            return Ok(Self::straight(spacing, axes));
        }
        let lengths = steps.map(DVec3::length);
        if !lengths.iter().all(|&length| length > 0.0 && length.is_finite()) {
            return Err(format!("axes of the lengths {lengths:?}"));
        }
        let cosine = |a: usize, b: usize| {
            let cosine = (steps[a] / lengths[a]).dot(steps[b] / lengths[b]).abs();
            if cosine <= MAX_COSINE { 0.0 } else { cosine }
        };
        // Of several right angles the one of x and y comes first, so that slices stay slices.
        let orders = [[0, 1, 2], [0, 2, 1], [1, 2, 0]];
        let order = orders.into_iter().min_by(|&[a, b, _], &[c, d, _]| cosine(a, b).total_cmp(&cosine(c, d)));
        let order @ [a, b, c] = order.unwrap_or([0, 1, 2]);
        // The component of a step along another axis; 0 if the angle counts as right.
        let along = |step: usize, direction: DVec3| {
            let part = steps[step].dot(direction);
            if part.abs() <= MAX_COSINE * lengths[step] { 0.0 } else { part }
        };
        let x = steps[a] / lengths[a];
        let b_along_x = along(b, x);
        let (y, b_length) = split(steps[b] - steps[b].dot(x) * x);
        let (c_along_x, c_along_y) = (along(c, x), along(c, y));
        let (z, c_length) = split(steps[c] - steps[c].dot(x) * x - steps[c].dot(y) * y);
        let angle = |orthogonal: f64, length: f64| libm::acos((orthogonal / length).clamp(0.0, 1.0)).to_degrees();
        let degrees = angle(b_length, lengths[b]).max(angle(c_length, lengths[c]));
        if degrees.is_nan() || degrees > MAX_DEGREES {
            return Err(format!("axes at {degrees:.2}° from a right angle"));
        }
        let (mut spacing, mut axes) = (DVec3::ZERO, DMat3::ZERO);
        for (axis, direction, length) in [(a, x, lengths[a]), (b, y, b_length), (c, z, c_length)] {
            *axes.col_mut(axis) = direction;
            spacing[axis] = length;
        }
        let third = [c_along_x / lengths[a], c_along_y / b_length];
        let shear = Shear { order, second: b_along_x / lengths[a], third, degrees };
        Ok(Self { spacing, axes, shear: Some(shear) })
    }

    /// The loaded samples, resampled to the orthogonal axes. Voxels outside every sample's cell are holes.
    ///
    /// # Errors
    /// If the orthogonal grid has too many voxels. `field` is the file's field with the axes.
    pub(super) fn straighten(
        &self,
        path: &Path,
        field: &str,
        loaded: Loaded,
        access: &Access,
    ) -> Result<Loaded, VolumeError> {
        let Some(shear) = self.shear else { return Ok(loaded) };
        if access.is_noting() {
            let found = format!("axes sheared by {:.2}°", shear.degrees);
            return Err(invalid(path, field, found, "axes at right angles, where a file is read by boxes"));
        }
        loaded.check_single(path, "one, where axes are not at right angles")?;
        let ranges = shear.ranges(loaded.dims);
        let sizes = ranges.map(|[first, last]| last - first + 1.0);
        let voxels = u64::from(loaded.dims.element_product());
        let dims = dims_of(sizes.map(|size| size as u64))
            .filter(|dims| u64::from(dims.element_product()) <= MAX_GROWTH.saturating_mul(voxels));
        let degrees = shear.degrees;
        let too_many = |found: String| {
            let allowed = format!("a shear that needs at most {MAX_GROWTH} times the file's {voxels} voxels");
            invalid(path, field, format!("axes sheared by {degrees:.2}°, {found}"), allowed)
        };
        let Some(dims) = dims else { return Err(too_many(format!("an orthogonal grid of {sizes:?} voxels"))) };
        // Between samples values are no whole numbers.
        let bytes = u64::from(dims.element_product()) * access.wanted().alone();
        access.reserve(path, field, format!("an orthogonal grid of {dims} voxels"), bytes)?;
        log::warn!(
            "{}: sheared by {degrees:.2}°: resampled to an orthogonal grid of {dims} voxels, with holes beside the samples",
            path.display()
        );
        let first = DVec3::from_array(ranges.map(|[first, _]| first));
        let is_nearest = loaded.legends.iter().any(Legend::is_of_labels);
        let from = loaded.dims;
        let values = match &loaded.values {
            Voxels::Values(values) => {
                shear.resampled(&Samples::<f32> { dims: from, values, is_nearest }, first, dims).map(Voxels::from)
            }
            Voxels::Ids(values) => {
                shear.resampled(&Samples::<u64> { dims: from, values, is_nearest }, first, dims).map(Voxels::from)
            }
        };
        let values = values.map_err(|error| too_many(format!("an orthogonal grid of {dims} voxels: {error}")))?;
        let mut orientation = loaded.orientation;
        if let Some(orientation) = &mut orientation {
            orientation.origin += orientation.axes * (first * self.spacing);
        }
        Ok(Loaded { dims, orientation, values, ..loaded })
    }
}

/// The direction and length of a vector.
fn split(vector: DVec3) -> (DVec3, f64) {
    let length = vector.length();
    (vector / length, length)
}

impl Shear {
    /// Voxels on the orthogonal grid of some dimensions, whose first one lies at a place.
    ///
    /// # Errors
    /// If there is no memory for them.
    fn resampled<T: Voxel>(
        &self,
        source: &Samples<'_, T>,
        first: DVec3,
        dims: UVec3,
    ) -> Result<T::Many, TryReserveError> {
        let mut values = Vec::new();
        values.try_reserve_exact(dims.element_product() as usize)?;
        values.resize(dims.element_product() as usize, T::HOLE);
        let rows = values.par_chunks_mut(dims.x as usize).enumerate();
        rows.for_each(|(row, values)| {
            let (y, z) = (row as u32 % dims.y, row as u32 / dims.y);
            for (x, value) in values.iter_mut().enumerate() {
                let place = self.in_source(UVec3::new(x as u32, y, z).as_dvec3() + first);
                *value = source.at(place, self.order).unwrap_or(T::HOLE);
            }
        });
        Ok(values.into())
    }

    /// The first and last voxel along each axis of the orthogonal grid that lie in a sample's cell. Voxel 0 is at sample 0.
    fn ranges(&self, dims: UVec3) -> [[f64; 2]; 3] {
        let [a, b, c] = self.order;
        let last = dims.as_dvec3() - 1.0;
        // An axis's contribution at its first and last sample, in ascending order.
        let span =
            |step: f64, [first, last]: [f64; 2]| [(step * first).min(step * last), (step * first).max(step * last)];
        let cells = |axis: usize| [-0.5, last[axis] + 0.5];
        let planes = [0.0, last[c]];
        let sum = |spans: &[[f64; 2]]| {
            let [low, high] = [0, 1].map(|end| spans.iter().map(|span| span[end]).sum::<f64>());
            [(low - SAME_PLACE).ceil(), (high + SAME_PLACE).floor()]
        };
        let mut ranges = [[0.0; 2]; 3];
        ranges[a] = sum(&[cells(a), span(self.second, cells(b)), span(self.third[0], planes)]);
        ranges[b] = sum(&[cells(b), span(self.third[1], planes)]);
        ranges[c] = planes;
        ranges
    }

    /// The position among the samples of a position on the orthogonal grid.
    fn in_source(&self, place: DVec3) -> DVec3 {
        let [a, b, c] = self.order;
        let mut source = place;
        source[b] -= place[c] * self.third[1];
        source[a] -= source[b] * self.second + place[c] * self.third[0];
        source
    }
}

/// Samples on their own lattice.
struct Samples<'a, T: Voxel> {
    dims: UVec3,
    values: &'a T::Many,
    /// Whether places between samples have the nearest one.
    is_nearest: bool,
}

impl<T: Voxel> Samples<'_, T> {
    /// The value at a position that is a whole number along the last of the given axes; `None` outside every sample's cell.
    fn at(&self, place: DVec3, [a, b, c]: [usize; 3]) -> Option<T> {
        let strides = [1, self.dims.x as usize, self.dims.x as usize * self.dims.y as usize];
        let plane = place[c] as usize * strides[c];
        let (i, i_part) = cell(place[a], self.dims[a])?;
        let (j, j_part) = cell(place[b], self.dims[b])?;
        let sample = |i: usize, j: usize| self.values.at(plane + i * strides[a] + j * strides[b]);
        let behind = |part: f64| usize::from(part >= 0.5);
        let row = |j: usize| match i_part {
            0.0 => sample(i, j),
            part if self.is_nearest => sample(i + behind(part), j),
            part => sample(i, j).between(sample(i + 1, j), part),
        };
        Some(match j_part {
            0.0 => row(j),
            part if self.is_nearest => row(j + behind(part)),
            part => row(j).between(row(j + 1), part),
        })
    }
}

/// The sample at or before a position on an axis of `samples` samples, and the fraction of the way to the next one (0 at the last).
/// The outer halves of the outermost cells count as their samples' positions; beyond them the result is `None`.
fn cell(place: f64, samples: u32) -> Option<(usize, f64)> {
    let last = f64::from(samples - 1);
    if !(-0.5 - SAME_PLACE..=last + 0.5 + SAME_PLACE).contains(&place) {
        return None;
    }
    let near = place.round();
    let place = if (place - near).abs() < SAME_PLACE { near } else { place }.clamp(0.0, last);
    Some((place as usize, place.fract()))
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::super::ReadOptions;
    use super::super::orientation::Orientation;
    use super::super::sample_type::SampleType;
    use super::*;

    fn loaded(dims: UVec3, lattice: &Lattice, origin: DVec3, values: impl Into<Voxels>) -> Loaded {
        let orientation = Some(Orientation { axes: lattice.axes, origin });
        Loaded { spacing: Some(lattice.spacing), orientation, ..Loaded::new(dims, SampleType::F32, values.into()) }
    }

    fn straighten(dims: UVec3, steps: [DVec3; 3], values: impl Into<Voxels>) -> Loaded {
        let lattice = Lattice::of(steps).unwrap();
        let access = Access::new(&ReadOptions::default()).unwrap();
        lattice.straighten(Path::new("here"), "axes", loaded(dims, &lattice, DVec3::ZERO, values), &access).unwrap()
    }

    /// The positions of a grid's voxels, x fastest.
    fn places(dims: UVec3) -> impl Iterator<Item = DVec3> {
        let [x, y, z] = dims.to_array();
        (0..z).flat_map(move |z| (0..y).flat_map(move |y| (0..x).map(move |x| UVec3::new(x, y, z).as_dvec3())))
    }

    #[test]
    fn right_angles_stay_as_they_are() {
        let steps = [DVec3::new(0.0, 2.0, 0.0), DVec3::new(3.0, 0.0, 0.0002), DVec3::new(0.0, 0.0, 4.0)];
        let result = straighten(UVec3::new(2, 1, 1), steps, vec![1.0_f32, 2.0]);
        assert_eq!(result.dims, UVec3::new(2, 1, 1));
        assert_eq!(result.values.values(), [1.0, 2.0]);
    }

    /// Slices that a tilted gantry moves by one row each, and by half a row.
    #[test]
    fn slices_move_within_their_planes() {
        let dims = UVec3::new(1, 2, 3);
        let values = || (0..6).map(|i| (10 * (i / 2) + i % 2) as f32).collect::<Vec<_>>();
        let hole = f32::NAN;
        let tilted = |shift: f64| [DVec3::X, 2.0 * DVec3::Y, DVec3::new(0.0, 2.0 * shift, 4.0)];
        let whole = straighten(dims, tilted(1.0), values());
        assert_eq!((whole.dims, whole.spacing), (UVec3::new(1, 4, 3), Some(DVec3::new(1.0, 2.0, 4.0))));
        let expected = [0.0, 1.0, hole, hole, hole, 10.0, 11.0, hole, hole, hole, 20.0, 21.0];
        assert!(
            whole.values.values().iter().zip(expected).all(|(a, b)| a.to_bits() == b.to_bits()),
            "{:?}",
            whole.values
        );
        // Tilted the other way, the first voxel is no longer sample 0.
        let back = straighten(dims, tilted(-1.0), values());
        assert_eq!(back.orientation.unwrap().origin, DVec3::new(0.0, -4.0, 0.0));
        let expected = [hole, hole, 0.0, 1.0, hole, 10.0, 11.0, hole, 20.0, 21.0, hole, hole];
        assert!(
            back.values.values().iter().zip(expected).all(|(a, b)| a.to_bits() == b.to_bits()),
            "{:?}",
            back.values
        );
        let half = straighten(dims, tilted(0.5), values());
        assert_eq!(half.dims, UVec3::new(1, 3, 3));
        // Half a row off, the outer halves of the outermost cells have their samples' values.
        let expected = [0.0, 1.0, hole, 10.0, 10.5, 11.0, hole, 20.0, 21.0];
        assert!(
            half.values.values().iter().zip(expected).all(|(a, b)| a.to_bits() == b.to_bits()),
            "{:?}",
            half.values
        );
    }

    /// A field that is linear in the patient stays the same field, whichever axes are sheared.
    #[test]
    fn linear_fields_stay() {
        let dims = UVec3::new(6, 7, 8);
        let straight = [DVec3::new(0.6, 0.8, 0.0), DVec3::new(-1.6, 1.2, 0.0), DVec3::new(0.0, 0.0, 3.0)];
        let field = |place: DVec3| place.dot(DVec3::new(1.0, -2.0, 0.5)) + 100.0;
        let skews = [(0, 1, 0.3), (1, 0, -0.2), (2, 0, 0.5), (2, 1, -0.4), (0, 2, 0.15)];
        for mask in 1_u32..32 {
            let mut steps = straight;
            for (number, (step, other, part)) in skews.into_iter().enumerate() {
                if mask >> number & 1 == 1 {
                    steps[step] += part * straight[other];
                }
            }
            let position = |place: DVec3| steps[0] * place.x + steps[1] * place.y + steps[2] * place.z;
            let values: Vec<f32> = places(dims).map(|place| field(position(place)) as f32).collect();
            let result = straighten(dims, steps, values);
            let Orientation { axes, origin } = result.orientation.unwrap();
            let spacing = result.spacing.unwrap();
            assert!((axes.transpose() * axes).abs_diff_eq(DMat3::IDENTITY, 1e-12), "{mask}");
            let inverse = DMat3::from_cols(steps[0], steps[1], steps[2]).inverse();
            let (mut compared, mut held) = (0, 0);
            for (place, value) in places(result.dims).zip(result.values.values()) {
                let at = origin + axes * (spacing * place);
                let source = inverse * at;
                let distance = (source - source.clamp(DVec3::ZERO, dims.as_dvec3() - 1.0)).abs().max_element();
                if (distance - 0.5).abs() > 1e-4 {
                    assert_eq!(value.is_nan(), distance > 0.5, "{mask}: {value} at {source}");
                }
                held += u32::from(value.is_finite());
                if distance < 1e-9 {
                    assert!((f64::from(value) - field(at)).abs() < 1e-4, "{mask}: {value} at {source}");
                    compared += 1;
                }
            }
            // Cells and voxels have equal volume, so about as many voxels as samples have a value.
            let samples = dims.element_product();
            assert!(2 * compared > samples && held.abs_diff(samples) < samples / 4, "{mask}: {compared}, {held}");
        }
    }

    #[test]
    fn the_axis_between_right_angles_moves() {
        let angle = 20_f64.to_radians();
        for sheared in 0..3 {
            let mut steps = [DVec3::X, DVec3::Y, DVec3::Z];
            steps[sheared] = angle.cos() * steps[sheared] + angle.sin() / 2_f64.sqrt() * (DVec3::ONE - steps[sheared]);
            let shear = Lattice::of(steps).unwrap().shear.unwrap();
            assert_eq!(shear.order[2], sheared);
            assert!((shear.degrees - 20.0).abs() < 1e-9, "{}", shear.degrees);
        }
        // Of two sheared axes the later one moves.
        let skew = [DVec3::X, DVec3::new(0.5, 3.0, 0.0), DVec3::Z];
        assert_eq!(Lattice::of(skew).unwrap().shear.unwrap().order, [0, 2, 1]);
    }

    /// The right ones are those of [`labels_are_the_nearest_ones_and_holes_spread`].
    #[test]
    fn values_that_the_file_calls_labels_are_the_nearest_ones() {
        let lattice = Lattice::of([DVec3::X, DVec3::Y, DVec3::new(0.25, 0.0, 1.0)]).unwrap();
        let access = Access::new(&ReadOptions::default()).unwrap();
        let values: Vec<f32> = (1..10).map(|label| label as f32).collect();
        let legends = vec![Legend { are_labels: true, ..Legend::default() }];
        let loaded = Loaded { legends, ..loaded(UVec3::new(3, 1, 3), &lattice, DVec3::ZERO, values) };
        let straight = lattice.straighten(Path::new("here"), "axes", loaded, &access).unwrap();
        let found = straight.values.values().iter().map(|value| if value.is_nan() { 0.0 } else { value });
        assert!(found.eq([1.0, 2.0, 3.0, 0.0, 4.0, 5.0, 6.0, 0.0, 7.0, 8.0, 9.0, 9.0]));
    }

    #[test]
    fn labels_are_the_nearest_ones_and_holes_spread() {
        let steps = [DVec3::X, DVec3::Y, DVec3::new(0.25, 0.0, 1.0)];
        let labels = straighten(UVec3::new(3, 1, 3), steps, vec![1_u64, 2, 3, 4, 5, 6, 7, 8, 9]);
        assert_eq!((labels.dims.x, labels.values.ids()), (4, vec![1, 2, 3, 0, 4, 5, 6, 0, 7, 8, 9, 9]));
        let values = straighten(UVec3::new(3, 1, 2), steps, vec![1.0, 2.0, 3.0, 4.0, 5.0, f32::NAN]);
        let found: Vec<bool> = values.values.values().iter().map(|value| value.is_nan()).collect();
        assert_eq!(found, [false, false, false, false, false, true]);
    }

    #[test]
    fn what_is_refused() {
        let refused = |steps: [DVec3; 3], found: &str| {
            let error = Lattice::of(steps).unwrap_err();
            assert!(error.contains(found), "{error}");
        };
        refused([DVec3::X, DVec3::Y, DVec3::new(1.0, 1.0, 0.0)], "axes at 90.00° from a right angle");
        refused([DVec3::X, DVec3::X, DVec3::Z], "from a right angle");
        refused([DVec3::X, DVec3::Y, DVec3::ZERO], "axes of the lengths [1.0, 1.0, 0.0]");
        refused([DVec3::X, DVec3::Y, DVec3::splat(f64::NAN)], "NaN");
        // Fine columns and slices far apart give a grid of mostly holes.
        let lattice = Lattice::of([1e-3 * DVec3::X, DVec3::Y, DVec3::new(1.0, 0.0, 1.0)]).unwrap();
        let refused = |lattice: Lattice, options: ReadOptions| {
            let loaded = loaded(UVec3::new(2, 1, 9), &lattice, DVec3::ZERO, vec![0.0_f32; 18]);
            let access = Access::new(&options).unwrap();
            lattice.straighten(Path::new("here"), "axes", loaded, &access).err().unwrap().to_string()
        };
        let error = refused(lattice, ReadOptions::default());
        let expected = "here: axes: found axes sheared by 45.00°, an orthogonal grid of [8002.0, 1.0, 9.0] voxels";
        assert!(error.starts_with(expected), "{error}");
        // This grid needs too much memory.
        let lattice = Lattice::of([DVec3::X, DVec3::Y, DVec3::new(1.0, 0.0, 1.0)]).unwrap();
        let error = refused(lattice, ReadOptions::default().with_memory(100));
        assert!(error.contains("[10, 1, 9] voxels, which take 360 bytes of memory, allowed: at most"), "{error}");
    }
}
