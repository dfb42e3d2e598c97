//! The slices of one grid: their order and distances.

use std::collections::BTreeMap;
use std::path::Path;

use glam::DVec3;

use super::super::VolumeError;
use super::super::error::volume::invalid;
use super::super::orientation::{lengths_and_directions, orthogonal};
use super::super::shear::{self, Lattice};
use super::image::{Frame, Image};

/// Directions with a smaller difference, and pixel sizes with a smaller relative difference, count as equal.
const SAME: f64 = 1e-4;
/// The error of positions, as a fraction of a step, that gives no warning.
const EVEN: f64 = 0.01;
/// The maximum sideways distance of a slice from the line, as a fraction of a pixel.
const STRAIGHT: f64 = 0.5;
/// The sideways distance, as a fraction of a pixel, that gives no warning.
const EXACT: f64 = 0.01;
/// A step larger than this many usual steps is a gap.
const GAP: f64 = 1.5;

/// The element with a slice's position.
pub(super) const POSITION: &str = "ImagePositionPatient";

/// Refuses files of several series with a list of these.
pub(super) fn check_one(folder: &Path, images: &[Image]) -> Result<(), VolumeError> {
    let mut series: BTreeMap<&str, (usize, &str)> = BTreeMap::new();
    for image in images {
        series.entry(&image.series).or_insert((0, &image.description)).0 += 1;
    }
    let listed =
        series.iter().take(LISTED).map(|(id, (count, description))| format!("{count} of {description} ({id})"));
    let found = match series.len() {
        0 => "no image".to_owned(),
        1 => return Ok(()),
        count => {
            format!(
                "{count} series: {}{}",
                listed.collect::<Vec<_>>().join(", "),
                if count > LISTED { ", …" } else { "" }
            )
        }
    };
    Err(invalid(folder, "SeriesInstanceUID", found, "the slices of one series"))
}

/// A frame of a volume.
pub(super) struct Slice {
    /// The index of its image, and of the frame in that.
    pub(super) image: usize,
    pub(super) frame: usize,
    pub(super) position: DVec3,
    pub(super) rescale: [f64; 2],
}

/// All frames of a volume, in order along its z axis.
pub(super) struct Series {
    pub(super) slices: Vec<Slice>,
    /// The lattice in LPS.
    pub(super) lattice: Lattice,
}

impl Series {
    /// The volume that the frames of some images make up.
    pub(super) fn of(path: &Path, images: &[Image]) -> Result<Self, VolumeError> {
        let first = check_alike(path, images)?;
        let [row, column] = first.directions;
        let (_, axes) = lengths_and_directions([row, column, row.cross(column)])
            .map_err(|found| invalid(path, "ImageOrientationPatient", found, orthogonal()))?;
        let mut slices: Vec<Slice> = Vec::new();
        for (image, Image { frames, .. }) in images.iter().enumerate() {
            slices.extend(frames.iter().enumerate().map(|(frame, &Frame { position, rescale, .. })| Slice {
                image,
                frame,
                position,
                rescale,
            }));
        }
        let along = |slice: &Slice| slice.position.dot(axes.z_axis);
        slices.sort_by(|a, b| along(a).total_cmp(&along(b)));
        let name = |slice: &Slice| match images[slice.image].frames.len() {
            1 => images[slice.image].path.file_name().unwrap_or_default().display().to_string(),
            _ => format!("frame {}", slice.frame + 1),
        };
        let [x, y] = first.spacing;
        let z = match step(&slices.iter().map(along).collect::<Vec<_>>()) {
            Steps::None => first.thickness.unwrap_or(x),
            Steps::Even { step, off } => {
                if off > EVEN * step {
                    let path = path.display();
                    log::warn!(
                        "{path}: slices are not evenly spaced: taken to be {step:.4} mm apart, which is wrong by up to {off:.4} mm"
                    );
                }
                step
            }
            Steps::Uneven { at, step, usual } => {
                let [one, next] = [&slices[at], &slices[at + 1]].map(name);
                let found = format!("{step:.4} mm between {one} and {next}, {usual:.4} mm between others");
                let allowed = "slices at even distances, one at each place";
                return Err(invalid(path, POSITION, found, allowed));
            }
        };
        let spacing = DVec3::new(x, y, z);
        let sideways = |slice: &Slice| {
            let offset = slice.position - slices[0].position;
            offset - offset.dot(axes.z_axis) * axes.z_axis
        };
        // The slice that is farthest from the line through the first slice along the normal plus `drift` per slice.
        let farthest = |drift: DVec3| {
            let off = |(i, slice)| ((sideways(slice) - i as f64 * drift).length(), slice);
            slices.iter().enumerate().map(off).fold((0.0, &slices[0]), |a, b| if b.0 > a.0 { b } else { a })
        };
        let pixel = x.min(y);
        let (mut off, mut slice) = farthest(DVec3::ZERO);
        let mut lattice = Lattice::straight(spacing, axes);
        if off > STRAIGHT * pixel {
            // If the slices are sheared, the line runs through the first and the last one.
            let last = slices.len() - 1;
            let drift = sideways(&slices[last]) / last as f64;
            (off, slice) = farthest(drift);
            if off > STRAIGHT * pixel {
                let found = format!("{}, {off:.4} mm off the line through the first and the last slice", name(slice));
                return Err(invalid(
                    path,
                    POSITION,
                    found,
                    format!("slices on one line, to half a pixel of {pixel} mm"),
                ));
            }
            let steps = [x * axes.x_axis, y * axes.y_axis, z * axes.z_axis + drift];
            lattice = Lattice::of(steps).map_err(|found| invalid(path, POSITION, found, shear::allowed()))?;
        }
        if off > EXACT * pixel {
            let (path, name) = (path.display(), name(slice));
            log::warn!("{path}: slices are not quite on one line: {name} is {off:.4} mm off, the largest error");
        }
        Ok(Self { slices, lattice })
    }
}

/// The number of kinds of frames, and of series, that errors list.
const LISTED: usize = 8;

/// The first of some frames that share sizes and directions; refuses others with a list of both.
fn check_alike<'a>(path: &Path, images: &'a [Image]) -> Result<&'a Frame, VolumeError> {
    let frames = images.iter().flat_map(|image| image.frames.iter().map(move |frame| (image, frame)));
    let (kinds, others) = kinds_of(frames, |(other, kind), (image, frame)| {
        let near = |a: f64, b: f64| (a - b).abs() <= SAME * a.max(b);
        other.pixels.samples == image.pixels.samples
            && [other.pixels.columns, other.pixels.rows] == [image.pixels.columns, image.pixels.rows]
            && near(kind.spacing[0], frame.spacing[0])
            && near(kind.spacing[1], frame.spacing[1])
            && (0..2).all(|axis| kind.directions[axis].abs_diff_eq(frame.directions[axis], SAME))
    });
    if let [((_, first), _)] = kinds.as_slice() {
        return Ok(first);
    }
    let listed = kinds.iter().map(|((image, frame), count)| {
        let ([x, y], [row, column]) = (frame.spacing, frame.directions);
        let (columns, rows) = (image.pixels.columns, image.pixels.rows);
        format!("{count} of {columns} × {rows}, {x} × {y} mm, along {row} and {column}")
    });
    let others = (others > 0).then(|| format!("{others} of other kinds"));
    let found = listed.chain(others).collect::<Vec<_>>().join("; ");
    Err(invalid(path, "slices", found, "slices of one size, one distance of pixels, and one orientation"))
}

/// The first kinds of some items, each with its first item and its number of items, and the number of items of other kinds. Every item is compared with
/// the listed kinds alone.
fn kinds_of<T>(items: impl Iterator<Item = T>, are_alike: impl Fn(&T, &T) -> bool) -> (Vec<(T, usize)>, usize) {
    let (mut kinds, mut others) = (Vec::<(T, usize)>::new(), 0);
    for item in items {
        match kinds.iter().position(|(kind, _)| are_alike(kind, &item)) {
            Some(kind) => kinds[kind].1 += 1,
            None if kinds.len() < LISTED => kinds.push((item, 1)),
            None => others += 1,
        }
    }
    (kinds, others)
}

/// The steps between ascending positions.
enum Steps {
    /// There is only one position.
    None,
    /// All steps are about equal; positions are off by at most `off`.
    Even { step: f64, off: f64 },
    /// The step after position `at` differs from the usual one.
    Uneven { at: usize, step: f64, usual: f64 },
}

fn step(positions: &[f64]) -> Steps {
    let steps: Vec<f64> = positions.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let Some(last) = steps.len().checked_sub(1) else { return Steps::None };
    let usual = median(&steps);
    let is_other = |&step: &f64| step > GAP * usual || step * GAP < usual || step <= 0.0;
    if let Some(at) = steps.iter().position(is_other) {
        return Steps::Uneven { at, step: steps[at], usual };
    }
    let step = (positions[last + 1] - positions[0]) / (last + 1) as f64;
    let errors = positions.iter().enumerate().map(|(i, position)| (position - positions[0] - i as f64 * step).abs());
    let off = errors.fold(0.0, f64::max);
    Steps::Even { step, off }
}

fn median(steps: &[f64]) -> f64 {
    let mut sorted = steps.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    #[test]
    fn kinds_are_counted_by_few_comparisons() {
        let compared = Cell::new(0_usize);
        let are_alike = |a: &u32, b: &u32| {
            compared.set(compared.get() + 1);
            a == b
        };
        let (kinds, others) = kinds_of((0..10_000).chain(0..3), are_alike);
        assert_eq!(
            (kinds, others),
            ([2, 2, 2, 1, 1, 1, 1, 1].into_iter().enumerate().map(|(at, count)| (at as u32, count)).collect(), 9992)
        );
        assert!(compared.get() <= LISTED * 10_003, "{}", compared.get());
    }
}
